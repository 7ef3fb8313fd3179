"""Episodes of the benchmark are what they were: digests of what random policies observe and earn, words aside."""

import hashlib
from typing import Any

import numpy as np
import pytest

import chmarl_pb

#: Observation, split, number of episodes -> digest, as it was in version 0.1.0.
DIGESTS = {
    ("scene_graph", "train", 120): "ad2ef7886983a097",
    ("scene_graph", "test-unseen", 60): "aa84facf3575e78d",
    ("visual", "train", 30): "bc7826911ce48fdc",
    ("visual", "val-unseen", 15): "98eb4dcfe620af1f",
    ("visual", "train", 3): "241329d389a80443",
    ("visual", "val-unseen", 2): "08f27e17bc533a1c",
}


def added(digest: Any, observations: Any, ends: Any, infos: Any) -> None:
    """Add what one step has shown to a digest."""
    for agent, observation in sorted(observations.items()):
        for key in sorted(observation.keys() - {"instruction", "feedback"}):
            digest.update(key.encode())
            digest.update(np.ascontiguousarray(observation[key]).tobytes())
        info = infos[agent]
        facts = float(info["potential"]), bool(info["success"]), sorted(info["visible"])
        digest.update(repr(facts).encode())
    if ends:
        digest.update(repr([sorted((agent, float(value)) for agent, value in part.items()) for part in ends]).encode())


def digest_of(observation: str, split: str, episodes: int) -> str:
    """Return the digest of some episodes of a random policy."""
    env, digest = chmarl_pb.parallel_env(observation=observation, split=split), hashlib.sha256()
    for seed in range(episodes):
        rng = np.random.default_rng(seed)
        observations, infos = env.reset(seed=seed)
        added(digest, observations, None, infos)
        while env.agents:
            actions = {agent: int(rng.integers(env.action_space(agent).n)) for agent in env.agents}
            observations, *ends, infos = env.step(actions)
            added(digest, observations, ends, infos)
    env.close()
    return digest.hexdigest()[:16]


@pytest.mark.parametrize(
    ("observation", "split", "episodes"),
    [pytest.param(*key, marks=pytest.mark.slow if key[0] == "visual" and key[2] > 3 else ()) for key in DIGESTS],
)
def test_episodes_of_the_benchmark_have_not_changed(observation: str, split: str, episodes: int) -> None:
    assert digest_of(observation, split, episodes) == DIGESTS[observation, split, episodes]
