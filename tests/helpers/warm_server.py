"""Loads what processes of the tests need, machine code too, by a step in a small home; see ``warm_processes``."""

import tempfile
from contextlib import closing, suppress
from importlib import import_module
from pathlib import Path

from tests.helpers.small_homes import home_text

with suppress(ImportError):
    import_module("torch._dynamo")  # before Numba: see tests/conftest.py

from chmarl_pb.cli import episode, evaluate  # noqa: F401
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.registry import make_policy

with tempfile.TemporaryDirectory() as folder:
    urdf = Path(folder) / "home.urdf"
    urdf.write_text(home_text(), encoding="utf-8")
    with closing(HouseholdEnv("visual", home=str(urdf), image_size=32)) as env:
        policy = make_policy("planner", env)
        observations, infos = env.reset(seed=0)
        policy.reset(0)
        env.step(policy.act(observations, infos))
