"""The demo: its video decodes, its page stands alone, its pictures are those of the robots' cameras."""

import re
import subprocess
from dataclasses import replace
from io import StringIO
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pybullet
import pytest
from rich.console import Console

from chmarl_pb.cli.demo import demo, write_files
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError, TaskError
from chmarl_pb.frames.motion_player import Replay, Scene, scene_during, scene_of
from chmarl_pb.frames.panel import HEIGHT, WIDTH
from chmarl_pb.frames.recording import Recording
from chmarl_pb.homes.home import load_home
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.progress import LateProgress
from chmarl_pb.rendering.movables import team_in
from chmarl_pb.rendering.plan_view import draw_plan
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.viewer.film import LONGEST, SLOWEST, Shot, speed, storyboard
from chmarl_pb.viewer.record import choose_task, record
from chmarl_pb.viewer.table import print_table


@pytest.fixture(scope="module")
def recording() -> Recording:
    task = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)
    return record(task, "scene_graph")


@pytest.fixture(scope="module")
def shots(recording: Recording) -> list[Shot]:
    """A handful: every step's end, and two shots of the first step's motion."""
    board = storyboard(recording)
    return [board[0], *board[1:30:20], *(replace(shot, frames=3) for shot in board[1:] if shot.done)]


@pytest.fixture(scope="module")
def folder(recording: Recording, shots: list[Shot], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("demo")
    write_files(recording, shots, folder, LateProgress(disable=True))
    return folder


def test_video_is_h264_of_the_right_length_and_size(folder: Path, shots: list[Shot]) -> None:
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(folder / "demo.mp4"))
    assert frames == sum(shot.frames for shot in shots)
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", str(folder / "demo.mp4")]
    known = subprocess.run(command, capture_output=True, text=True, check=False).stderr
    assert "h264" in known and "yuv420p" in known and f"{WIDTH}x{HEIGHT}" in known and "30 fps" in known


def test_video_starts_with_its_index(folder: Path) -> None:
    data = (folder / "demo.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_page_needs_nothing_else(folder: Path) -> None:
    page = (folder / "demo.html").read_text(encoding="utf-8")
    sources = re.findall(r'(?:src|href)="([^"]*)"', page) + re.findall(r"url\(([^)]*)\)", page)
    assert sources and all(source.startswith(("data:", "#")) for source in sources)
    assert "http:" not in page and "https:" not in page and "$" not in re.sub(r"base64,[A-Za-z0-9+/=]+", "", page)
    assert len(page) < 8e6


def test_page_has_every_step(folder: Path, recording: Recording) -> None:
    page = (folder / "demo.html").read_text(encoding="utf-8")
    for kind in ("step", "row", "dot"):
        numbers = re.findall(rf'id="{kind}-(\d+)"', page)
        assert numbers == [str(number) for number in range(recording.steps + 1)]
    assert recording.instruction in page and page.count("data:image/jpeg") == 2 * (recording.steps + 1)


def test_other_robots_are_shown_too(tmp_path: Path) -> None:
    """The film shows the first two robots and a map of all, the page all; each has its name and its colour."""
    task = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)
    recording = record(task, "scene_graph", robots=("humanoid", "humanoid", "drone"))
    board = [shot for shot in storyboard(recording) if shot.done]
    write_files(recording, board, tmp_path, LateProgress(disable=True))
    assert recording.success and recording.optimum and recording.optimum.steps <= recording.steps
    page = (tmp_path / "demo.html").read_text(encoding="utf-8")
    assert page.count("data:image/jpeg") == 3 * (recording.steps + 1)
    for place, name in enumerate(("Humanoid 0", "Humanoid 1", "Drone")):
        assert page.count(f'r{place}"><h3>{name}</h3>') == recording.steps + 1 and f"<th>{name}</th>" in page
    assert page.count('class="field cone') == 2 * (recording.steps + 1)
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "demo.mp4"))
    assert frames == sum(shot.frames for shot in board)


