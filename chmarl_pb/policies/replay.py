"""The replay policy: it repeats the actions of an episode that has been played."""

from collections.abc import Iterator, Sequence

from chmarl_pb.policies.policy import Actions, Infos, Observations, PolicyEnv


class ReplayPolicy:
    """Repeats actions, and stays when there are no more."""

    def __init__(self, actions: Sequence[Sequence[int]], env: PolicyEnv):
        """Repeat actions in an environment.

        Args:
            actions: for each step the numbers of the robots' actions, in the order of the environment's robots.
            env: the environment.
        """
        self._actions, self._robots = actions, tuple(env.action_names)
        self._stay = tuple(names.index("stay") for names in env.action_names.values())
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Begin with the first action again."""
        self._left: Iterator[Sequence[int]] = iter(self._actions)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the next actions."""
        row = next(self._left, self._stay)
        return {robot: int(action) for robot, action in zip(self._robots, row, strict=True)}
