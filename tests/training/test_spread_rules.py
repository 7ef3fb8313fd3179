"""Hand-written rules of simple_spread."""

import numpy as np

from training.spread_rules import nearest, own, shared_out


def test_landmarks_are_shared_out_so_that_all_ways_together_are_shortest() -> None:
    """Three agents on a line that all have the landmark of the middle one nearest."""
    agents, landmarks = np.array([[0.0, 0], [1, 0], [2, 0]]), np.array([[1.0, 0.1], [-2, 0], [4, 0]])
    chosen = []
    for number, place in enumerate(agents):
        others = np.delete(agents, number, axis=0) - place
        assert nearest(landmarks - place, others, number) == 0
        assert own(landmarks - place, others, number) == number
        chosen.append(shared_out(landmarks - place, others, number))
    assert chosen == [1, 0, 2]