def test_no_temporary_files_are_left(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["demo.html", "demo.mp4"]


def test_recording_tells_the_episode(recording: Recording) -> None:
    assert recording.success and recording.steps == recording.task.optimal_steps
    first, *others = recording.moments
    assert first.actions == {} and first.motion == ()
    assert all(set(moment.actions) == set(recording.models) and moment.motion for moment in others)
    potentials = [moment.potential for moment in recording.moments]
    assert np.allclose(np.diff(potentials), [moment.reward for moment in others])


def test_storyboard_pauses_once_a_step(recording: Recording) -> None:
    board = storyboard(recording)
    assert [shot.step for shot in board if shot.done] == list(range(recording.steps + 1))
    assert all(shot.frames == 1 for shot in board if not shot.done)
    assert [shot.step for shot in board] == sorted(shot.step for shot in board)


@pytest.mark.parametrize("times", [4, 12])
def test_long_episodes_are_shown_faster(recording: Recording, times: int) -> None:
    start, *moments = recording.moments
    long = replace(recording, moments=(start, *moments * times))
    board = storyboard(long)
    assert speed(recording) >= SLOWEST and speed(long) > SLOWEST
    resting = sum(shot.frames for shot in board if shot.done)
    moving = [shot for shot in board if not shot.done]
    assert {shot.step for shot in moving} == set(range(1, long.steps + 1)), "a step without motion"
    assert len(moving) <= max(LONGEST - resting, 5 * long.steps) + long.steps, "a motion has one frame at least"


def test_table_names_every_step(recording: Recording) -> None:
    console = Console(record=True, width=160, file=StringIO())
    print_table(recording, console)
    known = console.export_text()
    rows = [line.split() for line in known.splitlines() if line.strip()[:1].isdigit()]
    assert recording.instruction in known
    assert [row[0] for row in rows] == [str(step) for step in range(recording.steps + 1)]
    assert "Solved in" in known


def test_pictures_at_rest_are_those_of_the_cameras(recording: Recording) -> None:
    env = HouseholdEnv(home=recording.task.home, execution="simulated")
    try:
        policy = make_policy("planner", env)
        observations, infos = env.reset(options={"task": recording.task})
        policy.reset(None)
        replay = Replay(env.simulation.home, team_in(env.world, env.simulation.models))
        while env.agents:
            observations, _, _, _, infos = env.step(policy.act(observations, infos))
            for name in env.possible_agents:
                seen = env.simulation.renderer.picture(name, 160).rgb
                assert np.array_equal(replay.picture(name, scene_of(env.world), 160), seen)
    finally:
        env.close()


def test_the_camera_rides_on_the_robot(recording: Recording) -> None:
    env = HouseholdEnv(home=recording.task.home, execution="simulated")
    try:
        env.reset(options={"task": recording.task})
        goto = {name: env.action_names[name].index("goto_bathroom") for name in env.possible_agents}
        env.step(goto)
        rest = scene_of(env.world)
        for snapshot in env.snapshots[:: max(1, len(env.snapshots) // 5)]:
            scene = scene_during(snapshot, rest)
            for name in env.possible_agents:
                _check_eye(env, scene, name)
    finally:
        env.close()


def _check_eye(env: HouseholdEnv, scene: Scene, name: str) -> None:
    client, body = env.world.client, env.world.bodies[name]
    env.world.physics.move_robot(name, scene.robots[name])
    env.world.physics.set_joints(name, scene.joints[name])
    links = range(pybullet.getNumJoints(body, physicsClientId=client))
    camera = next(i for i in links if pybullet.getJointInfo(body, i, physicsClientId=client)[12] == b"camera")
    state = pybullet.getLinkState(body, camera, computeForwardKinematics=True, physicsClientId=client)
    position, quaternion = scene.eye(name, env.simulation.models[name])
    assert np.allclose(state[4], position, atol=1e-4)
    assert abs(np.dot(state[5], quaternion)) == pytest.approx(1, abs=1e-4)


def test_plan_ties_pixels_to_metres() -> None:
    plan = draw_plan(load_home("home_7"), 300, 300)
    assert max(plan.rgb.shape[:2]) in (299, 300)
    low, high = load_home("home_7").bounds
    left, bottom = plan.pixel(*low)
    right, top = plan.pixel(*high)
    assert 0 < left < right < plan.rgb.shape[1] and 0 < top < bottom < plan.rgb.shape[0]
    assert right - left == pytest.approx((high - low)[0] * plan.scale)


def test_default_task_leads_through_two_rooms() -> None:
    task = choose_task()
    assert task.id.startswith("test-unseen-")
    things = load_home(task.home).receptacles.values()
    rooms = [{thing.room for thing in things if thing.class_name == name} for name in (task.source, task.target)]
    assert rooms[0].isdisjoint(rooms[1])


def test_bad_input_is_told(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="unknown task 'nowhere-001'"):
        demo("nowhere-001", "scene_graph", tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(OptionError, match="cannot write here"):
        demo(None, "scene_graph", tmp_path / "file" / "out")
    with pytest.raises(OptionError, match="unknown policy"):
        demo(None, "scene_graph", tmp_path, policy="nobody")
    with pytest.raises(OptionError, match="observation"):
        demo(None, "smell", tmp_path)
