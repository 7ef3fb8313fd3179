"""The leaderboard: its page is that of the files, and only whole results by a track's rules are taken."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import chmarl_pb
import tools.leaderboard
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.gain import gain_of
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.played_again import what_differs
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.recognition import Recognition
from chmarl_pb.evaluation.result import Report, load_result
from chmarl_pb.tasks.task import Optimum
from tools.leaderboard import BEGIN, END, PAGE, SENT, Entry, entries, main, sent, tables, trained

GOOD = SENT / "belief.json"
ENTRY = Entry("paper", "mine", "visual", "", 0.5, 0.2, -10.0)


def labelled(report: Report, label: str) -> dict[str, Any]:
    """Return what a result says of its run, with another label."""
    return {**report.run, "label": label}


def of_mine(report: Report, label: str, policy: str = "mine:Policy", **changes: Any) -> Report:
    """Return a result as if it were of somebody's own policy under a label."""
    settings = {**report.settings, "policy": policy, "policy_sha256": "0" * 64, **changes}
    return replace(report, settings=settings, run={**labelled(report, label), "deterministic": True})


def test_the_page_is_made_of_the_files() -> None:
    written = PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0]
    assert written == f"\n\n{tables(entries())}\n\n", "run python -m tools.leaderboard"


def test_trainings_of_a_row_are_averaged_and_the_best_comes_first() -> None:
    other = replace(ENTRY, name="other", plw=0.25)
    lines = tables([ENTRY, replace(ENTRY, plw=0.4, gain=10.0), other]).splitlines()
    assert lines[-2:] == [
        "| 1 | mine | visual |  | 2 | 50.0 | 30.0 | +0.0 |",
        "| 2 | other | visual |  | 1 | 50.0 | 25.0 | -10.0 |",
    ]
    assert "## The grounded track, generated-test" in tables([replace(ENTRY, track="grounded", gain=None)])


def test_trained_rows_say_what_they_are_given() -> None:
    given = {(entry.track, entry.name, entry.observation): entry.given for entry in trained()}
    assert given["paper", "PPO, humanoid only, goal observed", "scene_graph"] == "goal"
    assert given["paper", "PPO, humanoid only", "visual"] == "the drone is told what is in view"
    assert given["paper", "QMIX", "scene_graph"] == "no messages"
    assert given["grounded", "Imitation of belief", "scene_graph"] == "", "its track has no feedback"


def test_check_takes_a_good_result(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--check", str(GOOD)]) == 0
    assert "belief, paper track, PLW 60.6%, success 96.0%" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("split", "reason"),
    [
        ("val-unseen", "it is of val-unseen; play test-unseen"),
        ("test-unseen", "it is not of all tasks of test-unseen"),
    ],
)
def test_other_tasks_are_refused(split: str, reason: str, tmp_path: Path) -> None:
    tasks = chmarl_pb.load_tasks(split)[:1]
    chmarl_pb.evaluate("random", split, tasks=tasks, seeds=[0], workers=1).save(tmp_path / "mine.json")
    with pytest.raises(ResultError, match=reason):
        sent(tmp_path / "mine.json")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"pointing": True}, r"its rules are not the track's \(pointing\)"),
        ({"max_steps": 90}, "it has 90 steps; leave out --max-steps"),
        ({"feedback": "planner"}, r"its rules are not the track's \(planner feedback\)"),
        ({"catalog": "my.toml"}, r"its rules are not the track's \(catalog my.toml\)"),
        ({"execution": "simulated"}, r"its rules are not the track's \(execution simulated\)"),
        ({"image_size": 1024}, "its pictures have 1024 pixels; leave out --image-size"),
    ],
)
def test_other_rules_are_refused(
    changes: dict[str, object], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = load_result(GOOD)
    settings = {**report.settings, "options": {**report.settings["options"], **changes}}
    replace(report, settings=settings).save(tmp_path / "mine.json")
    with pytest.raises(ResultError, match=reason):
        sent(tmp_path / "mine.json")
    assert main(["--check", str(tmp_path / "mine.json")]) == 1 and "mine.json: it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"observation": "visual+segmentation"}, "it observes visual.segmentation; the tracks' observations are"),
        ({"homes_sha256": {}}, "its homes are of another version"),
    ],
)
def test_what_is_seen_and_where_is_that_of_the_track(changes: dict[str, object], reason: str, tmp_path: Path) -> None:
    report = load_result(GOOD)
    replace(report, settings={**report.settings, **changes}).save(tmp_path / "mine.json")
    with pytest.raises(ResultError, match=reason):
        sent(tmp_path / "mine.json")


