"""What the benchmark fixes in files: its tasks."""
