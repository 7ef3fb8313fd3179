"""``render()``: a frame of the demo's film, from every view of the environment, and for those who record."""

from pathlib import Path
from typing import Any

import gymnasium
import imageio_ffmpeg
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo, RenderCollection

import chmarl_pb
from chmarl_pb.envs import frame as envs_frame
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.frames.panel import COLUMNS, HEIGHT, PICTURE_TOP, WIDTH

SHAPE = (HEIGHT, WIDTH, 3)
VIEW = 400  # pixels
ALONE = "CHMARL/SceneGraphHumanoid-v1"


def stay(env: chmarl_pb.HouseholdEnv) -> dict[str, int]:
    return {robot: names.index("stay") for robot, names in env.action_names.items()}


@pytest.fixture(scope="module")
def env() -> Any:
    env = chmarl_pb.parallel_env(render_mode="rgb_array", split="test-unseen")
    yield env
    env.close()


def test_robots_of_ones_own_are_named_by_their_class() -> None:
    robots = ("humanoid", "drone", "examples/scout/scout.toml")
    env = chmarl_pb.parallel_env(robots=robots, render_mode="rgb_array", split="val-unseen", max_steps=28)
    env.reset(seed=0)
    env.action_space("drone").seed(0)
    seen = False
    while env.agents and not seen:
        _, _, _, _, infos = env.step({name: env.action_space(name).sample() for name in env.agents})
        seen = any("scout" in info["visible"] for info in infos.values())
    assert seen and env.render() is not None
    env.close()


def frame_of(env: Any) -> np.ndarray:
    frame = env.render()
    assert frame is not None and frame.shape == SHAPE and frame.dtype == np.uint8
    return np.asarray(frame)


def test_the_views_are_the_cameras(env: chmarl_pb.HouseholdEnv) -> None:
    env.reset(options={"task": "test-unseen-007"})
    frame = frame_of(env)
    inner = slice(12, VIEW - 12)  # corners are rounded
    for robot, left in zip(env.possible_agents, COLUMNS, strict=False):
        shown = frame[PICTURE_TOP : PICTURE_TOP + VIEW, left : left + VIEW]
        np.testing.assert_array_equal(shown[inner, inner], env.simulation.renderer.image(robot, VIEW)[inner, inner])


def test_a_step_has_one_frame_and_the_next_another(env: chmarl_pb.HouseholdEnv) -> None:
    env.reset(options={"task": "test-unseen-007"})
    start = frame_of(env)
    start[:] = 0  # the caller's own
    first = frame_of(env)
    np.testing.assert_array_equal(first, frame_of(env))
    env.step(stay(env))
    assert (first != frame_of(env)).any() and first.std() > 10
    env.reset(options={"task": "test-unseen-007"})
    np.testing.assert_array_equal(first, frame_of(env))


def test_nothing_is_drawn_before_it_is_asked_for(env: chmarl_pb.HouseholdEnv, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*given: object) -> None:
        raise AssertionError("drawn")

    monkeypatch.setattr(envs_frame, "drawer_of", refuse)
    env.reset(seed=0)
    env.step(stay(env))
    with pytest.raises(AssertionError, match="drawn"):
        env.render()


@pytest.mark.parametrize(
    "options",
    [{"robots": ("drone",) * 2 + ("humanoid",)}, {"robots": ("humanoid",)}, {"track": "grounded"},
     {"messages": False}],
    ids=str,
)  # fmt: skip
def test_teams_and_rules(options: dict[str, Any]) -> None:
    env = chmarl_pb.parallel_env(render_mode="rgb_array", **{"split": "val-unseen"} | options)
    env.reset(seed=0)
    env.step({robot: np.zeros_like(env.action_space(robot).sample()) for robot in env.agents})
    frame_of(env)
    env.close()


def test_several_objects_to_the_end() -> None:
    env = chmarl_pb.parallel_env(render_mode="rgb_array", split="val-unseen", task="tidy")
    frames: list[np.ndarray] = []
    episode = chmarl_pb.rollout(
        env, chmarl_pb.make_policy("planner", env), seed=0, on_step=lambda env: frames.append(frame_of(env))
    )
    assert episode.success and len({frame.tobytes() for frame in frames}) == len(episode) + 1
    env.close()


def test_the_view_of_turns() -> None:
    env = chmarl_pb.env(render_mode="rgb_array", split="val-unseen")
    env.reset(seed=0)
    frame_of(env)
    assert env.metadata["render_modes"] == ["rgb_array", "human"]
    env.close()


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_ids_say_what_they_can(env_id: str) -> None:
    entry: Any = gymnasium.spec(env_id)
    make = entry.entry_point
    module, _, name = str(make).partition(":")
    found = getattr(__import__(module, fromlist=[name]), name)
    assert found.metadata["render_modes"] == ["rgb_array", "human"] and found.metadata["render_fps"] > 0


def test_frames_are_collected() -> None:
    env: Any = RenderCollection(gymnasium.make(ALONE, render_mode="rgb_array", split="val-unseen"))
    assert env.render_mode == "rgb_array_list"
    env.reset(seed=0)
    env.step(0)
    assert [frame.shape for frame in env.render()] == [SHAPE] * 2
    env.close()


def test_vectors_render_each_environment() -> None:
    envs = gymnasium.make_vec(ALONE, 2, render_mode="rgb_array", split="val-unseen", workers=1)
    envs.reset(seed=0)
    frames: Any = envs.render()
    assert [frame.shape for frame in frames] == [SHAPE] * 2 and (frames[0] != frames[1]).any()
    envs.close()


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_gymnasium_records_a_video(tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    made = gymnasium.make(ALONE, render_mode="rgb_array", split="val-unseen", max_steps=2)
    env: Any = RecordVideo(made, str(tmp_path), name_prefix="episode")
    env.reset(seed=0)
    for _ in range(2):
        env.step(0)
    env.close()
    (video,) = tmp_path.glob("*.mp4")
    assert imageio_ffmpeg.count_frames_and_secs(str(video))[0] == 3
