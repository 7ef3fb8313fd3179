"""What a learner that imitates an expert has not learned: ``python -m benchmarks.teacher_parts WEIGHTS``.

Plays its weights on validation tasks by the rules that they were trained by, while the expert does parts of the
actions: the words of a robot; its actions without the words, which are its moves and, of a humanoid, Pick and Place;
all. What is gained is what the learner lacks in that part. Also prints and keeps how often the learner does what the
expert would in the states that the learner itself comes to; on no test split.
"""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

import chmarl_pb
from benchmarks.scores import Scores, parser_of, run
from chmarl_pb.learning.components import counts_in, of_each
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.rollouts.collect import NO_LABEL, Explorer, greedy
from chmarl_pb.policies.expert import Expert
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.registry import make_expert
from chmarl_pb.robots.pointing import verb_of

Part = tuple[str, int]  # a robot, and the number of a component of its actions
Counts = Counter[tuple[str, str, bool]]


class PartlyTold:
    """An expert of whose proposals the learner is told some parts.

    Attributes:
        proposed: all of the last ones.
    """

    def __init__(self, expert: Expert, told: Sequence[Part]):
        """Take the expert, and the parts that are told."""
        self.reset, self.note, self._expert, self._told = expert.reset, expert.note, expert, told
        self.proposed: dict[str, np.ndarray] = {}

    def propose(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return what each agent is told; the rest reads ``NO_LABEL``."""
        asked = self._expert.propose(observations, infos)
        self.proposed = {name: np.ravel(action) for name, action in asked.items()}
        return {
            name: np.array([part if (name, number) in self._told else NO_LABEL for number, part in enumerate(row)])
            for name, row in self.proposed.items()
        }


def obeying(values: Tensor, action_mask: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return what is told, and the best allowed action where nothing is."""
    return np.where(labels == NO_LABEL, greedy(values, action_mask, labels, rng), labels)


class Helped:
    """The policy of some weights, whose expert does some parts.

    Attributes:
        counts: of the steps of each part and kind of proposal, and whether the same was done.
        taken: for each step of the last episode robot -> number of the action that it did, and of the proposed one.
    """

    def __init__(self, inner: Any, env: Any, expert: Expert, told: Sequence[Part]):
        """Take a policy of weights over.

        Args:
            inner: the policy.
            env: what it plays in.
            expert: what it has imitated.
            told: the parts that the expert does.
        """
        self._batched, self._names = inner.batched, env.unwrapped.action_names
        self._expert = PartlyTold(expert, told)
        self._batched.acting = Explorer(self._batched.agents, obeying, np.random.default_rng(0), [self._expert])
        self.counts: Counts = Counter()
        self.taken = list[dict[str, tuple[int, int]]]()

    def reset(self, seed: int | None) -> None:
        """Begin an episode."""
        self._batched.reset([seed])
        self.taken = []

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the robots' actions."""
        actions: Actions = self._batched.act([0], [observations], [infos])[0]
        proposals = self._expert.proposed
        self.taken.append({name: (int(np.ravel(actions[name])[0]), int(row[0])) for name, row in proposals.items()})
        for name, proposed in proposals.items():
            for number, (own, best) in enumerate(zip(np.ravel(actions[name]), proposed, strict=False)):
                kind = "a word" if number and best else "silence" if number else _kind(self._names[name][best])
                self.counts[name, kind, bool(own == best)] += 1
        return actions


def _kind(action: str) -> str:
    verb = verb_of(action)
    return "goto" if verb.startswith("goto") else verb


class Helper:
    """Makes the policy, and keeps what it has made."""

    privileged = deterministic = True  # its expert may know more than robots see

    def __init__(self, weights: Path, expert: str, told: Sequence[Part]):
        """Remember what to make it from."""
        self.inner, self.expert, self.told = ValuePolicies(weights), expert, told
        self.made = list[Helped]()

    def __call__(self, env: Any) -> Policy:
        """Return the policy for an environment."""
        helped = Helped(self.inner(env), env, make_expert(self.expert, env), self.told)
        self.made.append(helped)
        return helped


def parts_by_name(components: Mapping[str, int]) -> dict[str, tuple[Part, ...]]:
    """Return the parts that the expert does in each row of the table, from the components of each robot's actions."""
    moves = {f"the {name}'s actions": ((name, 0),) for name in components}  # its words are another component
    words = {f"the {name}'s words": ((name, 1),) for name, count in components.items() if count > 1}
    every = tuple((name, number) for name, count in components.items() for number in range(count))
    together = {"all words": tuple(part for part in every if part[1])} if words else {}
    return {"nothing": (), **moves, **words, **together, "all": every}


def agreement(counts: Counts) -> list[dict[str, Any]]:
    """Return how often what the expert proposes is done, for each robot and kind of proposal."""
    kinds = Counter[tuple[str, str]]()
    for (name, kind, _), steps in counts.items():
        kinds[name, kind] += steps
    return [
        {
            "robot": name,
            "the expert's proposal": kind,
            "steps": steps,
            "the same is done": counts[name, kind, True] / steps,
        }
        for (name, kind), steps in sorted(kinds.items(), key=lambda item: (item[0][0], -item[1]))
    ]


def main() -> int:
    """Play and print."""
    parser = parser_of("benchmarks.teacher_parts", __doc__, workers=1)  # it counts what each of its policies has done
    parser.add_argument("--expert", default="belief", help="what it has imitated")
    return run(parser, _play)


def _play(chosen: argparse.Namespace) -> None:
    scores, alone = Scores("done by the expert", chosen), Counts()
    for split in scores.splits:
        rules = {"split": split, "observation": chosen.observation, **scores.rules}
        with closing(chmarl_pb.parallel_env(**rules)) as env:
            components = {name: len(of_each(counts_in(name, env.action_space(name)))) for name in env.possible_agents}
        for name, told in parts_by_name(components).items():
            helper = Helper(chosen.weights, chosen.expert, told)
            scores.play(name, helper, split)
            if not told:
                alone.update(sum((made.counts for made in helper.made), Counts()))
    scores.count("agreement", agreement(alone))


if __name__ == "__main__":
    raise SystemExit(main())
