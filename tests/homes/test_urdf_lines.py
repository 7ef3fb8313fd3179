"""The URDF of an assembled home is what yourdfpy writes of it and reads back."""

from xml.etree import ElementTree

import numpy as np
import yourdfpy

from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.homes.assemble import assemble
from chmarl_pb.homes.layout import load_layout
from chmarl_pb.homes.urdf_lines import urdf_bytes


def test_the_text_is_that_of_yourdfpy() -> None:
    robot = assemble(load_layout(SCENES_DIR / "home_1.toml"))
    model = yourdfpy.URDF(robot, build_scene_graph=False, load_meshes=False, filename_handler=str)
    ours, theirs = (ElementTree.fromstring(text) for text in (urdf_bytes(robot), model.write_xml_string()))
    for one, other in zip(ours.iter(), theirs.iter(), strict=True):
        assert (one.tag, sorted(one.keys())) == (other.tag, sorted(other.keys()))
        for key in one.keys():
            if key in ("name", "filename", "type", "link"):
                assert one.get(key) == other.get(key)
            else:
                number, expected = ([float(word) for word in element.attrib[key].split()] for element in (one, other))
                assert np.allclose(number, expected, atol=1e-6)
