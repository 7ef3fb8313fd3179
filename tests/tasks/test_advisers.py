"""What each adviser says after an action: that a chance was missed, that a detour was taken, or nothing."""

from collections.abc import Callable, Iterator

import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.tasks.task import Task
from tests.helpers.feedback_reader import read

Advised = Callable[[bool | str], HouseholdEnv]


@pytest.fixture
def advised(tasks: list[Task]) -> Iterator[Advised]:
    """Makes an environment with a kind of feedback, at the beginning of a task."""
    made = []

    def advised(feedback: bool | str) -> HouseholdEnv:
        env = HouseholdEnv(feedback=feedback, messages=False)
        made.append(env)
        env.reset(options={"task": tasks[0]})
        return env

    yield advised
    for env in made:
        env.close()


def act(env: HouseholdEnv, action: str) -> str:
    """Let the humanoid act while the drone stays, and return what the humanoid is told."""
    names = env.action_names
    infos = env.step({"humanoid": names["humanoid"].index(action), "drone": names["drone"].index("stay")})[-1]
    assert infos["drone"]["feedback"] == "", "the drone is told something"
    return str(infos["humanoid"]["feedback"])


def plan(env: HouseholdEnv) -> list[str]:
    return list(env.simulation.oracle.plan(env.setting.goal))


def recommended(sentence: str) -> str:
    assert sentence, "nothing is said"
    return read(sentence)[0]


def before(env: HouseholdEnv, action: str) -> list[str]:
    """Follow the plan until an action is next, and return what is said on the way."""
    said = []
    while (step := plan(env)[0]) != action:
        said.append(act(env, step))
    return said


@pytest.mark.parametrize("action", ["pick", "place"])
def test_the_paper_s_adviser_names_the_pick_or_place_that_was_missed(advised: Advised, action: str) -> None:
    env = advised("paper")
    before(env, action)
    assert recommended(act(env, "stay")) == action


@pytest.mark.parametrize("action", ["pick", "place"])
def test_the_paper_s_adviser_says_nothing_when_the_chance_is_taken(advised: Advised, action: str) -> None:
    env = advised("paper")
    before(env, action)
    assert act(env, action) == ""


def test_the_paper_s_adviser_says_nothing_where_there_is_no_chance(advised: Advised) -> None:
    env = advised("paper")
    item = env.setting.goal.item
    assert item not in env.outcome.seen["humanoid"], "the task begins with X in view; take another for this test"
    assert act(env, "stay") == ""


def test_the_planner_s_adviser_says_nothing_while_the_plan_is_followed(advised: Advised) -> None:
    env = advised("planner")
    assert not any(before(env, "place")), "it complains about the optimal plan"
    assert act(env, "place") == "" and env.outcome.success


def test_the_planner_s_adviser_names_the_first_action_of_the_plan_after_an_idle_step(advised: Advised) -> None:
    env = advised("planner")
    first = plan(env)[0]
    assert recommended(act(env, "stay")) == first
    assert recommended(act(env, "stay")) == first, "it has forgotten its plan after one complaint"


def test_the_planner_s_adviser_names_the_first_action_of_the_plan_after_a_failure(advised: Advised) -> None:
    env = advised("planner")
    first = plan(env)[0]
    assert first != "place"
    assert recommended(act(env, "place")) == first  # nothing is in the hand


def test_the_planner_s_adviser_plans_anew_after_a_detour(advised: Advised) -> None:
    env = advised("planner")
    before(env, "pick")
    assert recommended(act(env, "turn_left")) == "pick"
    assert act(env, plan(env)[0]) == "", "it complains about the way back"


def test_no_adviser_says_nothing(advised: Advised) -> None:
    env = advised(False)
    before(env, "pick")
    assert act(env, "stay") == ""
