"""A share of a vector on another machine: all that it answers travels, and is what a batch in this process does."""

import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import CloudpickleWrapper

from chmarl_pb.envs.vector.batch import Batch
from chmarl_pb.envs.vector.memory import Memory
from chmarl_pb.envs.vector.share import Share, written
from chmarl_pb.envs.vector.worker import Failure
from chmarl_pb.errors import ActionError
from tests.helpers.toy_env import FAIL, ToyEnv
from tests.helpers.toy_vectors import COUNT, actions, same

NUMBERS = range(1, 4)  # of the five environments of the vector


def sent(share: Share, command: str, *arguments: Any, acted: np.ndarray) -> tuple[Any, list[np.ndarray]]:
    """Return an answer as it arrives elsewhere."""
    answer: tuple[Any, list[np.ndarray]] = pickle.loads(pickle.dumps(share.do(command, arguments, acted)))
    return answer


@pytest.mark.parametrize("autoreset", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP], ids=lambda mode: mode.value)
def test_answers_are_those_of_a_batch_here(autoreset: AutoresetMode) -> None:
    share, batch = Share(CloudpickleWrapper(ToyEnv), NUMBERS, COUNT, autoreset), Batch(ToyEnv, NUMBERS, autoreset)
    memory, rng = Memory(batch.signature, COUNT), np.random.default_rng(0)
    batch.share(memory)
    rows = slice(NUMBERS.start, NUMBERS.stop)
    begin = list(range(COUNT)), [None] * COUNT, None
    for step in range(30):
        acted = actions(rng, len(NUMBERS))
        memory.actions[rows] = acted
        changes, arrays = (
            sent(share, "step", acted=acted) if step else sent(share, "reset", *begin, acted=np.zeros_like(acted))
        )
        parts = list(batch.step() if step else batch.reset(*begin))
        assert same(changes, [change for part in parts for change in part.changes])
        assert same(arrays, [array[rows] for array in written(memory)])


def test_errors_of_environments_arrive() -> None:
    share = Share(CloudpickleWrapper(ToyEnv), NUMBERS, COUNT, AutoresetMode.SAME_STEP)
    acted = np.zeros((len(NUMBERS), 2), np.int64)
    sent(share, "reset", [0] * COUNT, [None] * COUNT, None, acted=acted)
    acted[1, 0] = FAIL
    failure, arrays = sent(share, "step", acted=acted)
    assert isinstance(failure, Failure) and isinstance(failure.error, ActionError) and not arrays


def test_calls_are_answered_by_each() -> None:
    share = Share(CloudpickleWrapper(ToyEnv), NUMBERS, COUNT, AutoresetMode.SAME_STEP)
    answer, arrays = sent(share, "call", list(NUMBERS), "mood", (), {}, acted=np.zeros((len(NUMBERS), 2), np.int64))
    assert answer == ["calm"] * len(NUMBERS)
    assert not arrays
