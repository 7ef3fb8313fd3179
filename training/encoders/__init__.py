"""Encoders: observations -> features. See :func:`build_encoder`."""

from training.encoders.build import GRAPH_POOLS, DictEncoder, build_encoder

__all__ = ["GRAPH_POOLS", "DictEncoder", "build_encoder"]
