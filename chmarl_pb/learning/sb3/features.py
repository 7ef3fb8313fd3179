"""What the networks of Stable-Baselines3 make of our observations."""

from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor

from chmarl_pb.learning.networks import DictEncoder
from chmarl_pb.learning.networks.numbers import Numbers
from chmarl_pb.learning.observation_keys import GOAL, goals
from chmarl_pb.learning.sb3.checks import Check


class HouseholdFeatures(BaseFeaturesExtractor):
    """Encodes observations by :func:`chmarl_pb.learning.networks.encoders.build_encoder`.

    Needs ``normalize_images=False``: SB3 turns all numbers into floats, which the encoder takes back to ids, and
    would scale pictures, which the encoder does itself.
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        features_dim: int = 128,
        graph_pool: str = "mean",
        numbers_past: bool = False,
        image_encoder: str = "cnn",
        word_vectors: bool = False,
    ):
        """Make the encoder of a space.

        Args:
            observation_space: as the environment gives it.
            features_dim: features that all is encoded to.
            graph_pool: see :func:`chmarl_pb.learning.networks.encoders.build_encoder`.
            numbers_past: whether ``messages``, ``self`` and the bits of ``goal`` go past the encoder to the heads, too.
            image_encoder: of pictures; the name of the frozen network where its features are in their place.
            word_vectors: see :func:`chmarl_pb.learning.networks.encoders.build_encoder`.

        Raises:
            ValueError: observations are flattened, stacked, normalised or scaled.
        """
        check = Check(observation_space)
        encoder = DictEncoder(
            observation_space, features_dim, image_encoder, graph_pool,
            numbers_past=numbers_past, word_vectors=word_vectors, taught=False, cells_past=False,
        )  # fmt: skip
        super().__init__(observation_space, encoder.size)
        self.encoder, self._check = encoder, check

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        self._check(observations)
        features: Tensor = self.encoder(observations)
        return features


class GoalFeatures(BaseFeaturesExtractor):
    """Nothing but numbers: ``messages``, ``self``, and whether what the instruction asks for is in view.

    The graph, the words and the picture are left out. These few numbers carry a policy without memory further in
    minutes than an encoder does in hours.
    """

    def __init__(self, observation_space: spaces.Dict):
        """Find the numbers in a space.

        Raises:
            ValueError: the goal is not observed, or observations are flattened, stacked, normalised or scaled.
        """
        check = Check(observation_space, GOAL)
        if not goals(observation_space):
            raise ValueError(f"{observation_space} has no {GOAL!r}; make the environment with goal=True")
        numbers = Numbers(observation_space)
        super().__init__(observation_space, numbers.size)
        self.numbers, self._check = numbers, check

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        self._check(observations)
        features: Tensor = self.numbers(observations)
        return features
