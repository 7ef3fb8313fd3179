"""Data sets in Minari's format, and the scripts that made the fixed tasks and tours."""
