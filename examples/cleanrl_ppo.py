"""PPO in one file in the manner of CleanRL, on the flat vector of the humanoid, while the drone searches.

python examples/cleanrl_ppo.py --steps 50000
"""

import argparse
from collections.abc import Sequence
from functools import partial

import gymnasium as gym
import numpy as np

import chmarl_pb

try:
    import torch
    from torch import Tensor, nn
    from torch.distributions import Categorical
except ImportError as error:
    raise SystemExit(f"error: this example needs torch ({error}); run `pip install torch`") from None

KEYS = (
    "goal",
    "messages",
    "self",
)  # nearly all of them bits, from which a small network learns
GAMMA, LAMBDA, CLIP, ENTROPY, EPOCHS, MINIBATCHES, LENGTH = 0.97, 0.95, 0.2, 0.01, 4, 4, 64


def make_env(split: str) -> gym.Env[np.ndarray, np.int64]:
    """Return an environment."""
    env = gym.make("chmarl_pb:CHMARL/SceneGraphHumanoid-v0", split=split, goal=True)
    env = chmarl_pb.FlatObservation(gym.wrappers.RecordEpisodeStatistics(env), KEYS)
    return gym.wrappers.TimeAwareObservation(env, normalize_time=True)


def network(inputs: int, outputs: int) -> nn.Module:
    """Return a network of two hidden layers."""
    return nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))


class Agent(nn.Module):
    """An actor and a critic."""

    def __init__(self, inputs: int, actions: int):
        super().__init__()
        self.actor, self.critic = network(inputs, actions), network(inputs, 1)

    def policy(self, seen: Tensor) -> Categorical:
        """Return the distribution of actions."""
        return Categorical(logits=self.actor(seen))

    def value(self, seen: Tensor) -> Tensor:
        """Return the values."""
        return torch.squeeze(self.critic(seen), -1)


def update(agent: Agent, optimizer: torch.optim.Optimizer, batch: dict[str, Tensor]) -> None:
    """Improve the agent by PPO's clipped loss on a batch of steps."""
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(batch["action"])).chunk(MINIBATCHES):
            part = {key: value[rows] for key, value in batch.items()}
            policy, gain = agent.policy(part["seen"]), part["advantage"]
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            ratio = (policy.log_prob(part["action"]) - part["log_prob"]).exp()
            loss = -torch.min(gain * ratio, gain * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
            loss += 0.5 * (agent.value(part["seen"]) - part["return"]).pow(2).mean() - ENTROPY * policy.entropy().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print how episodes went."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--envs", type=int, default=8)
    parser.add_argument("--split", default="train")
    options = parser.parse_args(arguments)
    torch.manual_seed(0)
    # The step that ends an episode begins the next, as CleanRL's loops assume.
    same_step = gym.vector.AutoresetMode.SAME_STEP
    envs = gym.vector.SyncVectorEnv([partial(make_env, options.split)] * options.envs, autoreset_mode=same_step)
    seen, ended = torch.as_tensor(envs.reset(seed=0)[0]), torch.zeros(options.envs)
    assert isinstance(envs.single_action_space, gym.spaces.Discrete)
    agent = Agent(seen.shape[1], int(envs.single_action_space.n))
    optimizer = torch.optim.Adam(agent.parameters(), lr=1e-3, eps=1e-5)
    returns: list[float] = []
    for number in range(max(options.steps // (LENGTH * options.envs), 1)):
        steps: list[dict[str, Tensor]] = []
        for _ in range(LENGTH):
            with torch.no_grad():
                policy, value = agent.policy(seen), agent.value(seen)
                action = policy.sample()
            step = {"seen": seen, "action": action, "log_prob": policy.log_prob(action), "value": value, "ended": ended}
            observations, rewards, terminated, truncated, infos = envs.step(action.numpy())
            steps.append(step | {"reward": torch.as_tensor(rewards).float()})
            seen, ended = torch.as_tensor(observations), torch.as_tensor(terminated | truncated).float()
            if "final_info" in infos:
                returns += infos["final_info"]["episode"]["r"][infos["_final_info"]].tolist()
        batch = {key: torch.stack([step[key] for step in steps]) for key in steps[0]}
        with torch.no_grad():
            following, going, last = agent.value(seen), 1 - ended, torch.zeros(options.envs)
        batch["advantage"] = torch.zeros_like(batch["reward"])
        for time in reversed(range(LENGTH)):
            error = batch["reward"][time] + GAMMA * following * going - batch["value"][time]
            batch["advantage"][time] = last = error + GAMMA * LAMBDA * going * last
            following, going = batch["value"][time], 1 - batch["ended"][time]
        batch["return"] = batch["advantage"] + batch["value"]
        update(agent, optimizer, {key: value.flatten(0, 1) for key, value in batch.items()})
        if number % 10 == 0 and returns:
            print(f"{(number + 1) * LENGTH * options.envs} steps: mean return {np.mean(returns[-100:]):.2f}")
    envs.close()
    print(f"the last {len(returns[-100:])} episodes: mean return {np.mean(returns[-100:]):.2f}")


if __name__ == "__main__":
    main()
