"""What fixes the numbers of an evaluation: kept in its result, and the same in every evaluation that has them."""

import warnings
from collections.abc import Collection
from typing import Any
from uuid import uuid4

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.rollout import core_of_parallel
from chmarl_pb.evaluation.plan import Plan
from chmarl_pb.evaluation.play import Setup
from chmarl_pb.evaluation.provenance import (
    home_hashes,
    is_told,
    packaged_things_hash,
    robots_hash,
    source_hash,
    tasks_hash,
)
from chmarl_pb.fingerprint import fingerprint, name_of
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.robots.model import RobotModel

_UNKNOWN = "unknown-"  # begins what stands in settings for the sha256 of what nothing tells apart


def settings_of(plan: Plan) -> dict[str, Any]:
    """Return what fixes the numbers, as a result file holds it."""
    source, setup, tasks = plan.source, plan.setup, plan.tasks
    options, changes = (setup.options, {}) if setup.env_fn is None else _changed(setup)
    values = options.recorded()
    given = {"privileged": setup.privileged, "centralized": source.centralized}
    is_built_in = isinstance(setup.policy, str) and setup.policy in BUILT_IN
    changes = {**changes, **{name: True for name, is_so in given.items() if is_so}}  # older results have neither
    if own := options.own():
        changes = {**changes, "own_sha256": {name: _or_unknown(fingerprint(one)) for name, one in own.items()}}
    return {
        "policy": source.name,
        "policy_sha256": None if is_built_in else _or_unknown(source.sha256),  # whose code source_sha256 tells
        "split": values.pop("split"),
        "observation": values.pop("observation"),
        "options": values,
        "seeds": plan.seeds,
        "tasks": len(tasks),
        "tasks_sha256": tasks_hash(tasks),
        "homes_sha256": home_hashes(tasks),
        "robots_sha256": _robots(options.models.values()),
        "catalog_sha256": options.things.content or packaged_things_hash(),
        "source_sha256": source_hash(),
        **changes,
    }


def warn_of_unknown(settings: dict[str, Any]) -> None:
    """Warn if nothing tells whether another evaluation has the same settings."""
    told = {"policy": settings["policy_sha256"], "env_fn": settings.get("env", {}).get("sha256")}
    told |= settings.get("own_sha256", {})
    told |= {f"robots ({name})": sha256 for name, sha256 in settings["robots_sha256"].items()}
    if names := [name for name, sha256 in told.items() if sha256 and sha256.startswith(_UNKNOWN)]:
        warnings.warn(
            f"{', '.join(names)}: holds what cannot be pickled, or has no file, so nothing tells whether another "
            "evaluation had the same; the result is not reused, and an interrupted evaluation begins anew",
            stacklevel=3,
        )


def _robots(models: Collection[RobotModel]) -> dict[str, str]:
    """Return kind of robot -> its hash; where nothing tells its class apart, what no other evaluation has."""
    untold = {model.name for model in models if not is_told(model)}
    return {name: _or_unknown("" if name in untold else sha256) for name, sha256 in robots_hash(models).items()}


def _or_unknown(sha256: str | None) -> str:
    """Return what tells an object of the user's apart; where nothing does, what no other evaluation has."""
    return sha256 or f"{_UNKNOWN}{uuid4()}"


def _changed(setup: Setup) -> tuple[Options, dict[str, Any]]:
    """Return the options that the environment really has, and what it is made by and wrapped in."""
    env, wrappers = setup.make_env(), []
    try:
        core, inner = core_of_parallel(env), env
        while inner is not core:
            wrappers.append(name_of(inner))
            inner = getattr(inner, "env", core)
    finally:
        env.close()
    make = setup.maker
    name = setup.env_fn if isinstance(setup.env_fn, str) else name_of(make)
    return core.options, {"env": {"name": name, "sha256": _or_unknown(fingerprint(make)), "wrappers": wrappers}}
