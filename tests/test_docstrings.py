"""The examples in docstrings run and show what really comes out."""

import doctest
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterator

import numpy as np
import pytest

import chmarl_pb

for extra in ("torch", "stable_baselines3", "minari", "matplotlib"):
    pytest.importorskip(extra)

#: What a reader looks up first; each shows an example.
SHOWN = (
    "envs.parallel.HouseholdEnv", "envs.joint.JointEnv", "envs.joint.HumanoidEnv", "envs.aec.TurnEnv",
    "envs.flat.flat_env", "envs.flat_vector.FlatObservation", "envs.numeric_infos.NumericInfos",
    "envs.vector.env.HouseholdVectorEnv", "envs.vector.asynchronous.HouseholdAsyncEnv", "envs.rollout.rollout",
    "evaluation.protocol.evaluate",
    "policies.policy.Policy", "sensing.sensors.Sensor", "tasks.messages.Channel", "tasks.advisers.Adviser",
    "tasks.kinds.TaskKind", "rendering.renderer.Renderer", "learning.runs.loop.train", "learning.config.RunConfig",
    "learning.algorithms.value.Config", "learning.algorithms.mappo.MappoConfig",
    "learning.algorithms.dagger.DAggerConfig", "learning.algorithms.mixers.Mixer",
    "learning.networks.encoders.build_encoder", "learning.rollouts.batched.BatchedPolicy",
    "learning.policies.cloned.CloningConfig", "learning.sb3.config.Config", "learning.sb3.vec_env.sb3_vec_env",
)  # fmt: skip

HAS_RAY = importlib.util.find_spec("ray") is not None  # of the extra ``scale``


def examples() -> Iterator[doctest.DocTest]:
    """Return the docstrings of the package that have examples; ``chmarl_pb`` and ``np`` are known in all of them."""
    for found in pkgutil.walk_packages(chmarl_pb.__path__, "chmarl_pb."):
        if not found.name.endswith("__main__") and (HAS_RAY or "ray" not in found.name.rpartition(".")[2].split("_")):
            module = importlib.import_module(found.name)
            tests = doctest.DocTestFinder().find(module, extraglobs={"chmarl_pb": chmarl_pb, "np": np})
            yield from (test for test in tests if test.examples)


EXAMPLES = {test.name.removeprefix("chmarl_pb."): test for test in examples()}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_of_a_docstring(name: str) -> None:
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL)
    runner.run(EXAMPLES[name], out=said.append, clear_globs=False)
    assert not runner.failures, "".join(said)


@pytest.mark.parametrize("name", SHOWN)
def test_what_a_reader_looks_up_first_shows_an_example(name: str) -> None:
    assert name in EXAMPLES, f"chmarl_pb.{name} has no example in its docstring; add one with >>>"
