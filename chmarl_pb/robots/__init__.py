"""The robots: bodies, what each action does, and the two executions."""
