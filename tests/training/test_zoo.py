"""The settings for RL Baselines3 Zoo are those of the presets."""

import json

import pytest
from gymnasium import spaces

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
from chmarl_pb.learning.sb3.config import AlgorithmName, Config
from training.sb3 import zoo


@pytest.mark.parametrize("algo", zoo.NAMES)
def test_files_are_those_of_the_presets(algo: AlgorithmName) -> None:
    """``python -m training.sb3.zoo`` writes them."""
    text = (zoo.FOLDER / f"{zoo.NAMES[algo]}.yml").read_text(encoding="utf-8")
    assert text == zoo.text_of(algo)
    for env_id, entry in zip(zoo.ENV_IDS, text.split("\n\n")[1:], strict=True):
        head, *lines = entry.strip().splitlines()
        given = {key.strip(): json.loads(value) for key, value in (line.split(":", 1) for line in lines)}
        config = Config(algo, env_id)
        settings = config.settings(spaces.Box(0, 1, (1,)))
        assert head == f"{env_id}:" and {key: given[key] for key in settings} == settings
        assert given["n_envs"] == config.envs and given["env_kwargs"]["goal"]
        assert "GoalFeatures" in given["policy_kwargs"]
