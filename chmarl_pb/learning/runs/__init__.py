"""A training run: collecting, learning, validating, logging, saving."""
