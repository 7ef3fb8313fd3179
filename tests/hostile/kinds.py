"""Kinds of files that strangers may send: valid ones to begin with, and what reads them."""

import io
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from chmarl_pb.assets import SCENES_DIR
from tests.helpers import own_robots, own_things
from tests.helpers.hostile_homes import CUBE, ascii_stl, dae, link, shape, stl
from tests.helpers.small_homes import home_text
from tests.hostile import mutations
from tests.hostile.mutations import BINARY, TEXT, Mutation

Files = dict[str, bytes]


@dataclass(frozen=True)
class Kind:
    """One kind of files.

    Attributes:
        files: makes the valid ones, in one or several folders: each a name -> content.
        mutated: which of them are mutated.
        mutations: what is done to them.
        load: reads the files of a folder as a user would.
        use: the same, and more that takes its time, for a part of the cases.
    """

    files: Callable[[], list[Files]]
    mutated: tuple[str, ...]
    mutations: tuple[Mutation, ...]
    load: Callable[[Path], object]
    use: Callable[[Path], object] | None = None


# Homes

MTL = b"newmtl m\nKd 0.5 0.25 1\nmap_Kd t.png\nnewmtl n\nKd 1 0 0\n"


def _picture(kind: str, mode: str = "RGB") -> bytes:
    file = io.BytesIO()
    pixels = np.random.default_rng(0).integers(0, 255, (16, 16, 3), np.uint8)
    Image.fromarray(pixels).convert(mode).save(file, kind)
    return file.getvalue()


def _home(geometry: str = '<mesh filename="m.obj" scale="1 1 1"/>', **files: bytes | str) -> Files:
    coloured = '<material name="red"><color rgba="0.8 0.1 0.1 1"/></material>'
    parts = shape(geometry).replace("</visual>", f"{coloured}</visual>") + shape(geometry, "collision")
    text = home_text(extra=link(parts) + link(shape('<cylinder radius="0.1" length="0.5"/>'), "livingroom/lamp_1"))
    given = {name.replace("__", "."): content for name, content in files.items()}
    contents = {"home.urdf": text, "m.obj": CUBE, **given}
    return {name: content.encode() if isinstance(content, str) else content for name, content in contents.items()}


def _obj() -> str:
    points = "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n"
    return f"mtllib a.mtl\n{points}usemtl m\n{CUBE}f 1/1/1 2/2/1 3/3/1\nf -1 -2 -3\nusemtl n\nf 1 2 3 4\n"


def _homes_with(name: str, *contents: bytes | str) -> Callable[[], list[Files]]:
    mesh = f'<mesh filename="{name}"/>'
    others = {"a__mtl": MTL, "t__png": _picture("PNG")}
    return lambda: [_home(mesh, **{name.replace(".", "__"): content, **others}) for content in contents]


def _load_home(folder: Path) -> None:
    from chmarl_pb.homes.home import load_home
    from chmarl_pb.world import World

    World(load_home(folder / "home.urdf")).close()


def play_home(folder: Path) -> None:
    """Look about in a home and make a step."""
    import chmarl_pb

    env = chmarl_pb.parallel_env(observation="visual", home=str(folder / "home.urdf"), image_size=32)
    env.reset(seed=0)
    env.step(dict.fromkeys(env.agents, 0))
    env.close()


def _layouts() -> list[Files]:
    names = ("home_1", "home_6")
    return [{"home.toml": (SCENES_DIR / f"{name}.toml").read_bytes()} for name in names]


def _build(folder: Path) -> None:
    from chmarl_pb.homes.assemble import build_home

    build_home(folder / "home.toml", folder / "built" / "home.urdf")


# Things, robots


def _things() -> list[Files]:
    return [
        {
            "my_things.toml": own_things.CATALOG.encode(), "crate.urdf": own_things.CRATE.encode(),
            "post.urdf": own_things.POST.encode(), "workbench_oak.urdf": own_things.WORKBENCH.encode(),
        }
    ]  # fmt: skip


def _load_things(folder: Path) -> None:
    from chmarl_pb.homes.catalog_file import load_catalog

    load_catalog(folder / "my_things.toml")


def _robots() -> list[Files]:
    joints = "\n  ".join(own_robots.joint(*row) for row in own_robots.JOINTS)
    mesh = own_robots.CRANE.format(joints=joints).replace(
        '<visual><origin xyz="0 0 0.15"/><geometry><box size="0.36 0.3 0.3"/></geometry></visual>',
        '<visual><geometry><mesh filename="m.obj"/></geometry></visual>',
    )
    files = {"crane.toml": own_robots.CRANE_FILE, "crane.urdf": mesh, "m.obj": _obj(), "a.mtl": "newmtl m\nnewmtl n\n"}
    return [{name: text.encode() for name, text in files.items()}]


