"""Homes as data: reading, assembling and checking home URDFs, and the space that they offer to robots."""
