"""Homes made up from a seed: a floor plan, doors, furniture and colours by rules. The same on every machine."""
