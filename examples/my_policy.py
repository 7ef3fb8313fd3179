"""A policy of one's own, evaluated.

python examples/my_policy.py, or chmarl-pb evaluate --policy examples.my_policy:MyPolicy
"""

from typing import Any

import chmarl_pb
from chmarl_pb.policies.search import SearchPolicy


class MyPolicy:
    """The search policy, but the humanoid waits until a message says where X is."""

    def __init__(self, env: chmarl_pb.HouseholdEnv) -> None:
        """Remember what the environment's actions are."""
        self.search, self.names = SearchPolicy(env.action_names, env.rooms), env.action_names

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.search.reset(seed)

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        """Return robot -> number of its action."""
        actions = self.search.act(observations, infos)
        if "humanoid" in observations and not observations["humanoid"]["messages"][0].any():
            actions["humanoid"] = self.names["humanoid"].index("stay")
        return actions


def main(tasks: int = 50) -> None:
    """Print how it does beside the policy that it is made of."""
    for policy in (MyPolicy, "search"):
        report = chmarl_pb.evaluate(
            policy, "val-unseen", seeds=[0], workers=1, tasks=chmarl_pb.load_tasks("val-unseen")[:tasks]
        )
        print(f"{report.settings['policy']:20} success {report.success_rate:.0%}, PLW {report.plw:.0%}")


if __name__ == "__main__":
    main()
