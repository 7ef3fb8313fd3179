"""The commands `chmarl-pb episode save` and `chmarl-pb episode replay`."""

import sys
from pathlib import Path

import chmarl_pb
from chmarl_pb.envs.episode_file import load_episode, record_episode, replay_episode, save_episode
from chmarl_pb.envs.options import checked_seed
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.policies import find_policy
from chmarl_pb.tasks.splits import find_task


def save(policy: str, task_id: str, observation: str, seed: int, out: Path, goal: bool = False) -> int:
    """Play a task as an evaluation with this seed does, and save the episode; return the exit code."""
    task, source, seed = find_task(task_id), find_policy(policy), checked_seed(seed)
    env = HouseholdEnv(observation, home=task.home, goal=goal)
    try:
        file = record_episode(env, source.make(env), source.name, episode_seed(task, seed), task)
    finally:
        env.close()
    save_episode(file, out)
    print(f"{out}: {'success' if file.success else 'failure'} after {len(file.actions)} steps, L* {task.optimal_steps}")
    return 0


def replay(path: Path) -> int:
    """Play an episode file again; return 0 if every state is the same, else 1."""
    file = load_episode(path)
    if file.library != chmarl_pb.__version__:
        print(f"{path}: saved by version {file.library}, replayed by {chmarl_pb.__version__}", file=sys.stderr)
    difference = replay_episode(file)
    if difference is not None:
        print(f"{path}: {difference}", file=sys.stderr)
        return 1
    ending = "success" if file.success else "failure"
    print(f"{path}: all {len(file.states)} states are the same; {ending} after {len(file.actions)} steps")
    return 0
