"""Play episodes side by side in one process, with agents that act in one batch."""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from typing import Any, Protocol, cast

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.components import Counts, as_action, as_label, as_row, best_action, mask_of, of_each
from chmarl_pb.learning.networks.agents import Agent, RecurrentActors
from chmarl_pb.learning.rollouts.batched import play_together
from chmarl_pb.learning.rollouts.replay_buffer import Episode
from chmarl_pb.learning.spaces import LearnerInterface, learner_interface_of, spaces_of, stack, tensors, zeros
from chmarl_pb.policies.expert import Expert, as_expert
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy

NO_LABEL = -1  # nobody has said what would have been right


class Choose(Protocol):
    """How actions are chosen from what the networks give for them."""

    def __call__(self, values: Tensor, action_mask: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the actions (B, K).

        Args:
            values: (B, K, A) of the actions.
            action_mask: (B, K, A) bool.
            labels: (B, K) what the expert would do, or ``NO_LABEL``.
            rng: for random choices.
        """


def epsilon_after(episodes: int, config: Any) -> float:
    """Return the share of random actions after a number of episodes.

    It falls linearly from ``config.exploration_initial_eps`` to ``exploration_final_eps``, over the share
    ``exploration_fraction`` of ``config.episodes``.
    """
    first: float = config.exploration_initial_eps
    last: float = config.exploration_final_eps
    falling: float = config.exploration_fraction * config.episodes
    progress = min(episodes / falling, 1.0) if falling else 1.0
    return first + progress * (last - first)


def epsilon_greedy(epsilon: float) -> Choose:
    """Return the best allowed actions, but for a share of random ones, in each component by itself."""

    def choose(values: Tensor, action_mask: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        best = best_action(values, action_mask).numpy()
        random = _random_actions(action_mask.numpy(), rng)
        return np.where(rng.random(best.shape) < epsilon, random, best)

    return choose


def _random_actions(action_mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return one of the allowed actions (...) of each row of a mask (..., A)."""
    numbers = rng.integers(action_mask.sum(axis=-1))  # of the action among those that are allowed
    chosen: np.ndarray = (action_mask.cumsum(axis=-1) > numbers[..., np.newaxis]).argmax(axis=-1)
    return chosen


def greedy(values: Tensor, action_mask: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the best allowed actions."""
    return best_action(values, action_mask).numpy()


class Collector:
    """Several environments of one kind.

    Attributes:
        envs: the environments.
        interface: what a learner has to know of them.
        check: called before every joint step; may raise an error to end the episodes.
        episodes_in_a_home: so many seeds in a row, from a multiple of this on, spare them a change of homes.
    """

    def __init__(
        self,
        env_fn: Callable[[], Any],
        count: int,
        expert: Callable[[Any], Expert | Policy] | None = None,
        horizon: int | None = None,
        check: Callable[[], None] = lambda: None,
    ):
        """Make the environments.

        Args:
            env_fn: makes one.
            count: how many.
            expert: makes an expert in each of them, if wanted.
            horizon: most steps of an episode; None: any number.
            check: called before every joint step; may raise an error to end the episodes.

        Raises:
            ValueError: ``env_fn`` returns one environment several times, or what no learner can learn from.
        """
        self._horizon, self.check = horizon, check
        self.envs = [env_fn() for _ in range(count)]
        spaces_of(self.envs[0])
        if len({id(getattr(env, "unwrapped", env)) for env in self.envs}) < count:
            raise ValueError("env_fn returns the same environment again; let it make a new one each time")
        self._experts = [as_expert(expert(env)) for env in self.envs] if expert else []
        self.interface: LearnerInterface = learner_interface_of(self.envs[0])
        core = getattr(self.envs[0], "unwrapped", self.envs[0])
        self.episodes_in_a_home: int = getattr(core, "episodes_in_a_home", 1)

    def play(
        self,
        agents: nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        seeds: Sequence[int],
        options: Sequence[dict[str, Any] | None] | None = None,
        ask_experts: bool = False,
    ) -> list[Episode]:
        """Play one episode in each of the first environments.

        Args:
            agents: agent -> its network.
            choose: chooses the actions.
            rng: of random choices.
            seeds: of the resets, one for each episode, at most as many as there are environments.
            options: of the resets.
            ask_experts: whether the experts, if there are any, say what they would do.

        Raises:
            ValueError: an episode goes on after ``horizon`` steps.
        """
        envs, episodes = self.envs[: len(seeds)], [Episode() for _ in seeds]
        experts = self._experts[: len(seeds)] if ask_experts else []
        explorer = Explorer(agents, choose, rng, experts, self.check)
        for number, actions, result in play_together(envs, explorer, seeds, options or [None] * len(seeds)):
            episode, env = episodes[number], envs[number]
            if actions is None:
                begin(self.interface, episode, env, result)
                continue
            if experts:
                episode.labels.append(explorer.labels[number])
            advance(self.interface, episode, env, actions, result)
            if len(episode) == self._horizon and env.agents:
                raise ValueError(_goes_on(self._horizon, actions, result))
        return episodes

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()


def _goes_on(horizon: int, actions: Actions, step: tuple[Any, ...]) -> str:
    """Return what is wrong with an episode that is not over after all steps that can be kept."""
    _, _, terminated, truncated, _ = step
    if all(terminated.get(name) or truncated.get(name) for name in actions):
        return "all agents have ended, but env.agents still names them; take those out that are terminated or truncated"
    return f"an episode goes on after horizon={horizon} steps; give a longer horizon"


class Explorer:
    """Agents as a batched policy; their actions are chosen from what the networks give for them.

    Attributes:
        labels: episode -> what its expert would have done in the last step.
    """

    def __init__(
        self,
        agents: nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        experts: Sequence[Expert] = (),
        check: Callable[[], None] = lambda: None,
    ):
        """Take the networks over; see :meth:`Collector.play` and :class:`Collector`."""
        self._agents, self._choose, self._rng = agents, choose, rng
        self._counts = {name: cast(Agent, agent).actions for name, agent in agents.items()}
        self._experts, self._check = experts, check
        self.labels: dict[int, Actions] = {}

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed."""
        self._actors = RecurrentActors(self._agents, len(seeds))
        for expert, seed in zip(self._experts, seeds, strict=False):
            expert.reset(seed)

    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return agent -> its action in the episodes with these numbers, for the agents that are there."""
        self._check()
        if self._experts:
            asked = zip(episodes, observations, infos, strict=True)
            self.labels = {number: self._proposed(number, seen, info) for number, seen, info in asked}
        chosen: list[Actions] = [{} for _ in episodes]
        for name, counts in self._counts.items():
            rows = [row for row, seen in enumerate(observations) if name in seen]
            if not rows:
                continue
            index = torch.tensor([episodes[row] for row in rows])
            values = self._actors.values(name, index, tensors(stack([observations[row][name] for row in rows])))
            mask = torch.from_numpy(np.stack([mask_of(name, infos[row], counts) for row in rows]))
            labels = self._labels_of(name, [episodes[row] for row in rows], mask.numpy())
            actions = self._choose(values, mask, labels, self._rng)
            self._actors.remember(name, index, torch.from_numpy(actions))
            for row, action in zip(rows, actions, strict=True):
                chosen[row][name] = as_action(action, counts)
        for number, actions_done in zip(episodes, chosen, strict=True) if self._experts else ():
            self._experts[number].note(actions_done)
        return chosen

    def _proposed(self, number: int, observations: Observations, infos: Infos) -> Actions:
        """Return what an episode's expert would do in the place of those who are there.

        Raises:
            ValueError: it is no dict of agents.
        """
        proposed = self._experts[number].propose(observations, infos)
        if not isinstance(proposed, Mapping) or not proposed.keys() <= self._counts.keys():
            raise ValueError(
                f"the expert proposes {proposed!r}; let it return a dict of actions by the names of agents: "
                f"{', '.join(self._counts)}"
            )
        return {name: deepcopy(action) for name, action in proposed.items() if name in observations}

    def _labels_of(self, name: str, episodes: Sequence[int], mask: np.ndarray) -> np.ndarray:
        """Return what experts would do in an agent's place, (B, K), or ``NO_LABEL``; a mask is (B, K, A).

        Raises:
            ValueError: the agent has no such action, or may not do it now.
        """
        counts = self._counts[name]
        if not self._experts:
            return np.full((len(episodes), len(of_each(counts))), NO_LABEL)
        said = [self.labels.get(number, {}).get(name, NO_LABEL) for number in episodes]
        labels = np.array([as_label(name, label, counts, NO_LABEL) for label in said])
        allowed = np.take_along_axis(mask, labels.clip(min=0)[..., None], axis=-1)[..., 0] | (labels == NO_LABEL)
        if not allowed.all():
            row = int(np.argmin(allowed.all(axis=1)))
            raise ValueError(
                f"the expert would do {said[row]!r} in the place of {name!r}, which the action_mask forbids; let it "
                f"name an action that is allowed, or {NO_LABEL}"
            )
        return labels


def begin(interface: LearnerInterface, episode: Episode, env: Any, start: tuple[Any, ...]) -> None:
    """Record the beginning of an episode: what an environment's reset has returned.

    Raises:
        ValueError: nobody is there, or somebody who is observes nothing.
    """
    _look(interface, episode, env, *start)
    if not env.agents:
        raise ValueError("an episode is over right after its reset, as env.agents is empty; let somebody act in it")
    if blind := [name for name in env.agents if name not in start[0]]:
        raise ValueError(f"reset() gives no observation of {blind[0]!r}, which is there; return one for each of agents")


def advance(interface: LearnerInterface, episode: Episode, env: Any, actions: Actions, step: tuple[Any, ...]) -> None:
    """Record a step, which has returned five things.

    Raises:
        ValueError: an agent acts that did not in the step before, has no last observation, or is paid no number.
    """
    names = interface.agents
    observations, rewards, terminated, _, infos = step
    if cut := [name for name in actions if name not in observations and not terminated.get(name, False)]:
        raise ValueError(
            f"{cut[0]!r} acts in step {len(episode) + 1} of an episode, which neither ends its task nor gives it an "
            "observation; return what it observes last, from which its return is estimated, or say terminated"
        )
    episode.actions.append(
        {
            name: actions[name] if name in actions else _first_action(counts)
            for name, counts in interface.actions.items()
        }
    )
    if unpaid := [name for name in actions if name not in rewards]:
        raise ValueError(
            f"step() returns no reward of {unpaid[0]!r}, which has acted; return one, 0 where it gets none"
        )
    paid = [_number(name, rewards[name]) if name in actions else 0.0 for name in names]
    if odd := [name for name, reward in zip(names, paid, strict=True) if not np.isfinite(reward)]:
        raise ValueError(
            f"the reward of {odd[0]!r} in step {len(episode)} of an episode is {rewards[odd[0]]!r}; return a number"
        )
    episode.rewards.append(np.array(paid, np.float32))
    episode.acted.append(_acting(names, episode, actions))
    episode.terminated.append(np.array([bool(terminated.get(name, False)) for name in names]))
    _look(interface, episode, env, observations, infos)


def _acting(names: Sequence[str], episode: Episode, actions: Actions) -> np.ndarray:
    """Return which agents (N) act; those who have not from the first step on have no whole history to learn from.

    Raises:
        ValueError: one of them joins later.
    """
    acting = np.array([name in actions for name in names])
    if episode.acted and (joined := acting & ~episode.acted[-1]).any():
        raise ValueError(
            f"{names[joined.argmax()]!r} acts in step {len(episode)} of an episode and not in the step before; agents "
            "may leave before the others, but not join later: let it be there from the reset on, and mask its actions"
        )
    return acting


def _number(agent: str, reward: Any) -> float:
    """Return an agent's reward.

    Raises:
        ValueError: it is not one number.
    """
    try:
        return float(np.asarray(reward).item())
    except (TypeError, ValueError) as error:
        raise ValueError(f"the reward of {agent!r} is {reward!r}; return one number for each agent") from error


def _first_action(counts: Counts) -> Any:
    """Return the action that stands for none."""
    return as_action(as_row(0, counts, 0), counts)


def _look(
    interface: LearnerInterface, episode: Episode, env: Any, observations: dict[str, Any], infos: dict[str, Any]
) -> None:
    episode.observations.append(
        {
            name: interface.observed(name, observations[name]) if name in observations else zeros(space)
            for name, space in interface.observations.items()
        }
    )
    episode.states.append(interface.state(env, observations))
    episode.action_mask.append({name: mask_of(name, infos, counts) for name, counts in interface.actions.items()})
    episode.info = infos
