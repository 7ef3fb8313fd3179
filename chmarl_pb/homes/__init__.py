"""Homes as data: reading, assembling and checking home URDFs. Nothing here knows a robot."""
