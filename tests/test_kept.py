"""What has been read of files is kept as long as none of them changes."""

import shutil
from pathlib import Path

import pytest
import trimesh

from chmarl_pb.errors import AssetError
from chmarl_pb.evaluation.provenance import robots_hash
from chmarl_pb.homes.catalog_file import load_catalog
from chmarl_pb.kept import Kept
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.plain_robot import plain_robot
from tests.helpers.own_robots import crane
from tests.helpers.own_things import BOX, CRATE, write_things


def write_box(path: Path, height: float) -> None:
    trimesh.creation.box((0.1, 0.1, height)).export(path)


def test_what_is_kept_follows_all_files(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    kept, read = Kept[str](2), []

    def get(key: str) -> str:
        def whole() -> tuple[str, list[Path]]:
            read.append(key)
            return first.read_text() + second.read_text(), [first, second]

        return kept.get(key, first, whole)

    first.write_text("a")
    second.write_text("b")
    assert get("x") == get("x") == "ab" and read == ["x"]
    for changed in (first, second):
        changed.write_text(changed.read_text() * 2)
        get("x")
        assert get("x") == first.read_text() + second.read_text()
    assert read == ["x"] * 3
    for key in "yzx":
        get(key)
    assert read == [*"xxxyzx"], "only two are kept"
    second.unlink()
    with pytest.raises(FileNotFoundError):
        get("x")


def test_what_is_faulty_is_read_again(tmp_path: Path) -> None:
    kept, read = Kept[int](2), iter(range(9))
    assert [kept.get("x", tmp_path, lambda: (next(read), None)) for _ in range(3)] == [0, 1, 2]


def test_changed_meshes_of_things_and_robots_are_noticed(tmp_path: Path) -> None:
    catalog, robot = write_things(tmp_path / "things"), crane(tmp_path)
    (tmp_path / "things" / "crate.urdf").write_text(CRATE.replace(BOX, '<mesh filename="crate.obj"/>'))
    urdf = tmp_path / "crane.urdf"
    urdf.write_text(urdf.read_text().replace('<box size="0.36 0.3 0.3"/>', '<mesh filename="crane.obj"/>'))
    seen = set()
    for height in (0.08, 0.16, 0.08):
        for mesh in (tmp_path / "things" / "crate.obj", tmp_path / "crane.obj"):
            write_box(mesh, height)
        model = find_model(str(robot))
        assert load_catalog(catalog) is load_catalog(catalog) and plain_robot(model.urdf) == plain_robot(model.urdf)
        seen.add((load_catalog(catalog).content, *robots_hash([model]).values()))
    assert len(seen) == 2
    shutil.rmtree(tmp_path / "things")
    with pytest.raises(AssetError):
        load_catalog(catalog)
