"""REINFORCE on environments that do not wait for each other: whichever are ready first get their next actions.

python examples/asynchronous.py --steps 50000
"""

import argparse
from collections.abc import Sequence
from functools import partial

import gymnasium as gym
import numpy as np

import chmarl_pb

KEYS = ("goal", "messages", "self")  # nearly all of them bits, from which a linear policy learns
GAMMA, RATE = 0.97, 0.02

Moment = tuple[np.ndarray, float]  # the gradient of an action's log-probability, (inputs, actions), and its reward


def make_env(split: str) -> gym.Env[np.ndarray, np.int64]:
    """Return an environment: the humanoid, while the drone searches."""
    env = gym.make("chmarl_pb:CHMARL/SceneGraphHumanoid-v1", split=split, goal=True)
    return chmarl_pb.FlatObservation(env, KEYS)


class Policy:
    """A linear policy, and the mean return that it is measured by."""

    def __init__(self, inputs: int, actions: int):
        self.weights, self.usual, self._rng = np.zeros((inputs, actions)), 0.0, np.random.default_rng(0)

    def act(self, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return actions, (k,), and the gradients of their log-probabilities, (k, inputs, actions)."""
        scores = seen @ self.weights
        chances = np.exp(scores - scores.max(axis=1, keepdims=True))
        chances /= chances.sum(axis=1, keepdims=True)
        actions = (chances.cumsum(axis=1) > self._rng.random((len(seen), 1))).argmax(axis=1)
        return actions, seen[:, :, None] * (np.eye(chances.shape[1])[actions] - chances)[:, None, :]

    def learn(self, episode: list[Moment]) -> float:
        """Improve the policy by an episode, and return its return."""
        future = 0.0
        for gradient, reward in reversed(episode):
            future = reward + GAMMA * future
            self.weights += RATE * (future - self.usual) * gradient
        self.usual += 0.01 * (future - self.usual)
        return sum(reward for _, reward in episode)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print how episodes went."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--batch-size", type=int, default=8)
    parser.add_argument("--workers", type=int)
    parser.add_argument("--split", default="train")
    options = parser.parse_args(arguments)
    envs = chmarl_pb.vector_env(
        options.envs, partial(make_env, options.split), options.workers, "SameStep", batch_size=options.batch_size
    )
    assert isinstance(envs.single_action_space, gym.spaces.Discrete)
    policy = Policy(envs.single_observation_space.shape[0], int(envs.single_action_space.n))
    gradients: dict[int, np.ndarray] = {}  # of the action that an environment is at
    episodes: list[list[Moment]] = [[] for _ in range(options.envs)]  # the present one of each environment
    returns: list[float] = []
    envs.async_reset(seed=0)
    for _ in range(options.steps // options.batch_size):
        seen, rewards, terminated, truncated, infos = envs.recv()  # those that are ready; others are being stepped
        for index, number in enumerate(infos["env_id"].tolist()):
            if number in gradients:  # else it has only been reset
                episodes[number].append((gradients.pop(number), float(rewards[index])))
            if terminated[index] or truncated[index]:
                returns.append(policy.learn(episodes[number]))
                episodes[number] = []
        actions, new = policy.act(seen)
        gradients.update(zip(infos["env_id"].tolist(), new, strict=True))
        envs.send(actions, infos["env_id"])
    envs.close()
    last = returns[-100:] or [0.0]
    print(f"{len(returns)} episodes; the last {len(last)}: mean return {np.mean(last):.2f}")


if __name__ == "__main__":
    main()
