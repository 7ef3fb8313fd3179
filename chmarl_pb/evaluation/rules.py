"""By which options of the environment a policy plays: those of its training, where none are given."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import OF_TRACK, PAPER, TRACKS
from chmarl_pb.errors import OptionError

_KNOWN = {option.name for option in fields(Options)}


def rules_with(trained: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of the environment that a policy plays in: given ones, else those that it was trained with.

    In another track than that of the training nothing of what tracks decide is left of it: it would be a mixture of
    two.

    Args:
        trained: option -> value, where that is not the paper's.
        given: option -> value; ``OF_TRACK`` is none.

    Raises:
        OptionError: the policy was trained with an option, or in a track, that this version does not know.
    """
    if unknown := sorted(set(trained) - _KNOWN):
        raise OptionError(f"the policy was trained with {unknown[0]!r}, an option that this version does not know")
    told = {name: value for name, value in given.items() if value is not OF_TRACK}
    if (track := trained.get("track", PAPER)) not in TRACKS:
        raise OptionError(f"the policy was trained in the track {track!r}; known are {', '.join(TRACKS)}")
    own = TRACKS[track] if told.get("track", track) != track else ()
    return {**{name: value for name, value in trained.items() if name not in own}, **told}