def test_what_a_built_in_policy_is_told_is_not_the_files_word(tmp_path: Path) -> None:
    report = load_result(SENT / "search.json")
    settings = {**report.settings, "observation": "visual"}  # as older results, which do not say it
    replace(report, settings=settings).save(tmp_path / "mine.json")
    entry = sent(tmp_path / "mine.json")
    assert entry.given == "is told the truth" and entry.gain is None
    assert sent(SENT / "search.json").given == "" and sent(SENT / "search.json").gain is not None


def test_the_page_takes_no_forged_result_and_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path)
    report = load_result(SENT / "search.json")
    forged = [replace(one, success=True, steps=one.task.optimal_steps) for one in report.episodes]
    replace(report, episodes=tuple(forged)).save(tmp_path / "mine.json")
    with pytest.raises(ResultError, match=r"it says .* but its .* actions come to"):
        entries()
    report.save(tmp_path / "mine.json")
    replace(report, settings={**report.settings, "source_sha256": "0" * 64}).save(tmp_path / "copy.json")
    with pytest.raises(ResultError, match="a copy is no second training"):
        entries()
    own = replace(report, settings={**report.settings, "policy": "mine:Policy"}, run=labelled(report, "mine"))
    for first in (own, report):
        first.save(tmp_path / "mine.json")
        replace(own, settings={**own.settings, "observation": "visual"}).save(tmp_path / "copy.json")
        with pytest.raises(ResultError, match="a copy is no second training"):
            entries()


def test_episodes_may_be_alike_with_and_without_what_a_policy_does_not_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path)
    report = load_result(GOOD)
    report.save(tmp_path / "with.json")
    options = {**report.settings["options"], "feedback": False}
    replace(report, settings={**report.settings, "options": options}).save(tmp_path / "without.json")
    assert [entry.given for entry in entries() if entry.name == "belief"] == ["", "no feedback"]


def test_what_is_not_of_a_track_is_told_before_it_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path)
    report = load_result(GOOD)
    options = {**report.settings["options"], "robots": ["gone.toml", "drone"]}
    replace(report, settings={**report.settings, "options": options}).save(tmp_path / "mine.json")
    with pytest.raises(ResultError, match=r"mine.json: its rules are not the track's \(robots gone.toml, drone\)"):
        entries()


@pytest.mark.parametrize(
    ("policy", "seeds", "deterministic", "is_refused"),
    [
        ("belief", [0], False, False),
        ("mine:Policy", [0], True, False),
        ("mine:Policy", [0], False, True),
        ("mine:Policy", [0, 1], False, True),
        ("mine:Policy", [3, 5, 8], False, True),
        ("mine:Policy", [0, 1, 2], False, False),
    ],
)
def test_seeds_are_not_chosen(
    policy: str, seeds: list[int], deterministic: bool, is_refused: bool, tmp_path: Path
) -> None:
    report = load_result(GOOD)
    episodes = tuple(replace(episode, seed=seed) for seed in seeds for episode in report.episodes)
    settings = {**report.settings, "policy": policy, "seeds": seeds}
    run = {**labelled(report, policy), "deterministic": deterministic}
    replace(report, settings=settings, run=run, episodes=episodes).save(tmp_path / "mine.json")
    if is_refused:
        with pytest.raises(ResultError, match=r"it has the seeds .*; leave out --seeds"):
            sent(tmp_path / "mine.json")
    else:
        assert sent(tmp_path / "mine.json").plw == pytest.approx(report.plw)


@pytest.mark.parametrize(
    ("label", "words"),
    [
        ("Imitation of belief, generated homes", "name of a row that was trained here"),
        ("QMIX + Messages", "name of a row that was trained here"),
        ("belief", "name of a policy of this package, and the result is of mine:Policy"),
        ("Belief", "name of a policy of this package"),
        ("planner", "name of a policy of this package"),
        ("search@detector", "name of a policy of this package"),
        ("ours-graphs", "name of a policy of this package"),
        ("QMIX + messages ", "begins or ends with a space"),
        ("QMIX +  messages", "several in a row"),
        ("QMIX +\u00a0messages", r"has '\\xa0'"),
        ("A | b\n# c <b>", r"has '\\n', '<', '>', '\|', which tables do not show"),
        ("A\u200b", r"has '\\u200b'"),
    ],
)
def test_labels_that_are_ours_or_break_the_page_are_refused(label: str, words: str, tmp_path: Path) -> None:
    of_mine(load_result(GOOD), label, feedback=False).save(tmp_path / "mine.json")
    with pytest.raises(ResultError, match=f"mine.json: .*{words}.*; give another by --label"):
        sent(tmp_path / "mine.json")


