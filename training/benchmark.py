"""The benchmark as a learner meets it: how its environment is made, and what a checkpoint has to know of that."""

from collections.abc import Callable
from functools import partial
from typing import Any

import chmarl_pb
from training.features import FeatureEnv
from training.policy import FROZEN
from training.resnet import frozen_resnet18


def benchmark(
    observation: str, messages: bool = True, feedback: bool = True, image_encoder: str = "resnet18", **options: Any
) -> tuple[Callable[[], Any], dict[str, Any]]:
    """Return what makes the ParallelEnv of the training tasks, and the setting of policies that are trained in it.

    Args:
        observation: "scene_graph" or "visual".
        messages: whether the robots hear each other.
        feedback: whether they get language feedback.
        image_encoder: of pictures; with "resnet18", the environment gives its frozen features in their place.
        options: more options of the environment.

    Raises:
        CheckpointError: there are no weights of ResNet-18, and pictures need them.
    """
    frozen = observation == "visual" and image_encoder == "resnet18"
    env_fn = partial(_environment, frozen, observation, messages=messages, feedback=feedback, **options)
    fingerprint = frozen_resnet18().fingerprint if frozen else ""
    return env_fn, {"messages": messages, "feedback": feedback, FROZEN: fingerprint}


def _environment(frozen: bool, observation: str, **options: Any) -> Any:
    env = chmarl_pb.parallel_env(observation, **options)
    return FeatureEnv(env) if frozen else env
