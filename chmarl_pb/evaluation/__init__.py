"""Evaluation: protocol, metrics, what cooperation gains, reports, and episode files."""
