"""The policies that come with the benchmark, by name."""

from dataclasses import dataclass
from typing import Any

from chmarl_pb.errors import OptionError
from chmarl_pb.policies.belief.policy import BeliefPolicy
from chmarl_pb.policies.blind import BlindPolicy
from chmarl_pb.policies.code import RoomCode, Talking
from chmarl_pb.policies.cooperative_planner import PlannerPolicy
from chmarl_pb.policies.expert import Expert, Informed, as_expert
from chmarl_pb.policies.feedback_only import FeedbackOnlyPolicy
from chmarl_pb.policies.instruction_blind import InstructionBlindPolicy
from chmarl_pb.policies.open_loop import OpenLoopPolicy
from chmarl_pb.policies.policy import Factory, Policy, PolicyEnv, RandomPolicy, core_of, symbols_of
from chmarl_pb.policies.reactive import ReactivePolicy
from chmarl_pb.policies.search import SearchPolicy
from chmarl_pb.policies.variants import ColourBlind, Noting, Staying, Told, Unheard
from chmarl_pb.tasks.messages import is_board

#: Parts of what a robot is given.
PARTS = ("eyes", "instruction", "messages", "feedback", "partner")


@dataclass(frozen=True)
class BuiltIn:
    """A policy that comes with the benchmark.

    Attributes:
        make: makes it for an environment.
        uses: the ``PARTS`` that its choices depend on, where there are such; the planner knows the world instead.
        deterministic: whether it plays a task the same way for every seed.
        privileged: whether it is given more than its robots' observations: the planner the world, others what is truly
            in view, or the rooms of X and Y.
        reads_graphs: whether it reads what is in view from scene graphs, and is given the truth where observations
            hold none.
        reads_board: whether it is made for the message board, and refuses channels that are neither it nor own words.
        talks: whether it has a code for own words; others neither say nor understand any.
        shortcut: of one that does without most of what a robot is given, what it does with the rest.
        search: of one that searches with all that robots are given, how.
    """

    make: Factory
    uses: tuple[str, ...]
    deterministic: bool = False
    privileged: bool = False
    reads_graphs: bool = False
    reads_board: bool = True
    talks: bool = False
    shortcut: str = ""
    search: str = ""


def _talking(env: PolicyEnv, policy: Policy) -> Policy:
    """Return a policy made for a board, which says what would stand there where robots have words of their own."""
    symbols = symbols_of(env)
    if not symbols:
        return policy
    tells = policy.bearings if isinstance(policy, BeliefPolicy) else {}
    codes = {name: RoomCode(env.rooms, symbols, env.catalog, *tells.get(name, ())) for name in env.action_names}
    return Talking(policy, codes)


def _search(env: PolicyEnv) -> Policy:
    return _talking(env, SearchPolicy(env.action_names, env.rooms, env.catalog))


def _without_words(env: PolicyEnv, policy: Policy) -> Policy:
    """Return a policy that reads a board, which has nothing on it where robots have words of their own."""
    return _unheard(env, policy) if symbols_of(env) else policy


def _belief(env: PolicyEnv) -> Policy:
    return _talking(env, BeliefPolicy(env.action_names, env.rooms, env.catalog))


def _alone(env: PolicyEnv, policy: Policy) -> Policy:
    """Return a policy for the robots that grasp alone, which hear what they have seen themselves."""
    return Noting(Staying(policy, env.action_names), env.action_names, env.rooms, env.catalog)


def _lone_belief(env: PolicyEnv) -> Policy:
    return BeliefPolicy(env.action_names, env.rooms, env.catalog, alone=True)


def _unheard(env: PolicyEnv, policy: Policy) -> Policy:
    return Unheard(policy, (2, len(env.rooms)))


def _blind(env: PolicyEnv) -> Policy:
    return _without_words(env, BlindPolicy(env.action_names, env.rooms, bool(env.options.feedback)))


def _instruction_blind(env: PolicyEnv) -> Policy:
    given = bool(env.options.feedback), bool(env.options.messages) and not symbols_of(env)
    return _without_words(env, InstructionBlindPolicy(env.action_names, env.rooms, env.catalog, *given))


def _feedback_only(env: PolicyEnv) -> Policy:
    in_full = env.options.feedback == "planner"
    policy = FeedbackOnlyPolicy(env.action_names, env.rooms, in_full, env.catalog)
    return Staying(_unheard(env, policy), env.action_names)


def _belief_told(env: PolicyEnv) -> Policy:
    return _talking(env, Told(BeliefPolicy(env.action_names, env.rooms, env.catalog), env))


_ALL_BUT_FEEDBACK = ("eyes", "instruction", "messages", "partner")

