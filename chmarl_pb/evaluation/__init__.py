"""Evaluation: the protocol, the metrics, what cooperation gains, and reports."""
