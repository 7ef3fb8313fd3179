"""Names of a user's own things are none that sentences hold anyway, so that every sentence can be read back."""

import dataclasses
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.cli import main
from chmarl_pb.envs.options import Options
from chmarl_pb.errors import AssetError
from chmarl_pb.homes.catalog_file import load_catalog
from chmarl_pb.tasks.language import instruction, parse_instruction, words
from chmarl_pb.tasks.language.own_names import load_things
from chmarl_pb.tasks.language.templates import FEEDBACK, INSTRUCTIONS, MENDED
from chmarl_pb.tasks.splits import load_tasks
from tests.helpers.own_things import CATALOG, write_things

CRATE = '[[graspable]]\nclass = "crate"\nurdf = "crate.urdf"\n'
BENCH = '[[receptacle]]\nclass = "workbench"\nmodels = ["workbench_oak.urdf"]\n'

WORDS = (
    "on", "house", "to the", "thing", "stand", "it", "view", "left", "somewhere there", "bedroom 2", "2", "put the mug",
    "mug on", "mug on the desk", "sofa so",
)  # fmt: skip
NO_WORDS = (
    "wooden crate", "doll house", "toy drone", "home key", "top hat", "bottle of sand", "desk lamp", "some clay",
)  # fmt: skip


def named(folder: Path, names: list[str], row: str = CRATE, key: str = "names") -> Path:
    return write_things(folder, f"{row}{key} = {names}\n".replace("'", '"'))


@pytest.mark.parametrize("row", [CRATE, BENCH], ids=["graspable", "receptacle"])
@pytest.mark.parametrize("key", ["names", "held_out"])
@pytest.mark.parametrize("name", ["a crate", "an old tin", "the bench", "the", "some", "some the sand", "some some"])
def test_articles_are_refused(name: str, key: str, row: str, tmp_path: Path) -> None:
    path = named(tmp_path, ["fine name", name], row, key)
    with pytest.raises(AssetError, match="begins with an article, which sentences add; ") as raised:
        load_catalog(path)
    assert str(raised.value).startswith(f"{path}: {row[: row.index(']]')]}]] 1 (") and "\n" not in str(raised.value)


def test_so_is_a_class_that_begins_with_one(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"the name 'the crate' begins with an article, .*; write 'crate'"):
        load_catalog(write_things(tmp_path, CRATE.replace('"crate"', '"the_crate"')))


@pytest.mark.parametrize("row", [CRATE, BENCH], ids=["graspable", "receptacle"])
@pytest.mark.parametrize("name", WORDS)
def test_words_of_sentences_are_refused(name: str, row: str, tmp_path: Path) -> None:
    path, kind = named(tmp_path, ["fine name", name], row), row[: row.index("\n")]
    with pytest.raises(AssetError) as raised:
        load_things(path)
    said = str(raised.value)
    assert said.startswith(f"{path}: {kind} (") and f"{name!r} would name it in sentences" in said and "\n" not in said
    assert "~" not in said and said.endswith("; choose another name")


def test_so_is_a_class_that_is_such_a_word(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"\('toy_house'\): 'house' would name it in sentences that ask"):
        load_things(write_things(tmp_path, CRATE.replace('"crate"', '"toy_house"') + 'names = ["house"]\n'))
    with pytest.raises(AssetError, match=r"\('house'\): 'house' would name it"):
        load_things(write_things(tmp_path, CRATE.replace('"crate"', '"house"')))


@pytest.mark.parametrize("kind", [INSTRUCTIONS, *FEEDBACK], ids=["instructions", "pick", "place", "detour"])
def test_every_word_of_every_sentence_is_one(kind: object, tmp_path: Path) -> None:
    """Of both revisions; a few are enough to tell that a template is read."""
    pool = [text for one in (kind.train, kind.held_out) for text in one]  # type: ignore[attr-defined]
    for text in (*pool, *(MENDED[text] for text in pool if text in MENDED)):
        fixed = [word for part in text.split("{") for word in words(part.partition("}")[2] or part * ("}" not in part))]
        longest = max(fixed, key=len)
        with pytest.raises(AssetError, match=repr(longest)):
            load_things(named(tmp_path, [longest]))


@pytest.mark.parametrize("name", NO_WORDS)
def test_others_are_names(name: str, tmp_path: Path) -> None:
    known = load_things(named(tmp_path, [name]))
    for task in load_tasks("val-unseen"):
        own = dataclasses.replace(task, graspable="crate")
        assert parse_instruction(instruction(own, known), known) == ("crate", task.target)
        assert parse_instruction(instruction(task, known), known) == (task.graspable, task.target)


def test_scenery_may_have_any_name(tmp_path: Path) -> None:
    """No sentence names it."""
    assert load_things(write_things(tmp_path, f'{CRATE}[[scenery]]\nclass = "house"\n'))


@pytest.mark.parametrize("name", ["orange", "red mug"])
def test_colours_are_words_of_sentences_among_lookalikes(name: str, tmp_path: Path) -> None:
    path = named(tmp_path, [name])
    assert load_things(path) and Options(catalog=path).things
    refused = f"{name!r} would name it in sentences"
    with pytest.raises(AssetError, match=refused):
        load_things(path, lookalikes=True)
    with pytest.raises(AssetError, match=refused):
        assert Options(catalog=path, track="grounded").things


def test_its_own_names_in_a_name_are_no_others(tmp_path: Path) -> None:
    path = named(tmp_path, ["yellow crate"])
    assert load_things(path, lookalikes=True) is load_things(path)


def test_no_environment_is_made_with_such_a_name(tmp_path: Path) -> None:
    """With goal=True, some episodes could not begin."""
    path = write_things(tmp_path, CATALOG.replace('"wooden crate"', '"on"'))
    with pytest.raises(AssetError, match=r"\('striped_crate'\): 'on' would name it"):
        chmarl_pb.parallel_env(catalog=path, goal=True)


def test_commands_refuse_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = named(tmp_path, ["house"])
    for words_ in (("things", "check", str(path)), ("things", "list", "--catalog", str(path))):
        assert main(words_) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"chmarl-pb: {path}: [[graspable]] ('crate'): 'house' would name it")


def test_nothing_is_imported_under_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_things(tmp_path, CATALOG).unlink()
    before = sorted(tmp_path.iterdir())
    add = ("things", "add", str(tmp_path / "crate.urdf"), "--catalog", str(tmp_path / "own.toml"), "--class")
    for wish in (("house",), ("chest", "--names", "view"), ("chest", "--names", "a chest")):
        assert main((*add, *wish)) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"chmarl-pb: {tmp_path / 'own.toml'}: the row to add (--class") and ".tmp" not in line
    assert sorted(tmp_path.iterdir()) == before