#: Name -> the policy; weak ones first.
BUILT_IN: dict[str, BuiltIn] = {
    "random": BuiltIn(
        lambda env: RandomPolicy({robot: len(names) for robot, names in env.action_names.items()}),
        uses=(), reads_board=False,
    ),
    "open-loop": BuiltIn(
        lambda env: OpenLoopPolicy(env.action_names, env.catalog), uses=("instruction",), deterministic=True,
        reads_board=False, shortcut="reads the instruction, then plays a fixed tour",
    ),
    "reactive": BuiltIn(
        lambda env: _without_words(env, ReactivePolicy(env.action_names, env.rooms, env.catalog)),
        uses=_ALL_BUT_FEEDBACK, reads_graphs=True, shortcut="sees and reads, remembers nothing",
    ),
    "blind": BuiltIn(_blind, uses=("messages", "feedback", "partner"), shortcut="sees nothing, reads nothing"),
    "instruction-blind": BuiltIn(
        _instruction_blind, uses=("eyes", "messages", "feedback", "partner"), reads_graphs=True,
        shortcut="sees, ignores the instruction",
    ),
    "feedback-only": BuiltIn(_feedback_only, uses=("feedback",), reads_board=False),
    "partner-blind": BuiltIn(
        lambda env: Staying(_unheard(env, _lone_belief(env)), env.action_names), uses=("eyes", "instruction"),
        deterministic=True, reads_graphs=True,
    ),
    "colour-blind": BuiltIn(
        lambda env: ColourBlind(_belief(env), env.catalog), uses=_ALL_BUT_FEEDBACK, deterministic=True,
        reads_graphs=True, talks=True,
    ),
    "search-alone": BuiltIn(
        lambda env: _alone(env, _search(env)), uses=("eyes", "instruction", "messages"), privileged=True, talks=True,
    ),
    "search-silent": BuiltIn(
        lambda env: Unheard(_search(env)), uses=("eyes", "instruction"), reads_graphs=True, talks=True,
    ),
    "search": BuiltIn(
        _search, uses=_ALL_BUT_FEEDBACK, reads_graphs=True, talks=True, search="looks for X and Y by rule",
    ),
    "belief-alone": BuiltIn(
        lambda env: _alone(env, _talking(env, _lone_belief(env))), uses=("eyes", "instruction", "messages"),
        deterministic=True, privileged=True, talks=True,
    ),
    "belief-silent": BuiltIn(
        lambda env: Unheard(_belief(env)), uses=("eyes", "instruction"), deterministic=True, reads_graphs=True,
        talks=True,
    ),
    "belief": BuiltIn(
        _belief, uses=_ALL_BUT_FEEDBACK, deterministic=True, reads_graphs=True, talks=True,
        search="looks where X and Y most likely are",
    ),
    "belief-told": BuiltIn(_belief_told, uses=_ALL_BUT_FEEDBACK, deterministic=True, privileged=True, talks=True),
    "planner": BuiltIn(PlannerPolicy, uses=(), deterministic=True, privileged=True, reads_board=False),
}  # fmt: skip

#: Policies that do without most of what a robot is given -> what they do with the rest.
SHORTCUTS = {name: policy.shortcut for name, policy in BUILT_IN.items() if policy.shortcut}

#: Policies that search with all that robots are given -> how.
SEARCHES = {name: policy.search for name, policy in BUILT_IN.items() if policy.search}


def is_told_more(name: str, observation: str) -> bool:
    """Return whether a built-in policy is given more than its robots' observations.

    Args:
        name: of the policy.
        observation: what is observed, with a "+" between several, as results have it.
    """
    policy = BUILT_IN[name]
    return policy.privileged or (policy.reads_graphs and "scene_graph" not in observation.split("+"))


def make_expert(name: str, env: Any) -> Expert:
    """Return a policy that comes with the benchmark, as what a learner imitates.

    With pictures it is privileged: it is told the true classes in view, and where Pick and Place point the graphs.

    Raises:
        OptionError: there is no such policy.
    """
    core, expert = core_of(env), as_expert(make_policy(name, env))
    return Informed(expert, core) if core.options.pointing and not core.options.shows_graphs else expert


def make_policy(name: str, env: Any) -> Policy:
    """Return a policy that comes with the benchmark.

    Args:
        name: "planner" (privileged, optimal), "search" (with pictures it reads the true ``info["visible"]``),
            "search-alone" (the drone stays), "search-silent" (without messages), "belief", "belief-alone",
            "belief-silent" (the same, and expect of a home what homes of training are like), "belief-told" (privileged:
            told the rooms of X and Y at the start), "random", or one that does without most of what a robot is given:
            "blind", "instruction-blind", "feedback-only", "partner-blind", "colour-blind", "open-loop", "reactive".
        env: the ParallelEnv, or a view of it, that the policy is to drive.

    Raises:
        OptionError: there is no such policy.
    """
    if name not in BUILT_IN:
        raise OptionError(f"unknown policy {name!r}; use one of: {', '.join(BUILT_IN)}")
    core = core_of(env)
    if name != "random":
        _check_actions(name, core)
    if BUILT_IN[name].reads_board:
        _check_board(name, core)
    return BUILT_IN[name].make(core)


def _check_actions(policy: str, env: Any) -> None:
    needed = [*(f"goto_{room}" for room in env.rooms), "stay"]
    for robot, names in env.action_names.items():
        if missing := [action for action in needed if action not in names]:
            raise OptionError(
                f"policy {policy!r} needs actions that the robot {robot!r} has not: {', '.join(missing)}; "
                "take 'random', or a policy of your own"
            )


def _check_board(policy: str, env: Any) -> None:
    heard = {robot: env.observation_space(robot)["messages"] for robot in env.action_names}
    others = sorted(name for name, one in BUILT_IN.items() if not one.reads_board)
    for robot, space in heard.items():
        if not env.symbols and not is_board(space, env.rooms):
            raise OptionError(
                f"policy {policy!r} reads the message board, an array (2, {len(env.rooms)}) of whole numbers 0 or 1, "
                f"and the {robot} hears {space}; use one of: {', '.join(others)}; or a policy of your "
                "own"
            )
