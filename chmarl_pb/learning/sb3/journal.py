"""Where a run of Stable-Baselines3 is, beside its weights: counters, random streams, episodes, the replay buffer.

SB3 saves neither its random streams nor the episodes that are being played. Environments are functions of their seeds
and actions, so the actions since they were last seeded are all that is needed to bring them back.
"""

import json
from collections import deque
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnvWrapper

#: Of SB3's algorithms, where they have them: all that weights and the replay buffer do not hold.
_COUNTERS = ("num_timesteps", "exploration_rate", "_n_updates", "_n_calls", "_episode_num")


class Journal(VecEnvWrapper):
    """Environments that remember all actions since they were last reset.

    Attributes:
        actions: of all environments, step by step.
    """

    actions: list[np.ndarray]

    def reset(self) -> Any:
        """Reset all environments."""
        self.actions = []
        return self.venv.reset()

    def step_async(self, actions: np.ndarray) -> None:
        """Begin a step."""
        self.actions.append(np.array(actions))
        self.venv.step_async(actions)

    def step_wait(self) -> Any:
        """Return what came of the step."""
        return self.venv.step_wait()

    def play_again(self, model: BaseAlgorithm, actions: np.ndarray) -> None:
        """Bring environments that were just reset to where they were after some actions (steps, environments, ...)."""
        env: Any = model.get_env()
        for action in actions:
            model._last_obs, _, model._last_episode_starts, _ = env.step(action)


def counters(model: BaseAlgorithm) -> dict[str, Any]:
    """Return the counters of an algorithm."""
    return {name: getattr(model, name) for name in _COUNTERS if hasattr(model, name)}


def moment(model: Any) -> dict[str, Any]:
    """Return where a model is between two rollouts, in plain types and tensors."""
    _, key, place, has_normal, normal = np.random.get_state(legacy=True)  # noqa: NPY002 (SB3 draws from it)
    memory = getattr(model, "_last_lstm_states", None)
    return {
        "counters": counters(model),
        "torch": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state(model.device) if model.device.type == "cuda" else None,
        "numpy": [torch.from_numpy(np.asarray(key, dtype=np.int64)), int(place), int(has_normal), float(normal)],
        "space": json.dumps(model.action_space.np_random.bit_generator.state),
        "infos": [{"r": float(info["r"]), "l": int(info["l"])} for info in model.ep_info_buffer or ()],
        "successes": [float(success) for success in model.ep_success_buffer or ()],
        "memory": None if memory is None else [list(part) for part in memory],
        "log": [
            [name, float(value), int(model.logger.name_to_count[name])]
            for name, value in list(model.logger.name_to_value.items())
            if isinstance(value, int | float | np.number)
        ],
    }


def go_back(model: Any, kept: dict[str, Any]) -> None:
    """Bring a model, whose environments are where they were, back to a moment; but for its log."""
    torch.set_rng_state(kept["torch"])
    if kept.get("cuda") is not None and model.device.type == "cuda":
        torch.cuda.set_rng_state(kept["cuda"], model.device)
    key, *rest = kept["numpy"]
    np.random.set_state(("MT19937", key.numpy().astype(np.uint32), *rest))  # noqa: NPY002
    model.action_space.np_random.bit_generator.state = json.loads(kept["space"])
    infos = [{"r": np.float32(info["r"]), "l": info["l"]} for info in kept["infos"]]  # SB3 means them in float32
    for name, values in (("ep_info_buffer", infos), ("ep_success_buffer", kept["successes"])):
        setattr(model, name, deque(values, maxlen=model._stats_window_size))
    if kept["memory"] is not None:
        memory = ([part.to(model.device) for part in parts] for parts in kept["memory"])
        model._last_lstm_states = type(model._last_lstm_states)(*map(tuple, memory))


def buffer_content(buffer: Any) -> dict[str, Any]:
    """Return what is in a replay buffer, as tensors; {} if there is no buffer."""
    if buffer is None:
        return {}
    end = buffer.buffer_size if buffer.full else buffer.pos
    cut = {name: _cut(value, end) for name, value in vars(buffer).items() if _cut(value, end) is not None}
    return {"pos": buffer.pos, "full": buffer.full, "arrays": cut}


def _cut(value: Any, end: int) -> Any:
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value[:end])
    if isinstance(value, dict) and value and all(isinstance(part, np.ndarray) for part in value.values()):
        return {key: torch.from_numpy(part[:end]) for key, part in value.items()}
    return None


def fill_buffer(buffer: Any, content: dict[str, Any]) -> None:
    """Put back what was in a replay buffer."""
    if buffer is None or not content:
        return
    buffer.pos, buffer.full = content["pos"], content["full"]
    for name, kept in content["arrays"].items():
        own = getattr(buffer, name)
        for target, source in [(own[key], kept[key]) for key in kept] if isinstance(kept, dict) else [(own, kept)]:
            target[: len(source)] = source.numpy()
