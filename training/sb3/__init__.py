"""Baselines of Stable-Baselines3: `python -m training.sb3`."""

from chmarl_pb.extras import needs

with needs("training.sb3", "train"):
    from training.sb3.features import GoalFeatures as GoalFeatures
    from training.sb3.features import HouseholdFeatures as HouseholdFeatures
    from training.sb3.policy import load_policy as load_policy
    from training.sb3.policy import policy_of as policy_of
