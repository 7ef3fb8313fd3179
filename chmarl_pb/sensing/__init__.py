"""Cameras, visibility and scene graphs."""
