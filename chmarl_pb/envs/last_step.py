"""What was done and told in the last step."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LastStep:
    """What is shown of the last step and cannot be read from the environment.

    Attributes:
        actions: robot -> name of its action; empty at the start.
        succeeded: robot -> whether its action did.
        feedback: robot -> what it was told, if it was.
        reward: shared reward.
    """

    actions: dict[str, str]
    succeeded: dict[str, bool]
    feedback: dict[str, str]
    reward: float
