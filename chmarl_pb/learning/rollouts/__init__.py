"""Episodes that are played side by side, and what is learned from them: batches, replay buffer."""
