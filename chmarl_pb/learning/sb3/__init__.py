"""Baselines of Stable-Baselines3: ``chmarl-pb sb3``."""

from chmarl_pb.extras import needs

with needs("chmarl_pb.learning.sb3", "train"):
    from chmarl_pb.learning.sb3.checkpoint import load_policy as load_policy
    from chmarl_pb.learning.sb3.features import GoalFeatures as GoalFeatures
    from chmarl_pb.learning.sb3.features import HouseholdFeatures as HouseholdFeatures
    from chmarl_pb.learning.sb3.policy import policy_of as policy_of
