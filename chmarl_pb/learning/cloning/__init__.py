"""Learning from stored episodes of the planner."""
