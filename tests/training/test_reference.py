"""Games from elsewhere: all learners have settings for them, and they pay as published results are given."""

import importlib.util
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chmarl_pb.errors import MissingExtraError
from training.reference import GAMES, SETTINGS, config_of, main, table

_WRITES = {"log_interval", "checkpoint_interval"}  # how often a run writes changes nothing of it
HERE = all(importlib.util.find_spec(name) for name in ("mpe2", "lbforaging"))
needs_games = pytest.mark.skipif(not HERE, reason="pip install mpe2 lbforaging")


@pytest.mark.parametrize("game", GAMES)
@pytest.mark.parametrize("algorithm", SETTINGS)
def test_every_learner_has_settings_for_every_game(game: str, algorithm: str) -> None:
    config = config_of(algorithm, game, 50_000, 3)
    assert config.seed == 3 and config.episodes * GAMES[game].horizon <= 50_000


@pytest.mark.parametrize("game", ["simple_spread", "foraging"])
def test_a_game_that_is_not_installed_is_named(game: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("mpe2", "lbforaging"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtraError, match="run `pip install mpe2 lbforaging`"):
        GAMES[game].make()


@pytest.mark.parametrize(
    "game", [pytest.param(game, marks=[] if game == "household" else needs_games) for game in GAMES]
)
def test_random_actions_earn_what_the_table_says(game: str) -> None:
    env, rng, returns = GAMES[game].make(), np.random.default_rng(0), []
    for seed in range(20):
        env.reset(seed=seed)
        returns.append(0.0)
        for _ in range(GAMES[game].horizon):
            _, rewards, *_ = env.step({name: int(rng.integers(env.action_space(name).n)) for name in env.agents})
            assert len(set(rewards.values())) == 1, "the team is paid as one"
            returns[-1] += next(iter(rewards.values()))
            if not env.agents:
                break
        assert not env.agents
    env.close()
    spread = {"simple_spread": 25, "foraging": 0.1, "household": 1.5}[game]
    assert np.mean(returns) == pytest.approx(GAMES[game].random, abs=spread)


@needs_games
def test_simple_spread_is_that_of_mpe2_with_the_papers_rewards() -> None:
    from mpe2 import simple_spread_v3

    ours, theirs = GAMES["simple_spread"].make(), simple_spread_v3.parallel_env(N=3, local_ratio=0.5, max_cycles=25)
    rng = np.random.default_rng(0)
    for seed in range(3):
        seen, wanted = ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0]
        while ours.agents:
            assert all(np.array_equal(seen[name], wanted[name]) for name in ours.agents)
            actions = {name: int(rng.integers(5)) for name in ours.agents}
            seen, rewards, ended, cut, _ = ours.step(actions)
            wanted, halves, *ends, _ = theirs.step(actions)
            assert [ended, cut] == ends
            # theirs is half of the distances and of the collisions with others; the paper's agents collide with
            # themselves, too
            assert rewards["agent_0"] == pytest.approx(sum(2 * half - 1 for half in halves.values()))
        assert not theirs.agents


@needs_games
def test_the_command_keeps_runs_and_makes_those_that_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("training.reference.VALIDATED", 2)
    command = ["--game", "simple_spread", "--algo", "pqn", "--steps", "800", "--json", "kept.json", "--seeds"]
    assert main([*command, "1"]) == 0
    kept = json.loads(Path("kept.json").read_text())
    assert kept[0]["curve"]["steps"] == [400, 800] and -600 < kept[0]["last"] <= kept[0]["best"] < 0
    assert main([*command, "2"]) == 0
    both = json.loads(Path("kept.json").read_text())
    assert both[0] == kept[0] and both[1]["seed"] == 1


def test_commands_with_one_file_keep_each_others_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, kept = tmp_path / "kept.json", json.loads(Path("results/reference.json").read_text())[:2]

    def measure(*_: object) -> dict[str, Any]:
        path.write_text(json.dumps([kept[1]]))  # another command ends meanwhile
        return {**kept[0], "game": "foraging", "algorithm": "pqn", "steps": 800, "seed": 0}

    monkeypatch.setattr("training.reference.measure", measure)
    command = ["--game", "foraging", "--algo", "pqn", "--steps", "800", "--seeds", "1", "--json", str(path)]
    assert main(command) == 0 and "| foraging | pqn | 800 |" in capsys.readouterr().out
    assert [run["game"] for run in json.loads(path.read_text())] == [kept[1]["game"], "foraging"]
    assert main(command) == 0 and "| foraging | pqn | 800 |" in capsys.readouterr().out, "of kept runs, too"


def test_a_run_of_fewer_steps_than_are_played_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--game", "foraging", "--steps", "799"]) == 2
    assert "--steps 799: foraging needs at least 800" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "words"),
    [("{", "not a file of runs"), ('[{"game": "chess"}]', "a run without"), ('{"a": 1}', "not a file of runs")],
)
def test_foreign_files_of_runs_are_refused(
    content: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "runs.json"
    path.write_text(content)
    assert main(["--json", str(path)]) == 2 and words in capsys.readouterr().err
    assert path.read_text() == content


def test_the_table_in_the_documentation_is_that_of_the_runs() -> None:
    runs = json.loads(Path("results/reference.json").read_text())
    page = Path("docs/training_findings.md").read_text()
    assert "\n".join(["<!-- reference -->", *table(runs), "<!-- end of reference -->"]) in page


def test_kept_runs_have_the_settings_of_today() -> None:
    for run in json.loads(Path("results/reference.json").read_text()):
        config = config_of(run["algorithm"], run["game"], run["steps"], run["seed"])
        for name, value in asdict(config).items():
            if name not in _WRITES:
                assert run["settings"].get(name, getattr(type(config), name, None)) == value, name