def _load_robot(folder: Path) -> None:
    import pybullet

    from chmarl_pb.robots.file import find_model
    from chmarl_pb.robots.plain_robot import plain_robot

    model = find_model(folder / "crane.toml")
    urdf = plain_robot(model.urdf)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.loadURDF(str(urdf), useFixedBase=True, physicsClientId=client)
    except pybullet.error as error:
        from chmarl_pb.errors import AssetError

        raise AssetError(f"{urdf}: {error}") from error


# Tasks, episodes, results


def _tasks() -> list[Files]:
    from chmarl_pb.tasks.splits import FOLDER

    return [{"tasks.csv": (FOLDER / "test-unseen.csv").read_bytes()}]


def _read_tasks(folder: Path) -> None:
    from chmarl_pb.tasks.splits import read_tasks

    read_tasks(folder / "tasks.csv")


def _episodes() -> list[Files]:
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.evaluation.episode_file import record_episode, save_episode
    from chmarl_pb.policies.registry import make_policy
    from chmarl_pb.tasks.splits import load_tasks

    task, path, found = load_tasks("test-unseen")[0], Path("episode.json"), []
    choices: tuple[dict[str, Any], ...] = ({}, {"messages": "symbols", "feedback": False})
    for options in choices:
        env = HouseholdEnv(home=task.home, max_steps=4, **options)
        save_episode(record_episode(env, make_policy("random", env), "random", 5, task), path)
        env.close()
        found.append({path.name: path.read_bytes()})
    return found


def _load_episode(folder: Path) -> None:
    """Load, and replay what is not of another home, team or catalogue: those are named on purpose."""
    from chmarl_pb.evaluation.episode_file import load_episode, replay_episode

    file = load_episode(folder / "episode.json")
    if file.task.home == "home_7" and not {"robots", "catalog"} & set(file.options):
        replay_episode(file)


def _results() -> list[Files]:
    from chmarl_pb.evaluation.protocol import evaluate
    from chmarl_pb.tasks.splits import load_tasks

    path, tasks = Path("result.json"), [task.id for task in load_tasks("test-unseen")[:2]]
    evaluate("random", tasks=tasks, seeds=(0, 1), workers=1, max_steps=3, out=path)
    return [{path.name: path.read_bytes()}]


def _load_result(folder: Path) -> None:
    from chmarl_pb.evaluation.result import load_result

    load_result(folder / "result.json")


def _report(folder: Path) -> None:
    """Read a result, and show it on a page."""
    from chmarl_pb.evaluation.report import page
    from chmarl_pb.evaluation.result import load_result

    report = load_result(folder / "result.json")
    page([report], folder)


def _audits() -> list[Files]:
    from chmarl_pb.evaluation.audit_file import FOLDER

    return [{"audit.json": path.read_bytes()} for path in sorted(FOLDER.glob("*.json"))[:2]]


def _load_audit(folder: Path) -> None:
    from chmarl_pb.evaluation.audit_file import load_audit

    load_audit(folder / "audit.json")


# Checkpoints, views, data sets


def _policies() -> list[Files]:
    from chmarl_pb.assets import WEIGHTS_DIR

    return [{"best.pt": (WEIGHTS_DIR / "ours-graphs.pt").read_bytes()}]


def _load_policy(folder: Path) -> None:
    """Read the weights as an evaluation does, and make the policy of an environment."""
    from chmarl_pb.learning.policies.load import load_policy

    load_policy(folder / "best.pt")(_env())


_kept: dict[str, Any] = {}


def _env() -> Any:
    """An environment that the cases share; it was made before they were forked."""
    from chmarl_pb.envs.parallel import HouseholdEnv

    if "env" not in _kept:
        _kept["env"] = HouseholdEnv(home="home_7")
    return _kept["env"]


def _runs() -> list[Files]:
    from chmarl_pb.learning import train
    from tests.helpers.small_runs import SMALL
    from tests.helpers.uneven_env import UnevenEnv

    train(UnevenEnv, "vdn", SMALL, Path("run"))
    found = [{name: (Path("run") / name).read_bytes() for name in ("last.pt", "best.pt", "metrics.jsonl")}]
    shutil.rmtree("run")
    return found


def _resume(folder: Path) -> None:
    from chmarl_pb.learning import train
    from tests.helpers.small_runs import SMALL
    from tests.helpers.uneven_env import UnevenEnv

    train(UnevenEnv, "vdn", SMALL, folder)


def _models() -> list[Files]:
    from dataclasses import replace
    from unittest.mock import patch

    from chmarl_pb.learning.sb3.config import PRESETS, Config
    from chmarl_pb.learning.sb3.train import BEST, run

    small = {"n_steps": 4, "batch_size": 4, "n_epochs": 1}
    goal = replace(
        PRESETS["goal"], settings={**PRESETS["goal"].settings, "ppo": {**PRESETS["goal"].settings["ppo"], **small}}
    )
    config = Config(
        "ppo", "CHMARL/SceneGraphHumanoid-v0", "goal", steps=4, interval=4, envs=1, tasks=1, max_steps=4, features=8
    )
    with patch.dict(PRESETS, {"goal": goal}):
        run(config, Path("model"), workers=0)
    found = [{"best.zip": (Path("model") / BEST).read_bytes()}]
    shutil.rmtree("model")
    return found


