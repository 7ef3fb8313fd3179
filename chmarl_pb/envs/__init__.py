"""The environments: PettingZoo core, and AEC and Gymnasium views of it."""
