"""Policies of trained weights."""
