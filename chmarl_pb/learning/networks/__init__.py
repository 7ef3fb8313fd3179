"""Networks: encoders of observations (see :func:`build_encoder`), agents, and the frozen encoders of pictures."""

from chmarl_pb.learning.networks.encoders import GRAPH_POOLS, DictEncoder, build_encoder

__all__ = ["GRAPH_POOLS", "DictEncoder", "build_encoder"]
