"""Policies that come with the benchmark: planner, search, random, and those that do without eyes, words or a memory."""
