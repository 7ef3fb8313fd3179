"""The algorithms: value factorisation, DAgger, MAPPO, behaviour cloning."""
