"""The simulators that are compared: each is an endless stream of what it does in a second."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np

from chmarl_pb.bench.playing import SPLIT, Effort, per_second, steps

OURS = "chmarl_pb"
_DRONES = "git+https://github.com/learnsyslab/gym-pybullet-drones"


@dataclass(frozen=True)
class Work:
    """What one simulator is to do.

    Attributes:
        size: width and height of its pictures in pixels, or None for no pictures.
        effort: runs and seconds.
    """

    size: int | None
    effort: Effort


@dataclass(frozen=True)
class Peer:
    """A simulator.

    Attributes:
        name: of its rows.
        measure: work -> endless stream of what it does in a second: frames, or steps where there are no pictures.
        symbolic: whether it is measured without pictures.
        visual: whether it is measured with pictures.
        install: how to get it.
    """

    name: str
    measure: Callable[[Work], Iterator[float]]
    symbolic: bool
    visual: bool
    install: str = ""


def ours(work: Work) -> Iterator[float]:
    """Joint steps of both robots; of pictures two in each step."""
    if work.size is None:
        return (sample["joint steps/s"] for sample in steps(work.effort, "scene_graph"))
    return (sample["frames/s"] for sample in steps(work.effort, "visual", work.size))


def plain_tiny_renderer(work: Work) -> Iterator[float]:
    """Nothing but full TinyRenderer pictures of our home with its objects, from both cameras in turn."""
    from chmarl_pb.bench.fresh import plain_picture

    size = work.size
    assert size is not None, "it does nothing but pictures"
    env, rng = _household(), np.random.default_rng(1)
    robots = cycle(env.simulation.robots.items())

    def draw() -> None:
        name, robot = next(robots)
        robot.spawn(int(rng.integers(robot.lattice.count)))
        plain_picture(env, name, size)

    return _rates(draw, work)


def mujoco_boxes(work: Work) -> Iterator[float]:
    """Nothing but MuJoCo's software OpenGL pictures of the collision boxes of our home, from the humanoid's camera."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco

    from benchmarks.home_boxes import mjcf

    env, rng = _household(), np.random.default_rng(1)
    robot = env.simulation.oracle.robot
    model = mujoco.MjModel.from_xml_string(mjcf(env, robot.model.camera.fov))
    data, renderer = mujoco.MjData(model), mujoco.Renderer(model, work.size, work.size)

    def draw() -> Any:
        position, (x, y, z, w) = robot.model.eye(robot.space, int(rng.integers(robot.lattice.count)))
        data.mocap_pos[0] = position
        # Our camera looks along x with z up, MuJoCo's along -z with y up.
        mujoco.mju_mulQuat(data.mocap_quat[0], [w, x, y, z], [0.5, 0.5, -0.5, -0.5])
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        renderer.update_scene(data, "eye")
        return renderer.render()

    return _rates(draw, work)


def panda_gym(work: Work) -> Iterator[float]:
    """Pick and place with a Panda arm; pictures by its own render(), which is TinyRenderer."""
    import gymnasium
    import panda_gym  # noqa: F401

    size = work.size or 64
    env = gymnasium.make(
        "PandaPickAndPlace-v3", render_mode="rgb_array", renderer="Tiny", render_width=size, render_height=size
    )
    return _gymnasium(env, work, env.render if work.size else lambda: None)


def gym_pybullet_drones(work: Work) -> Iterator[float]:
    """One drone that hovers over four landmarks; pictures are its observation (TinyRenderer)."""
    from gym_pybullet_drones.envs.HoverAviary import HoverAviary
    from gym_pybullet_drones.utils.enums import ObservationType

    if work.size is None:
        return _gymnasium(HoverAviary(), work)
    env = HoverAviary(obs=ObservationType.RGB, ctrl_freq=24)  # a picture in every step
    env.IMG_RES = np.array([work.size, work.size])
    env.rgb = np.zeros((1, work.size, work.size, 4))
    env.dep, env.seg = env.rgb[..., 0].copy(), env.rgb[..., 0].copy()
    return _gymnasium(env, work)


def miniworld(work: Work) -> Iterator[float]:
    """Four rooms in OpenGL; in software where there is no GPU, and without a display."""
    import pyglet

    pyglet.options["headless"] = "DISPLAY" not in os.environ
    import gymnasium
    import miniworld  # noqa: F401

    env = gymnasium.make("MiniWorld-FourRooms-v0", obs_width=work.size, obs_height=work.size)
    return _gymnasium(env, work)


def minigrid(work: Work) -> Iterator[float]:
    """Four rooms as a grid of symbols."""
    import gymnasium
    import minigrid  # noqa: F401

    return _gymnasium(gymnasium.make("MiniGrid-FourRooms-v0"), work)


def mpe2(work: Work) -> Iterator[float]:
    """Three agents that spread over three landmarks; one step moves all."""
    from mpe2 import simple_spread_v3

    env = simple_spread_v3.parallel_env()
    env.reset(seed=0)

    def step() -> None:
        if not env.agents:
            env.reset()
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})

    return _rates(step, work)


PEERS = (
    Peer(OURS, ours, symbolic=True, visual=True),
    Peer("plain TinyRenderer, our home", plain_tiny_renderer, symbolic=False, visual=True),
    Peer("MuJoCo, boxes of our home", mujoco_boxes, symbolic=False, visual=True, install="mujoco"),
    Peer("MiniWorld FourRooms", miniworld, symbolic=False, visual=True, install="miniworld"),
    Peer("panda-gym PickAndPlace", panda_gym, symbolic=True, visual=True, install="panda-gym"),
    Peer("gym-pybullet-drones Hover", gym_pybullet_drones, symbolic=True, visual=True, install=f"--no-deps {_DRONES}"),
    Peer("Minigrid FourRooms", minigrid, symbolic=True, visual=False, install="minigrid"),
    Peer("mpe2 simple_spread", mpe2, symbolic=True, visual=False, install="mpe2"),
)


def _household() -> Any:
    from chmarl_pb.envs.parallel import HouseholdEnv

    env = HouseholdEnv(split=SPLIT)
    env.reset(seed=0)
    return env


def _gymnasium(env: Any, work: Work, also: Callable[[], object] = lambda: None) -> Iterator[float]:
    """Yield steps of random actions in a second; ``also`` is called after every step."""
    env.action_space.seed(1)
    env.reset(seed=1)

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        also()
        if terminated or truncated:
            env.reset()

    return _rates(step, work)


def _rates(work_once: Callable[[], object], work: Work) -> Iterator[float]:
    work_once()
    while True:
        yield per_second(work_once, work.effort.seconds)
