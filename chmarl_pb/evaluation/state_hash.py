"""The state hash: one short text that says whether two episodes are in the same state after a step."""

import hashlib
import json
from collections.abc import Iterable

from chmarl_pb.envs.parallel import HouseholdEnv

_STEPS = 10_000  # numbers are rounded to 0.1 mm (positions, heights) and 0.0001 (quaternions, potential)


def state_hash(env: HouseholdEnv) -> str:
    """Return the sha256 of an environment's present state as 64 hexadecimal digits.

    It covers all robots' lattice poses, what is held, what carries each object, the objects' poses in
    the world, the potential, and what each robot sees. Numbers are rounded, so that the last bits, in
    which machines may differ, do not count.

    Args:
        env: the environment, after ``reset`` or ``step``.
    """
    world, outcome = env.world, env.outcome
    state = {
        "robots": {name: int(robot.pose) for name, robot in world.robots.items()},
        "held": outcome.held,
        "supports": {name: [on.receptacle, *_rounded([on.height])] for name, on in outcome.supports.items()},
        "objects": {name: [_rounded(part) for part in world.pose(name)] for name in world.objects},
        "potential": _rounded([outcome.potential]),
        "seen": {name: list(seen) for name, seen in outcome.seen.items()},
    }
    text = json.dumps(state, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _rounded(numbers: Iterable[float]) -> list[int]:
    return [round(float(number) * _STEPS) for number in numbers]
