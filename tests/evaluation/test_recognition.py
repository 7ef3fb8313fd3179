"""Recognition: the planner acts on what it sees, a robot that stays does not; results keep the counts."""

from pathlib import Path
from typing import Any

import chmarl_pb
from chmarl_pb.evaluation.recognition import Recognition, total
from chmarl_pb.evaluation.result import episode_of, episode_row, load_result

TASKS = ["val-unseen-000", "val-unseen-001"]


class Stay:
    """Does nothing."""

    def reset(self, seed: int | None) -> None:
        """Forget nothing."""

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        """Return the last action of each robot."""
        return {robot: len(info["action_mask"]) - 1 for robot, info in infos.items()}


def test_counts_are_added_and_shares_are_those_that_there_are() -> None:
    assert total([Recognition(2, 1, 0, 0), Recognition(2, 2, 4, 1)]) == Recognition(4, 3, 4, 1)
    assert total([]) == Recognition() and Recognition().figures() == {}
    assert Recognition(4, 3).figures() == {"pick_share": 0.75}


def test_results_keep_how_often_robots_act_on_what_they_see(tmp_path: Path) -> None:
    report = chmarl_pb.evaluate("belief", "val-unseen", workers=1, tasks=TASKS, out=tmp_path / "belief.json")
    assert report.success_rate == 1 and report.recognition.picks >= 2 and report.recognition.places >= 2
    assert load_result(tmp_path / "belief.json").recognition == report.recognition
    row = episode_row(report.episodes[0])
    assert episode_of({**row, "task": row["task"]}) == report.episodes[0]
    del row["recognition"]  # older results have none
    assert episode_of(row).recognition is None


def test_who_does_nothing_recognises_nothing() -> None:
    shares = chmarl_pb.evaluate(Stay(), "val-unseen", workers=1, tasks=TASKS, seeds=[0]).recognition
    assert shares.picks == shares.places == shares.y_seen == 0