def test_a_published_policy_may_be_sent_under_its_own_name(tmp_path: Path) -> None:
    of_mine(load_result(GOOD), "ours-graphs", "ours-graphs").save(tmp_path / "mine.json")
    assert sent(tmp_path / "mine.json").name == "ours-graphs"


@pytest.mark.parametrize(
    ("policy", "file", "changes", "is_taken"),
    [
        ("mine:Policy", "mine-paper-seed1", {}, False),
        ("runs/seed1/best.pt", "mine-paper-seed1", {}, True),
        ("other:Policy", "mine-paper-seed1", {}, True),
        ("mine:Policy", "another-paper-seed0", {}, True),
        ("mine:OfPictures", "mine-pictures-seed0", {"observation": "visual"}, False),
        ("other:Policy", "another-pictures-seed0", {"observation": "visual"}, True),
    ],
)
def test_a_label_is_of_one_policy(
    policy: str, file: str, changes: dict[str, Any], is_taken: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path / "sent")
    (tmp_path / "sent").mkdir()
    monkeypatch.setattr(tools.leaderboard, "what_differs", lambda report: "")  # of labels alone
    first, other = (load_result(SENT / f"{name}.json") for name in ("belief", "blind"))
    of_mine(first, "My method").save(tmp_path / "sent" / "mine-paper-seed0.json")
    path = tmp_path / f"{file}.json"
    of_mine(other, "my method", policy, **changes).save(path)
    assert main(["--check", str(path)]) == is_taken
    shutil.copy(path, tmp_path / "sent")
    if is_taken:
        with pytest.raises(ResultError, match=r"its label '.y method' is that of .*; give another by --label, or let"):
            entries()
    else:
        assert len(entries()) == len(trained()) + 2


@pytest.mark.parametrize(
    ("policy", "run", "words"),
    [
        ("mine:Policy", {}, "it does not say whether its seats share what they observe: evaluate with --check-seats"),
        ("mine:Policy", {"seats_apart": 4}, "it says that its seats share nothing in 4 episodes"),
        ("belief", {}, "its actions come to this"),
    ],
)
def test_the_check_tells_what_a_result_says_of_its_seats(
    policy: str,
    run: dict[str, int],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path / "sent")
    monkeypatch.setattr(tools.leaderboard, "what_differs", lambda report: "")
    one = of_mine(load_result(GOOD), policy, policy)
    replace(one, run=one.run | run).save(tmp_path / "mine.json")
    assert main(["--check", str(tmp_path / "mine.json")]) == 0 and capsys.readouterr().out.endswith(f"{words}\n")


def test_trainings_have_checkpoints_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path / "sent")
    monkeypatch.setattr(tools.leaderboard, "what_differs", lambda report: "")
    paths = [tmp_path / f"mine-paper-seed{seed}.json" for seed in range(2)]
    for seed, (path, name) in enumerate(zip(paths, ("belief", "blind"), strict=True)):
        of_mine(load_result(SENT / f"{name}.json"), "My method", f"runs/seed{seed}/best.pt").save(path)
    assert main(["--check", *map(str, paths)]) == 0


