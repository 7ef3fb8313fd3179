"""Scripts that build the URDFs of objects, furniture and robots."""
