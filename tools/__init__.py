"""Scripts that make what is committed."""
