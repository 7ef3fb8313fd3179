"""Baselines of Stable-Baselines3: `python -m training.sb3`."""

from chmarl_pb.extras import needs

with needs("training.sb3", "train"):
    from training.sb3.policy import load_policy as load_policy
