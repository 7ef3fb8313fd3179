"""Data sets in Minari's format, and the fixed tasks of the splits."""
