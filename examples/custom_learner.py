"""A learner of your own: REINFORCE with one network for each robot, on the PettingZoo interface.

python examples/custom_learner.py --episodes 500
"""

import argparse
from collections.abc import Sequence
from typing import Any

import chmarl_pb
from chmarl_pb.extras import needs

with needs("this example", "train", script=True):
    import torch
    from torch import nn

from chmarl_pb.learning.networks import build_encoder


def play(env: Any, policies: nn.ModuleDict, seed: int) -> tuple[torch.Tensor, torch.Tensor, bool]:
    """Play one episode; return the log-probabilities of all actions, the rewards, and whether it succeeded."""
    observations, infos = env.reset(seed=seed)
    log_probabilities, rewards = [], []
    while env.agents:
        actions = {}
        for robot, policy in policies.items():
            seen = {key: torch.from_numpy(value)[None] for key, value in observations[robot].items()}
            choice = torch.distributions.Categorical(logits=policy(seen)[0])
            action = choice.sample()
            actions[robot] = int(action)
            log_probabilities.append(choice.log_prob(action))
        observations, reward, _, _, infos = env.step(actions)
        rewards.append(reward[robot])  # the same for all robots
    return torch.stack(log_probabilities).view(len(rewards), -1), torch.tensor(rewards), infos[robot]["success"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print how it goes."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--episodes", type=int, default=500)
    parser.add_argument("--split", default="train")
    options = parser.parse_args(arguments)
    torch.manual_seed(0)
    env = chmarl_pb.parallel_env("scene_graph", split=options.split)
    policies = nn.ModuleDict()
    for robot in env.possible_agents:
        actions = int(env.action_space(robot).n)
        policies[robot] = nn.Sequential(build_encoder(env.observation_space(robot)), nn.Linear(128, actions))
    optimizer, baseline = torch.optim.Adam(policies.parameters(), lr=1e-3), 0.0
    for episode in range(options.episodes):
        log_probabilities, rewards, success = play(env, policies, seed=episode)
        returns = rewards.flip(0).cumsum(0).flip(0)
        loss = -(log_probabilities * (returns - baseline).unsqueeze(1)).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        baseline += 0.05 * (float(returns[0]) - baseline)
        print(f"episode {episode}: return {returns[0]:.1f}, mean {baseline:.2f}, success {success}")
    env.close()


if __name__ == "__main__":
    main()