def _load_model(folder: Path) -> None:
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.learning.sb3 import load_policy

    if "goal" not in _kept:
        _kept["goal"] = HouseholdEnv(home="home_7", goal=True)
    load_policy(folder / "best.zip")(_kept["goal"])


def _views() -> list[Files]:
    from dataclasses import fields

    from chmarl_pb.learning.networks.labelled_views import Views

    file, rng = io.BytesIO(), np.random.default_rng(0)
    arrays: dict[str, Any] = {one.name: rng.integers(0, 255, (2, 4), np.uint8) for one in fields(Views)}
    np.savez(file, **arrays)
    return [{"views.npz": file.getvalue()}]


def _read_views(folder: Path) -> None:
    from chmarl_pb.learning.networks.labelled_views import read_views

    read_views([folder / "views.npz"])


def _datasets() -> list[Files]:
    from chmarl_pb.data.generate import generate
    from chmarl_pb.data.recipe import Recipe

    made = generate(Recipe("test-unseen", noise=0.3, limit=1), Path("data"), workers=1)
    files = {f"{made.folder.name}__{path.name}": path.read_bytes() for path in made.main.parent.iterdir()}
    shutil.rmtree("data")
    return [{name.partition("__")[2]: content for name, content in files.items()}]


def _read_dataset(folder: Path) -> None:
    from chmarl_pb.data.read import Dataset
    from chmarl_pb.data.statistics import dataset_statistics

    (folder / "x").mkdir()
    (folder / "x" / "data").symlink_to(folder)
    dataset_statistics(Dataset(folder / "x"))


def kinds(cases: int) -> dict[str, Kind]:
    """Return all kinds; the values that JSON files get are drawn by Hypothesis."""
    json_change = mutations.changed_json(mutations.drawn(mutations.VALUES, max(20, cases)))
    of_json = (*TEXT, mutations.nested, *[json_change] * 8)
    of_toml = (*TEXT, mutations.nested, mutations.quoted, mutations.quoted)
    of_xml = (*TEXT, *[mutations.xml] * 4, *[mutations.numbers] * 4)
    of_zip = (
        mutations.flips,
        mutations.cut,
        mutations.spliced,
        mutations.field,
        mutations.evil,
        *[mutations.archive] * 8,
    )
    stls = (stl(4), ascii_stl().encode())
    return {
        "home": Kind(
            lambda: [_home(a__mtl=MTL, t__png=_picture("PNG"))], ("home.urdf",), of_xml, _load_home, play_home
        ),
        "obj": Kind(_homes_with("m.obj", _obj()), ("m.obj",), TEXT, _load_home, play_home),
        "stl": Kind(_homes_with("m.stl", *stls), ("m.stl",), (*BINARY, *TEXT), _load_home, play_home),
        "dae": Kind(_homes_with("m.dae", dae(), _sample_dae()), ("m.dae",), of_xml, _load_home, play_home),
        "material": Kind(_homes_with("m.obj", _obj()), ("a.mtl",), TEXT, _load_home, play_home),
        "texture": Kind(_textured, ("t.png",), BINARY, _load_home, play_home),
        "layout": Kind(_layouts, ("home.toml",), of_toml, _build),
        "catalogue": Kind(_things, tuple(_things()[0]), (*of_toml, mutations.xml), _load_things),
        "robot": Kind(
            _robots, ("crane.toml", "crane.urdf", "crane.urdf", "m.obj"), (*of_toml, mutations.xml), _load_robot
        ),
        "task": Kind(_tasks, ("tasks.csv",), TEXT, _read_tasks),
        "episode": Kind(_episodes, ("episode.json",), of_json, _load_episode),
        "result": Kind(_results, ("result.json",), of_json, _load_result, _report),
        "audit": Kind(_audits, ("audit.json",), of_json, _load_audit),
        "checkpoint": Kind(_policies, ("best.pt",), of_zip, _load_policy),
        "run": Kind(_runs, ("last.pt", "last.pt", "last.pt", "metrics.jsonl"), of_zip, _resume),
        "sb3": Kind(_models, ("best.zip",), of_zip, _load_model),
        "views": Kind(_views, ("views.npz",), of_zip, _read_views),
        "data set": Kind(
            _datasets, ("main_data.hdf5", "metadata.json"), (*BINARY, *TEXT, mutations.nested), _read_dataset
        ),
    }


def _textured() -> list[Files]:
    kinds_ = (("PNG", "RGB"), ("PNG", "P"), ("JPEG", "RGB"), ("BMP", "RGB"), ("PNG", "RGBA"))
    obj = _obj()
    return [_home(m__obj=obj, a__mtl=MTL, t__png=_picture(*kind)) for kind in kinds_]


def _sample_dae() -> str:
    return dae(node='<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/>')
