"""The four Gymnasium ids, registered when the package is imported."""

import gymnasium

#: Id -> view, function that makes a vector of it, observation.
_ENTRY_POINTS = {
    "CHMARL/SceneGraph-v0": ("JointEnv", "joint_vector_env", "scene_graph"),
    "CHMARL/Visual-v0": ("JointEnv", "joint_vector_env", "visual"),
    "CHMARL/SceneGraphHumanoid-v0": ("HumanoidEnv", "humanoid_vector_env", "scene_graph"),
    "CHMARL/VisualHumanoid-v0": ("HumanoidEnv", "humanoid_vector_env", "visual"),
}
ENV_IDS = tuple(_ENTRY_POINTS)


def register_envs() -> None:
    """Register the four ids; registering again changes nothing."""
    for env_id, (view, vector, observation) in _ENTRY_POINTS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                env_id,
                f"chmarl_pb.envs.joint:{view}",
                kwargs={"observation": observation},
                vector_entry_point=f"chmarl_pb.envs.vector:{vector}",
            )
