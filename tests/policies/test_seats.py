"""Evaluated policies get observations and action masks, each robot its own, unless they declare that they need more."""

from typing import Any, ClassVar

import pytest

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.play import Player, Setup, policy_seed
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.policies.policy import Actions, Infos, Observations, RandomPolicy
from chmarl_pb.policies.registry import BUILT_IN, make_policy
from chmarl_pb.policies.seats import interface_of, seated
from chmarl_pb.tasks.splits import load_tasks

TASK = load_tasks("val-unseen")[0]


class Watching:
    """Stays, and keeps what it was given."""

    made: ClassVar[list["Watching"]] = []

    def __init__(self, env: Any):
        self.env, self.given = env, list[tuple[Observations, Infos]]()
        self.stays = {robot: names.index("stay") for robot, names in env.action_names.items()}
        self.made.append(self)

    def reset(self, seed: int | None) -> None:
        self.seed = seed

    def act(self, observations: Observations, infos: Infos) -> Actions:
        self.given.append((observations, infos))
        return self.stays


class Central(Watching):
    centralized = True
    made: ClassVar[list[Watching]] = []


class Privileged(Watching):
    privileged = True
    made: ClassVar[list[Watching]] = []


def play(kind: type[Watching]) -> list[Watching]:
    kind.made = []
    report = chmarl_pb.evaluate(kind, "val-unseen", tasks=[TASK], seeds=[0], workers=1, max_steps=3)
    assert {name for name in ("privileged", "centralized") if report.settings.get(name)} == {
        name for name in ("privileged", "centralized") if getattr(kind, name, False)
    }
    return kind.made


def test_each_robot_has_a_policy_that_gets_its_own_observation_and_mask() -> None:
    made = play(Watching)
    assert len(made) == 2 and len({policy.seed for policy in made}) == 1
    for robot, policy in zip(("humanoid", "drone"), made, strict=True):
        assert len(policy.given) == 3
        for observations, infos in policy.given:
            assert observations.keys() == infos.keys() == {robot}
            assert infos[robot].keys() == {"action_mask"}
        assert policy.env.observation_space(robot).contains(policy.given[0][0][robot])
        assert policy.env.options.max_steps == 3


@pytest.mark.parametrize("name", ["simulation", "setting", "world", "task", "outcome", "state", "_tasks"])
def test_there_is_no_way_from_the_interface_to_the_world(env: HouseholdEnv, name: str) -> None:
    known = interface_of(env)
    assert not hasattr(known, name) and known.unwrapped is known


def test_a_centralized_policy_gets_the_observations_of_all() -> None:
    (policy,) = play(Central)
    observations, infos = policy.given[0]
    assert observations.keys() == {"humanoid", "drone"} and infos["drone"].keys() == {"action_mask"}


def test_a_privileged_policy_gets_everything() -> None:
    (policy,) = play(Privileged)
    assert isinstance(policy.env, HouseholdEnv) and "visible" in policy.given[0][1]["humanoid"]


class Peeking(Watching):
    def act(self, observations: Observations, infos: Infos) -> Actions:
        return self.stays if observations["humanoid"] is observations["drone"] else {}


class Reading(Watching):
    def act(self, observations: Observations, infos: Infos) -> Actions:
        return self.stays if [info["visible"] for info in infos.values()] else {}


@pytest.mark.parametrize(("kind", "hint"), [(Peeking, "centralized = True"), (Reading, "privileged = True")])
def test_who_asks_for_more_is_told_how_to_declare_it(kind: type[Watching], hint: str) -> None:
    with pytest.raises(OptionError, match=hint):
        play(kind)


@pytest.mark.parametrize("name", sorted(name for name, policy in BUILT_IN.items() if not policy.privileged))
def test_built_in_policies_play_the_same_from_their_seats(env: HouseholdEnv, name: str) -> None:
    """With scene graphs they need nothing but their own robot's observations."""
    free, bound = make_policy(name, env), seated(BUILT_IN[name].make, env)
    episodes = [chmarl_pb.rollout(env, policy, seed=3, task=TASK, policy_seed=4) for policy in (free, bound)]
    assert episodes[0].actions == episodes[1].actions


def test_seeing_policies_are_given_the_truth_only_without_graphs() -> None:
    graphs, pictures = (Setup("search", Options(observation)) for observation in ("scene_graph", ("visual", "text")))
    assert not graphs.privileged and pictures.privileged
    assert Setup("planner", graphs.options).privileged and not Setup("blind", pictures.options).privileged


def test_a_policys_seed_tells_no_more_than_the_instruction() -> None:
    assert policy_seed("Bring the mug to the desk.", 0) == 2099580812, "published results were played by this one"
    seeds = {policy_seed(text, seed) for text in ("Bring the mug.", "Bring the cup.") for seed in range(50)}
    assert len(seeds) == 100


def test_random_robots_draw_apart(env: HouseholdEnv) -> None:
    player = Player(Setup("random", env.options))
    actions = player.play((TASK, 0)).actions
    player.close()
    assert len(actions) > 20 and len({(humanoid % 9, drone) for humanoid, drone in actions}) > 15
    again = RandomPolicy({"humanoid": 10, "drone": 9})
    again.reset(policy_seed(env.instruction_of(TASK), 0))
    assert tuple(again.act({"humanoid": {}, "drone": {}}, {}).values()) == actions[0]


class Silent:
    """A policy that answers what it is told to."""

    def __init__(self, answer: Any):
        self.answer = answer

    def reset(self, seed: int | None) -> None: ...

    def act(self, observations: Any, infos: Any) -> Any:
        return self.answer


@pytest.mark.parametrize("answer", [None, {}, [1, 2], 3, {"robot": 0}])
def test_an_answer_that_is_no_action_of_the_robot(answer: Any) -> None:
    with pytest.raises(OptionError, match=r"the policy of 'humanoid' answered .*act\(\) is to return a dict"):
        evaluate(Silent(answer), "val-unseen", workers=1, seeds=[0], tasks=["val-unseen-000"])


@pytest.mark.parametrize("policy", [None, 5, lambda env: None, lambda env: object(), lambda env: Silent])
def test_what_is_no_policy(policy: Any) -> None:
    with pytest.raises(OptionError, match=r"no policy: it has no method reset nor act|is a class, not a policy"):
        evaluate(policy, "val-unseen", workers=1, seeds=[0], tasks=["val-unseen-000"])
    env = chmarl_pb.parallel_env(split="val-unseen")
    with pytest.raises(OptionError, match="polic"):
        chmarl_pb.rollout(env, policy)
    env.close()


@pytest.mark.parametrize("policy", ["collections:OrderedDict", "os:getcwd", lambda: Silent({})])
def test_what_takes_no_environment(policy: Any) -> None:
    with pytest.raises(OptionError, match="cannot be called with an environment"):
        evaluate(policy, "val-unseen", workers=1, seeds=[0], tasks=["val-unseen-000"])


def test_what_takes_no_options_of_an_environment() -> None:
    with pytest.raises(OptionError, match=r"os:getcwd|posix:getcwd.* the options of parallel_env"):
        evaluate("search", "val-unseen", workers=1, seeds=[0], tasks=["val-unseen-000"], env_fn="os:getcwd")


def test_an_error_within_a_policy_is_its_own() -> None:
    def broken(env: Any) -> Any:
        return len(env)

    with pytest.raises(TypeError, match="has no len"):
        evaluate(broken, "val-unseen", workers=1, seeds=[0], tasks=["val-unseen-000"])
