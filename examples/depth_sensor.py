"""A sensor of one's own: how far it is to the nearest thing in each direction.

python examples/depth_sensor.py
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

import chmarl_pb
from chmarl_pb.sensing.sensors import View


@dataclass(frozen=True)
class RangeFinder:
    """A row of distances from left to right, as of a laser scanner, made from the camera's depth."""

    beams: int = 32
    most: float = 10.0  # metres

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of the key "range"."""
        return {"range": spaces.Box(0, self.most, (self.beams,), np.float32)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the nearest distance of each column of a picture that is as wide as there are beams."""
        return {"range": view.depth(self.beams).min(axis=0).clip(0, self.most)}


def main() -> None:
    """Turn the humanoid around, and print what it measures beside the scene graph."""
    env = chmarl_pb.parallel_env(observation=("scene_graph", RangeFinder()), split="val-unseen")
    observations, _ = env.reset(seed=0)
    print(env.observation_space("humanoid")["range"])
    turn, stay = env.action_names["humanoid"].index("turn_left"), env.action_names["drone"].index("stay")
    for _ in range(4):
        print(" ".join(f"{metres:.1f}" for metres in observations["humanoid"]["range"][::4]), "m")
        observations, *_ = env.step({"humanoid": turn, "drone": stay})
    env.close()


if __name__ == "__main__":
    main()
