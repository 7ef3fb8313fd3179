"""The belief search: probabilities of where X and Y are, and the views that find them in the fewest steps."""
