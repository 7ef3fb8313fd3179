"""Policies that come with the benchmark: the privileged planner, the search policy, random."""
