"""The benchmark as a learner meets it: how its environment is made, and what a checkpoint has to know of that."""

from collections.abc import Callable
from functools import partial
from typing import Any, Literal

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.learning.config import CATALOG, FROZEN, HOME
from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS, FrozenEncoder, frozen_encoder
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.networks.kept_features import FeatureEnv
from chmarl_pb.learning.observation_keys import GOAL
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE

Observation = Literal["scene_graph", "visual"]


def benchmark(
    observation: str,
    messages: bool = True,
    feedback: bool = True,
    image_encoder: str = "resnet18",
    image_size: int = VISIBILITY_SIZE,
    **options: Any,
) -> tuple[Callable[[], Any], dict[str, Any]]:
    """Return what makes the ParallelEnv of the training tasks, and the setting of policies that are trained in it.

    Args:
        observation: "scene_graph" or "visual".
        messages: whether the robots hear each other.
        feedback: whether they get language feedback.
        image_encoder: of pictures; if it is frozen, the environment gives its features in their place.
        image_size: of pictures, in pixels.
        options: more options of the environment.

    Raises:
        ValueError: there is no such encoder.
        CheckpointError: there are no weights of a frozen encoder, and pictures need them.
    """
    look_up("image_encoder", image_encoder, {**IMAGE_ENCODERS, **FROZEN_ENCODERS})
    frozen = frozen_encoder(image_encoder) if observation == "visual" and image_encoder in FROZEN_ENCODERS else None
    shared = {"messages": messages, "feedback": feedback, "image_size": image_size}
    env_fn = partial(_environment, frozen, observation, **shared, **options)
    known = Options(catalog=options.get("catalog")).things.content
    own: dict[str, Any] = {CATALOG: known} if known else {}  # as in checkpoints from before there was a choice
    own |= {GOAL: True} if options.get(GOAL) else {}
    own |= {HOME: str(options[HOME])} if options.get(HOME) else {}
    return env_fn, {**shared, FROZEN: frozen.fingerprint if frozen else "", **own}


def _environment(frozen: FrozenEncoder | None, observation: str, **options: Any) -> Any:
    env = chmarl_pb.parallel_env(observation, **options)
    return FeatureEnv(env, frozen) if frozen else env
