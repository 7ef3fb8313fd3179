"""What robots observe of the world: who sees what, pictures, scene graphs."""
