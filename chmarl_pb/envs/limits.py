"""How long an episode is; apart from the other options, so that registering the ids imports next to nothing."""

MAX_STEPS = 28  # joint steps: the random policy solves 2 per cent of test-unseen within them, see docs/benchmark.md