def test_the_check_plays_all_actions_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--check", str(GOOD)]) == 0
    assert "its actions come to this" in capsys.readouterr().out
    report = load_result(GOOD)
    failed = next(number for number, episode in enumerate(report.episodes) if not episode.success)
    forged = [
        replace(report.episodes[failed], success=True, steps=3),
        replace(report.episodes[failed], success=True, potential=10.0),
        replace(report.episodes[failed], actions=report.episodes[failed].actions[:-1]),
    ]
    for one in forged:
        episodes = (*report.episodes[:failed], one, *report.episodes[failed + 1 :])
        replace(report, episodes=episodes).save(tmp_path / "forged.json")
        assert main(["--check", str(tmp_path / "forged.json")]) == 1
        assert f"task {one.task.id}, seed 0: it says" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            lambda one: {"instruction": "put the mug on the desk"},
            "it says that the instruction is 'put the mug on the ",
        ),
        (lambda one: {"recognition": Recognition(10, 10, 10, 10)}, r"it counts Recognition\(x_seen=10, "),
        (lambda one: {"actions": one.actions + ((0, 0),) * 5}, "actions, but the episode does not end with the last"),
        (lambda one: {"actions": ((99, 0), *one.actions[1:])}, "humanoid: action 99 is not a whole number from 0 to 9"),
        (lambda one: {"actions": ((0,), *one.actions[1:])}, "without one action for each of the 2 robots"),
    ],
)
def test_all_that_follows_from_actions_is_compared(
    changed: Callable[[Played], dict[str, Any]], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = load_result(GOOD)
    first, *others = report.episodes
    replace(report, episodes=(replace(first, **changed(first)), *others)).save(tmp_path / "forged.json")
    assert main(["--check", str(tmp_path / "forged.json")]) == 1
    assert re.search(f"task {first.task.id}, seed 0: .*{words}", capsys.readouterr().err)


@pytest.mark.parametrize("options", [{"track": "grounded"}, {"messages": "symbols"}])
def test_what_was_played_by_any_rules_comes_to_the_same_again(options: dict[str, Any]) -> None:
    report = evaluate("belief", "val-unseen", tasks=["val-unseen-000"], workers=1, **options)
    assert what_differs(report) == ""


def test_an_episode_that_goes_on_is_none_that_has_ended() -> None:
    report = load_result(GOOD)
    failed = next(one for one in report.episodes if not one.success and not one.potential)
    cut = replace(failed, actions=failed.actions[:1], steps=1, recognition=None)
    assert "it has 1 actions, but the episode does not end with the last" in what_differs(
        replace(report, episodes=(cut,))
    )


def test_a_result_of_which_nothing_is_summed_up_is_not_taken(tmp_path: Path) -> None:
    facts = json.loads(GOOD.read_text(encoding="utf-8"))
    del facts["sha256"]
    (tmp_path / "mine.json").write_text(json.dumps(facts), encoding="utf-8")
    assert load_result(tmp_path / "mine.json").plw == load_result(GOOD).plw, "results that are kept are still read"
    with pytest.raises(ResultError, match=r"mine\.json: it has no sha256 of what it holds; evaluate again"):
        sent(tmp_path / "mine.json")


def test_an_invented_number_of_fewest_steps_is_refused(tmp_path: Path) -> None:
    report = load_result(GOOD)
    forged = [replace(one, optimum=Optimum(28, True)) if one.success else one for one in report.episodes]
    replace(report, episodes=tuple(forged)).save(tmp_path / "forged.json")
    with pytest.raises(ResultError, match=r"another L\* than they have themselves"):
        load_result(tmp_path / "forged.json")


@pytest.mark.parametrize("steps", [1, 28, None])
def test_the_fewest_steps_are_planned_again_where_tasks_do_not_tell_them(steps: int | None) -> None:
    given: dict[str, Any] = {"tasks": ["val-unseen-000"], "robots": ("humanoid", "humanoid"), "workers": 1}
    report = evaluate("planner", "val-unseen", **given)
    assert what_differs(report) == ""
    forged = replace(report.episodes[0], optimum=None if steps is None else Optimum(steps, True))
    assert "it says that L* is" in what_differs(replace(report, episodes=(forged,)))


def test_a_copy_is_no_second_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tools.leaderboard, "SENT", tmp_path)
    for name in ("a.json", "b.json"):
        shutil.copy(GOOD, tmp_path / name)
    with pytest.raises(ResultError, match=r"b\.json: the same episodes as .*a\.json"):
        tools.leaderboard.entries()


def test_what_was_changed_by_hand_is_refused(tmp_path: Path) -> None:
    text = GOOD.read_text(encoding="utf-8")
    (tmp_path / "mine.json").write_text(text.replace('"observation": "scene_graph"', '"observation": "visual"'))
    with pytest.raises(ResultError, match="checksum"):
        sent(tmp_path / "mine.json")


@pytest.mark.parametrize(
    ("changes", "gains"),
    [({}, True), ({"feedback": False}, True), ({"messages": False}, True), ({"feedback": "planner"}, False)],
)
def test_a_gain_is_that_over_policies_that_were_given_no_less(changes: dict[str, object], gains: bool) -> None:
    report = load_result(GOOD)
    settings = {**report.settings, "options": {**report.settings["options"], **changes}}
    assert (gain_of(replace(report, settings=settings)) is not None) == gains
