"""The replay policy: it repeats the actions of an episode that has been played."""

from collections.abc import Iterator, Sequence
from typing import Any

from chmarl_pb.policies.policy import Infos, Observations, PolicyEnv


class ReplayPolicy:
    """Repeats actions, and stays when there are no more."""

    def __init__(self, actions: Sequence[Sequence[int]], env: PolicyEnv, said: Sequence[Sequence[int]] = ()):
        """Repeat actions in an environment.

        Args:
            actions: for each step the numbers of the robots' actions, in the order of the environment's robots.
            env: the environment.
            said: for each step the symbols that they said; empty if nothing could be said.
        """
        self._said = said
        self._actions, self._robots = actions, tuple(env.action_names)
        self._stay = tuple(names.index("stay") for names in env.action_names.values())
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Begin with the first action again."""
        self._left: Iterator[Sequence[int]] = iter(self._actions)
        self._words: Iterator[Sequence[int]] = iter(self._said)

    def act(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return the next actions, with the symbols that were said."""
        row, words = next(self._left, self._stay), next(self._words, None)
        actions = {robot: int(action) for robot, action in zip(self._robots, row, strict=True)}
        if words is None:
            return actions
        return {robot: (action, int(word)) for (robot, action), word in zip(actions.items(), words, strict=True)}
