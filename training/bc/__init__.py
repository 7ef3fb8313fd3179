"""Behaviour cloning from stored episodes."""
