"""The benchmark of endings tells how failed episodes end."""

from pathlib import Path

import pytest

pytest.importorskip("torch")

from benchmarks.endings import LAST, ending, endings, wish
from benchmarks.teacher_parts import Helper
from chmarl_pb.envs.parallel import HouseholdEnv

_TO_AND_FRO = ["goto_kitchen", "turn_left"] * 6


@pytest.mark.parametrize(
    ("done", "how"),
    [
        (["pick", *["turn_left"] * LAST], "turns on the spot"),
        (["turn_left", "turn_right"] * 6, "turns on the spot"),
        (["pick", *_TO_AND_FRO], "repeats itself"),
        (["goto_kitchen"] * LAST, "repeats itself"),
        (["move_forward", "turn_left", "turn_left", "pick"] * 3, "repeats itself"),
        ([*_TO_AND_FRO[1:], "pick"], "other"),
    ],
)
def test_an_ending_has_a_name(done: list[str], how: str) -> None:
    assert ending(done) == how


def test_what_the_expert_would_is_what_differs() -> None:
    done = ["turn_left"] * LAST
    assert wish(done, done) == "the same"
    assert wish(["turn_right", *done[1:]], done) == "to turn"
    assert wish(["goto_kitchen", *done[1:]], done) == "Goto"
    assert wish(["move_forward", "goto_kitchen", *done[2:]], done) == "a pace forward"
    assert wish([*done[:-3], "pick", "goto_kitchen", "move_forward"], done) == "Pick or Place"
    assert wish(["pick", *done], ["goto_kitchen", *done]) == "the same"  # before the last steps


def test_every_episode_is_counted() -> None:
    env = HouseholdEnv(split="val-unseen", messages=True, feedback=True)
    helper = Helper(Path("results/weights/ours-graphs-parsed.pt"), "belief", ())
    helped = helper(env)
    found = endings(env, helped, "val-unseen", 25, "")
    assert found.total() == 2
    (made,) = helper.made
    assert made.taken and set(made.taken[0]) == {"humanoid", "drone"}
    env.close()
