"""Baselines of Stable-Baselines3: `python -m training.sb3`."""

from training.sb3.policy import load_policy as load_policy
