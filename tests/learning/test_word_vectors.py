"""Static word vectors: names held out of training lie near their class, and encoders take them over."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from gymnasium import spaces

from chmarl_pb.catalog import BENCHMARK, ROOM_KINDS
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning.networks import DictEncoder, build_encoder
from chmarl_pb.learning.networks.detections import LABELS, DetectionEncoder
from chmarl_pb.learning.networks.tables import EMBEDDING, VectorTable, class_table, word_table
from chmarl_pb.tasks import language
from chmarl_pb.tasks.language.vectors import COLOURS, FILE, class_vectors, token_vectors, vector_of, word_vectors
from tools.word_vectors import all_texts, nearest_classes


@pytest.fixture(scope="module")
def space() -> Iterator[spaces.Dict]:
    """One robot's observations with scene graphs and the goal."""
    env = HouseholdEnv(goal=True)
    yield env.observation_space("humanoid")
    env.close()


def sampled(space: spaces.Dict) -> dict[str, torch.Tensor]:
    space.seed(0)
    return {key: torch.from_numpy(np.asarray(value)[None]) for key, value in space.sample().items()}


def like(one: str, other: str) -> float:
    a, b = vector_of(one), vector_of(other)
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def test_every_word_of_the_language_has_a_vector() -> None:
    assert sorted(word_vectors()) == all_texts()
    assert {*language.all_words(), *ROOM_KINDS, *COLOURS} <= word_vectors().keys()
    assert all(np.linalg.norm(vector) == pytest.approx(1, abs=1e-3) for vector in word_vectors().values())
    assert FILE.stat().st_size < 200_000


def test_like_words_are_near() -> None:
    assert like("couch", "sofa") > like("couch", "mug")
    assert like("smartphone", "mobile phone") > 0.5 > like("smartphone", "desk")
    assert not vector_of("xylophone").any()


def test_most_held_out_names_are_nearest_to_their_class() -> None:
    found = nearest_classes()
    assert len(found) == 61 and sum(near == row for row, names in found.items() for near in names.values()) >= 55


def test_tables_have_a_row_for_each_id() -> None:
    assert len(token_vectors()) == language.vocabulary_size() and len(class_vectors()) == len(BENCHMARK.rows) + 1
    assert not token_vectors()[[language.PADDING, language.UNKNOWN]].any() and not class_vectors()[0].any()
    mug = token_vectors()[language.tokenize("mug", 1)[0]]
    assert np.array_equal(mug, vector_of("mug"))


def test_a_table_is_one_linear_map_of_the_vectors() -> None:
    table = VectorTable(class_vectors(), len(class_vectors()))
    ids = torch.tensor([[3, 0], [1, 2]])
    torch.testing.assert_close(table(ids), table.weight[ids])
    assert not table(torch.tensor(0)).any()
    table(ids).sum().backward()
    assert [name for name, _ in table.named_parameters()] == ["linear.weight"]
    assert table.linear.weight.grad is not None and "vectors" in table.state_dict()


def test_own_things_and_words_are_learned_as_usual() -> None:
    for make, vectors in ((word_table, token_vectors()), (class_table, class_vectors())):
        table = make(len(vectors) + 2, True)
        assert isinstance(table, VectorTable) and table.weight.shape == (len(vectors) + 2, EMBEDDING)
        assert table.own is not None and torch.equal(table.weight[-2:], table.own)
        with pytest.raises(ValueError, match="leave it out"):
            make(len(vectors) - 1, True)


@pytest.mark.parametrize("pool", ["mean", "gated"])
def test_encoders_take_them(space: spaces.Dict, pool: str) -> None:
    plain, known = (build_encoder(space, 16, graph_pool=pool, word_vectors=on) for on in (False, True))
    assert known(sampled(space)).shape == (1, 16)
    assert isinstance(known, DictEncoder) and isinstance(plain, DictEncoder)
    tables = [module for module in known.modules() if isinstance(module, VectorTable)]
    assert len(tables) == 3  # words, classes of nodes, classes of the goal
    assert not any(isinstance(module, VectorTable) for module in plain.modules())
    other = build_encoder(space, 16, graph_pool=pool, word_vectors=True)
    other.load_state_dict(known.state_dict())
    assert torch.equal(other(sampled(space)), known(sampled(space)))


def test_detections_take_them() -> None:
    encode = DetectionEncoder(word_vectors=True)
    assert encode(torch.rand(2, len(LABELS), 4), torch.rand(2, EMBEDDING)).shape == (2, encode.size)
    assert isinstance(encode.classes, VectorTable) and encode.classes.weight.shape == (len(LABELS), EMBEDDING)


def test_an_unseen_synonym_is_encoded_like_its_name(space: spaces.Dict) -> None:
    """Whatever the map that has been learned, "smartphone" is nearer to "cell phone" than "mug" is."""
    torch.manual_seed(0)
    encode = build_encoder(space, 16, word_vectors=True)
    assert isinstance(encode, DictEncoder)
    words = dict(zip(encode.keys, encode.parts, strict=True))["instruction"]
    one, near, far = (
        words(torch.from_numpy(language.tokenize(f"Put the {name} on the desk.", 24).astype(np.int64))[None])
        for name in ("cell phone", "smartphone", "mug")
    )
    assert torch.linalg.norm(one - near) < torch.linalg.norm(one - far)
