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
from chmarl_pb.learning.networks.graphs import GraphEncoder
from chmarl_pb.learning.networks.parts import Asked, TokenEncoder
from chmarl_pb.learning.networks.tables import EMBEDDING, VectorTable, class_table, shared_map, word_table
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
    meaning = shared_map()
    table = VectorTable(class_vectors(), len(class_vectors()), meaning)
    ids = torch.tensor([[3, 0], [1, 2]])
    torch.testing.assert_close(table(ids), table.weight[ids])
    assert not table(torch.tensor(0)).any()
    table(ids).sum().backward()
    assert not [*table.named_parameters()]  # the map belongs to the encoder, whose tables share it
    assert meaning.weight.grad is not None and "vectors" in table.state_dict()


def test_own_things_and_words_are_learned_as_usual() -> None:
    for make, vectors in ((word_table, token_vectors()), (class_table, class_vectors())):
        table = make(len(vectors) + 2, shared_map())
        assert isinstance(table, VectorTable) and table.weight.shape == (len(vectors) + 2, EMBEDDING)
        assert table.own is not None and torch.equal(table.weight[-2:], table.own)
        with pytest.raises(ValueError, match="leave it out"):
            make(len(vectors) - 1, shared_map())


@pytest.mark.parametrize("pool", ["mean", "gated", "grounded"])
def test_encoders_take_them(space: spaces.Dict, pool: str) -> None:
    plain, known = (build_encoder(space, 16, graph_pool=pool, word_vectors=on) for on in (False, True))
    assert known(sampled(space)).shape == (1, 16)
    assert isinstance(known, DictEncoder) and isinstance(plain, DictEncoder)
    tables = [module for module in known.modules() if isinstance(module, VectorTable)]
    assert len(tables) == 3  # words, classes of nodes, classes of the goal
    assert not any(isinstance(module, VectorTable) for module in plain.modules())
    assert known.meaning is not None and plain.meaning is None
    assert sum(part.numel() for part in known.meaning.parameters()) == 64 * EMBEDDING
    other = build_encoder(space, 16, graph_pool=pool, word_vectors=True)
    other.load_state_dict(known.state_dict())
    assert torch.equal(other(sampled(space)), known(sampled(space)))


def test_detections_take_them() -> None:
    encode = DetectionEncoder(shared_map())
    assert encode(torch.rand(2, len(LABELS), 6), Asked(torch.rand(2, EMBEDDING))).shape == (2, encode.size)
    assert isinstance(encode.classes, VectorTable) and encode.classes.weight.shape == (len(LABELS), EMBEDDING)


def test_a_word_and_its_class_have_like_rows_in_the_tables_of_an_encoder(space: spaces.Dict) -> None:
    """Words and classes share one map, so "smartphone" is nearest to the class that it names, before any training."""
    encode = build_encoder(space, 16, word_vectors=True)
    assert isinstance(encode, DictEncoder)
    tokens, nodes = (encode.parts[encode.keys.index(key)] for key in ("instruction", "node_class"))
    assert isinstance(tokens, TokenEncoder) and isinstance(nodes, GraphEncoder)
    words, classes = (
        torch.nn.functional.normalize(table.weight.detach(), dim=1) for table in (tokens.words, nodes.classes)
    )
    for word, name in (("smartphone", "mobile_phone"), ("couch", "sofa"), ("mug", "mug")):
        row = words[language.tokenize(word, 1)[0]]
        nearest = max(LABELS, key=lambda label: float(classes[BENCHMARK.class_ids[label]] @ row))
        assert nearest == name


def test_words_for_colours_have_vectors_too() -> None:
    env = HouseholdEnv(track="grounded")
    space = env.observation_space("humanoid")
    env.close()
    encode = build_encoder(space, 16, graph_pool="grounded", word_vectors=True)
    assert all(module.own is None for module in encode.modules() if isinstance(module, VectorTable))


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
