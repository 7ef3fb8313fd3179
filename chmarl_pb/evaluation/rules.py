"""By which options of the environment a policy plays: those of its training, where none are given."""

from collections.abc import Mapping
from typing import Any

from chmarl_pb.envs.tracks import OF_TRACK, PAPER, TRACKS


def rules_with(trained: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of the environment that a policy plays in: given ones, else those that it was trained with.

    In another track than that of the training nothing of what tracks decide is left of it: it would be a mixture of
    two.

    Args:
        trained: option -> value, where that is not the paper's.
        given: option -> value; ``OF_TRACK`` is none.
    """
    told = {name: value for name, value in given.items() if value is not OF_TRACK}
    track = trained.get("track", PAPER)
    own = TRACKS[track] if told.get("track", track) != track else ()
    return {**{name: value for name, value in trained.items() if name not in own}, **told}
