"""An adviser of one's own: it says how many steps the best plan has, and nothing about how to go on.

python examples/hint_adviser.py
"""

from typing import Any

import chmarl_pb


class HintAdviser:
    """Tells the humanoid after each step how many it has taken, and how many the best plan has."""

    def begin(self, simulation: Any, task: Any, goals: Any) -> None:
        """Remember how long the best plan is."""
        self.optimal_steps = task.optimal_steps

    def before(self, actions: dict[str, str], outcome: Any) -> None:
        """Take note of nothing."""

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return a sentence for the humanoid; whoever is left out gets none."""
        hint = "" if succeeded["humanoid"] else "That did not work. "
        return {"humanoid": f"{hint}The best plan has {self.optimal_steps} steps, you have taken {step + 1}."}


def main(task: str = "val-unseen-000") -> None:
    """Play a task with the search policy, and print what the humanoid does and what it reads afterwards."""
    env = chmarl_pb.parallel_env(feedback=HintAdviser(), split="val-unseen")
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("search", env), seed=0, task=task)
    for actions, infos in zip(episode.actions, episode.infos[1:], strict=True):
        print(f"{env.action_names['humanoid'][actions['humanoid']]:16} {infos['humanoid']['feedback']}")
    env.close()


if __name__ == "__main__":
    main()
