"""The four Gymnasium ids, registered when the package is imported."""

import gymnasium

from chmarl_pb.envs.limits import MAX_STEPS

#: Id -> robots that learn, observation.
_ENTRY_POINTS = {
    "CHMARL/SceneGraph-v0": ("joint", "scene_graph"),
    "CHMARL/Visual-v0": ("joint", "visual"),
    "CHMARL/SceneGraphHumanoid-v0": ("humanoid", "scene_graph"),
    "CHMARL/VisualHumanoid-v0": ("humanoid", "visual"),
}
ENV_IDS = tuple(_ENTRY_POINTS)


def register_envs() -> None:
    """Register the four ids; registering again changes nothing."""
    for env_id, (robots, observation) in _ENTRY_POINTS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                env_id,
                f"chmarl_pb.envs.joint:make_{robots}",
                max_episode_steps=MAX_STEPS,
                kwargs={"observation": observation},
                vector_entry_point=f"chmarl_pb.envs.vector.env:{robots}_vector_env",
            )
