"""An expert that does parts of a learner's actions."""

from typing import Any

import numpy as np
import torch

from benchmarks.teacher_parts import PartlyTold, obeying, parts_by_name
from chmarl_pb.learning.rollouts.collect import NO_LABEL


class Sayer:
    """An expert that always proposes the same."""

    def reset(self, seed: int | None) -> None:
        """Forget nothing."""

    def propose(self, observations: Any, infos: Any) -> dict[str, Any]:
        """Return an action and a word of one robot, and an action of another."""
        return {"humanoid": (3, 7), "drone": 1}

    def note(self, actions: dict[str, Any]) -> None:
        """Learn nothing."""


def test_only_what_is_told_is_told() -> None:
    part = PartlyTold(Sayer(), [("humanoid", 1)])
    told = {name: row.tolist() for name, row in part.propose({}, {}).items()}
    assert told == {"humanoid": [NO_LABEL, 7], "drone": [NO_LABEL]}
    assert {name: row.tolist() for name, row in part.proposed.items()} == {"humanoid": [3, 7], "drone": [1]}


def test_what_is_told_is_done_and_the_rest_is_the_learners_best() -> None:
    values = torch.tensor([[[0.0, 2.0, 1.0], [3.0, 0.0, 9.0]]])
    mask = torch.tensor([[[True, True, True], [True, True, False]]])
    done = [obeying(values, mask, np.array([row]), np.random.default_rng(0)) for row in ([NO_LABEL, 1], [0, NO_LABEL])]
    assert [one.tolist() for one in done] == [[[1, 1]], [[0, 0]]]


def test_rows_of_the_table() -> None:
    parts = parts_by_name({"humanoid": 2, "drone": 1})
    assert parts == {
        "nothing": (),
        "the humanoid's actions": (("humanoid", 0),),
        "the drone's actions": (("drone", 0),),
        "the humanoid's words": (("humanoid", 1),),
        "all words": (("humanoid", 1),),
        "all": (("humanoid", 0), ("humanoid", 1), ("drone", 0)),
    }
    assert list(parts_by_name({"humanoid": 1})) == ["nothing", "the humanoid's actions", "all"]
