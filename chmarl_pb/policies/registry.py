"""The policies that come with the benchmark, by name."""

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
from chmarl_pb.policies.variants import Noting, Staying, Told, Unheard
from chmarl_pb.tasks.messages import is_board

#: Policies that do without most of what a robot is given -> what they do with; weak ones first.
SHORTCUTS = {
    "open-loop": "reads the instruction, then plays a fixed tour",
    "reactive": "sees and reads, remembers nothing",
    "blind": "sees nothing, reads nothing",
    "instruction-blind": "sees, ignores the instruction",
}

#: Policies that search with all that robots are given -> how.
SEARCHES = {"search": "looks for X and Y by rule", "belief": "looks where X and Y most likely are"}


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


#: Name -> what makes the policy for an environment.
BUILT_IN: dict[str, Factory] = {
    "random": lambda env: RandomPolicy({robot: len(names) for robot, names in env.action_names.items()}),
    "open-loop": lambda env: OpenLoopPolicy(env.action_names, env.catalog),
    "reactive": lambda env: _without_words(env, ReactivePolicy(env.action_names, env.rooms, env.catalog)),
    "blind": _blind,
    "instruction-blind": _instruction_blind,
    "feedback-only": _feedback_only,
    "partner-blind": lambda env: Staying(_unheard(env, _lone_belief(env)), env.action_names),
    "search-alone": lambda env: _alone(env, _search(env)),
    "search-silent": lambda env: Unheard(_search(env)),
    "search": _search,
    "belief-alone": lambda env: _alone(env, _talking(env, _lone_belief(env))),
    "belief-silent": lambda env: Unheard(_belief(env)),
    "belief": _belief,
    "belief-told": _belief_told,
    "planner": PlannerPolicy,
}

#: Those that play a task the same way for every seed.
DETERMINISTIC = frozenset(
    {"open-loop", "partner-blind", "belief-alone", "belief-silent", "belief", "belief-told", "planner"}
)

#: Those that are given more than their robots' observations: the planner the world, the other what is truly in view.
PRIVILEGED = frozenset({"planner", "search-alone", "belief-alone", "belief-told"})

#: Those that read what is in view from scene graphs, and are given the truth where observations hold none.
SEEING = frozenset(
    {"search", "search-silent", "belief", "belief-silent", "reactive", "instruction-blind", "partner-blind"}
)


def is_told_more(name: str, observation: str) -> bool:
    """Return whether a built-in policy is given more than its robots' observations.

    Args:
        name: of the policy.
        observation: what is observed, with a "+" between several, as results have it.
    """
    return name in PRIVILEGED or (name in SEEING and "scene_graph" not in observation.split("+"))


#: Parts of what a robot is given.
PARTS = ("eyes", "instruction", "messages", "feedback", "partner")

#: Policy -> the parts that its choices depend on, where there are such; the planner knows the world instead.
USES: dict[str, tuple[str, ...]] = {
    "random": (),
    "blind": ("messages", "feedback", "partner"),
    "feedback-only": ("feedback",),
    "open-loop": ("instruction",),
    "instruction-blind": ("eyes", "messages", "feedback", "partner"),
    "partner-blind": ("eyes", "instruction"),
    "reactive": ("eyes", "instruction", "messages", "partner"),
    "search": ("eyes", "instruction", "messages", "partner"),
    "belief": ("eyes", "instruction", "messages", "partner"),
    "planner": (),
}

#: Those that read no messages at all.
_WITHOUT_BOARD = frozenset({"planner", "random", "open-loop", "feedback-only"})

#: Those that have a code for own words; others neither say nor understand any.
TALKING = frozenset({"search", "belief"})


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
            "blind", "instruction-blind", "feedback-only", "partner-blind", "open-loop", "reactive".
        env: the ParallelEnv, or a view of it, that the policy is to drive.

    Raises:
        OptionError: there is no such policy.
    """
    if name not in BUILT_IN:
        raise OptionError(f"unknown policy {name!r}; use one of: {', '.join(BUILT_IN)}")
    core = core_of(env)
    if name != "random":
        _check_actions(name, core)
    if name not in _WITHOUT_BOARD:
        _check_board(name, core)
    return BUILT_IN[name](core)


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
    for robot, space in heard.items():
        if not env.symbols and not is_board(space, env.rooms):
            raise OptionError(
                f"policy {policy!r} reads the message board, an array (2, {len(env.rooms)}) of whole numbers 0 or 1, "
                f"and the {robot} hears {space}; use one of: {', '.join(sorted(_WITHOUT_BOARD))}; or a policy of your "
                "own"
            )
