"""The humanoid and the drone: bodies, what each action does, and the two executions."""
