"""The table of colours: what is counted, what evidence a cell has of it, and how much that counts."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from chmarl_pb import catalog
from chmarl_pb.learning.networks.colour_table import SHARES, ColourTable, codes_of, counted_colours
from chmarl_pb.learning.networks.detections import LABELS, OBJECTS
from chmarl_pb.learning.networks.detector import Detector, read
from chmarl_pb.learning.networks.labelled_views import Views
from chmarl_pb.learning.networks.pyramid import CELL
from tests.helpers.frozen_weights import pictures

NOTHING = len(LABELS)
MUG, APPLE, SOFA = (LABELS.index(name) for name in ("mug", "apple", "sofa"))
WALL, BLUE, BROWN = (200, 200, 200), (10, 20, 250), (120, 80, 40)
RED_NAME = catalog.COLOUR_IDS["red"]


def views_of(*things: tuple[tuple[int, int, int], int, int], size: int = 16, count: int = 4) -> Views:
    """Return views whose rows from the top show things of a colour, each (colour, label, id of its colour's name)."""
    images = np.full((count, size, size, 3), WALL, np.uint8)
    labels, colours = np.full((count, size, size), NOTHING, np.uint8), np.zeros((count, size, size), np.uint8)
    for row, (colour, label, name) in enumerate(things):
        images[:, row], labels[:, row], colours[:, row] = colour, label, name
    present = np.stack([np.isin(np.arange(NOTHING), part) for part in labels])
    cells, centres = np.zeros((count, NOTHING, 4, 4), bool), np.zeros((count, NOTHING, 2), np.float16)  # not read
    return Views(images, labels, cells, present, centres, colours)


def test_a_share_is_how_much_of_a_colour_a_class_has() -> None:
    views = views_of((BLUE, MUG, RED_NAME), (BROWN, APPLE, 0), (BROWN, SOFA, 0), (WALL, APPLE, 0))
    codes, shares = counted_colours(views, np.arange(4))
    of = dict(zip(codes.tolist(), shares, strict=True))
    blue, brown, wall = codes_of(torch.tensor([[BLUE, BROWN, WALL]], dtype=torch.uint8))[0].tolist()
    assert of[blue][MUG] > 250 and of[blue][OBJECTS + RED_NAME - 1] > 250
    assert 120 < of[brown][APPLE] < 130  # the other half is a sofa's, which is no object
    assert not of[brown][OBJECTS:].any()  # nobody knows its name
    assert of[wall][APPLE] == round(255 * 64 / (13 * 64 + 1))  # most of it is wall


def test_what_hardly_shows_an_object_is_no_colour_of_it() -> None:
    views = views_of((WALL, APPLE, 0), size=128)
    codes, shares = counted_colours(views, np.arange(4))
    assert len(codes) == 0 and shares.shape == (0, SHARES)


@given(st.integers(0, 2**32 - 1), st.integers(5, 13), st.integers(5, 13))
def test_evidence_is_the_mean_share_of_the_pixels_that_can_show_a_thing(seed: int, height: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (6, 3), np.uint8)
    codes = np.unique(codes_of(torch.from_numpy(palette[None]))[0].numpy()[:4])
    shares = rng.integers(0, 256, (len(codes), SHARES)) * (rng.random((len(codes), SHARES)) < 0.5)
    table = ColourTable(torch.from_numpy(codes.astype(np.int32)), torch.from_numpy(shares.astype(np.uint8)))
    shown = rng.integers(0, 6, (height, width))
    levels = table.levels(torch.from_numpy(palette[shown][None]))[0].numpy()
    known = codes_of(torch.from_numpy(palette[shown][None]))[0].numpy()
    for row in range(levels.shape[0]):
        for column in range(levels.shape[1]):
            cell = known[row * CELL : (row + 1) * CELL, column * CELL : (column + 1) * CELL].ravel()
            rows = shares[[codes.tolist().index(code) for code in cell.tolist() if code in codes]]
            sums, pixels = rows.sum(axis=0), (rows > 0).sum(axis=0)
            np.testing.assert_array_equal(levels[row, column], sums // np.maximum(pixels, 4))


def test_a_picture_has_the_same_evidence_whatever_it_is_seen_with() -> None:
    table = ColourTable(*counted_colours(views_of((BLUE, MUG, RED_NAME)), np.arange(4)), torch.rand(2, 256))
    images = torch.from_numpy(views_of((BLUE, MUG, 0), (BROWN, APPLE, 0), size=18).images)
    assert torch.equal(torch.cat([table(image[None]) for image in images]), table(images))
    assert table(images).shape == (4, len(LABELS) + len(catalog.COLOURS), 5, 5)
    assert not table(images)[:, OBJECTS : len(LABELS)].any()  # of receptacles it tells nothing


@pytest.mark.parametrize("known", [0, 9])
def test_what_is_added_is_what_the_evidence_of_each_cell_is_worth(known: int) -> None:
    images = torch.from_numpy(np.random.default_rng(0).integers(0, 256, (3, 22, 17, 3), np.uint8))
    codes = codes_of(images).unique()[:known].int()
    shares = torch.arange(known * SHARES).view(known, SHARES).remainder(256).to(torch.uint8)
    table = ColourTable(codes, shares, torch.rand(2, 256))
    levels = table.levels(images)
    assert levels.any() == bool(known) and torch.equal(table(images), table.worth(levels).permute(0, 3, 1, 2))


def test_a_detector_that_has_learned_nothing_knows_objects_by_their_colours() -> None:
    parts = [views_of((BLUE, MUG, RED_NAME), size=32, count=60), views_of((BROWN, APPLE, 0), size=32, count=60)]
    views = Views(*(np.concatenate(both) for both in zip(*(vars(part).values() for part in parts), strict=True)))
    with torch.random.fork_rng():
        torch.manual_seed(0)
        detector = Detector().eval()
        detector.finish(views)
    confidence = torch.sigmoid(detector(torch.from_numpy(views.images[[0, 60]]))[:, [MUG, APPLE]].amax(dim=(2, 3)))
    assert confidence[0, 0] > 0.9 > 0.1 > confidence[0, 1] and confidence[1, 1] > 0.9 > 0.1 > confidence[1, 0]


def test_weights_hold_the_table_and_those_without_have_none() -> None:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        detector = Detector().eval()
    without = detector.weights(pictures(4, 64).numpy())
    detector.colours = ColourTable(*counted_colours(views_of((BLUE, MUG, 0)), np.arange(4)), torch.rand(2, 256))
    kept = detector.weights(pictures(4, 64).numpy())
    for name, part in detector.colours.state_dict().items():
        assert torch.equal(read(kept).colours.state_dict()[name], part)
    before = {name: part for name, part in without.items() if not name.startswith("colours.")}
    images = pictures(2, 64)
    assert torch.equal(read(before)(images), read(without)(images))


def test_tables_of_many_colours_know_all() -> None:
    codes = torch.arange(40_000, dtype=torch.int32)
    shares = torch.zeros(len(codes), SHARES, dtype=torch.uint8)
    shares[35_000, 0] = 255
    table = ColourTable(codes, shares)
    last = torch.tensor([2 * (35_000 >> 14), 2 * (35_000 >> 7 & 127), 2 * (35_000 & 127)], dtype=torch.uint8)
    image = last.expand(1, 4, 4, 3)
    assert codes_of(image).unique().tolist() == [35_000]
    assert table.levels(image)[0, 0, 0, 0] == 255
