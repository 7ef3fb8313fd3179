"""The baselines of Stable-Baselines3: ``python -m training.sb3``."""
