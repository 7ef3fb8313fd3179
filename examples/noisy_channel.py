"""A channel of one's own: messages whose bits are misread now and then.

python examples/noisy_channel.py
"""

from dataclasses import dataclass

import numpy as np

import chmarl_pb
from chmarl_pb.tasks.messages import Board, Messages


@dataclass(frozen=True)
class NoisyChannel(Board):
    """The paper's board, of which every robot misreads some bits, at random and each time anew."""

    flip: float = 0.1  # probability that a bit is misread

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return the board with some bits flipped."""
        return messages ^ (rng.random(messages.shape) < self.flip).astype(np.int8)


def main(tasks: int = 50) -> None:
    """Print what the search policy loses by it."""
    for messages in (True, NoisyChannel(0.1), NoisyChannel(0.3), False):
        report = chmarl_pb.evaluate(
            "search", "val-unseen", seeds=[0], workers=1, messages=messages,
            tasks=chmarl_pb.load_tasks("val-unseen")[:tasks],
        )  # fmt: skip
        print(f"{report.settings['options']['messages']!s:40} success {report.success_rate:.0%}, PLW {report.plw:.0%}")


if __name__ == "__main__":
    main()
