"""A home is good if it can be played, and the check and every environment say the same of it."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh

import chmarl_pb
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.check import check_home
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.robots.file import find_model
from chmarl_pb.tasks import planner, verdict
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.verdict import judge
from tests.helpers.small_homes import SMALL_HOME, Boxes, home_text

Write = Callable[..., Path]
EXAMPLES = Path(__file__).parents[2] / "examples"
ROOM = {"livingroom/floor_1": ((6, 6, 0.1), (0, 0, -0.05)), "livingroom/sofa_1": ((1.8, 0.8, 0.45), (0, -1.5, 0.225))}
CEILING = {"livingroom/ceiling_1": ((4, 4, 0.1), (0, 0, 2.6))}
TINY = {
    "livingroom/floor_1": ((2.2, 2.2, 0.1), (0, 0, -0.05)),
    "livingroom/chair_1": ((0.35, 0.35, 0.45), (0.9, 0.9, 0.225)),
    "livingroom/nightstand_1": ((0.35, 0.35, 0.5), (-0.9, -0.9, 0.25)),
}
LONG = {
    "livingroom/floor_1": ((60, 6, 0.1), (0, 0, -0.05)),
    "livingroom/desk_1": ((1.2, 0.6, 0.75), (-28, 0, 0.375)),
    "livingroom/sofa_1": ((1.8, 0.8, 0.45), (28, 0, 0.225)),
}
CROSS = {
    "livingroom/floor_1": ((60, 3.2, 0.1), (0, 0, -0.05)),
    "livingroom/floor_2": ((3.2, 28.4, 0.1), (0, 15.8, -0.05)),
    "livingroom/floor_3": ((3.2, 28.4, 0.1), (0, -15.8, -0.05)),
    "livingroom/desk_1": ((1.2, 0.6, 0.75), (-28, 0, 0.375)),
    "livingroom/sofa_1": ((1.8, 0.8, 0.45), (0, 28, 0.225)),
}


@pytest.fixture(autouse=True)
def forgotten(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Iterator[None]:
    """Let nothing be known of homes tried before."""
    monkeypatch.setattr(verdict, "_here", {})
    yield


def bed(mesh: trimesh.Trimesh, kind: str = "bed.obj") -> str:
    """Return a bed that is one mesh, to be written beside the URDF."""
    shape = f'<geometry><mesh filename="{kind}"/></geometry>'
    return (
        f'<link name="livingroom/bed_1"><visual>{shape}</visual>\n<collision>{shape}</collision></link>\n'
        '<joint name="to_bed" type="fixed"><origin xyz="0 1.5 0"/><parent link="world"/>'
        '<child link="livingroom/bed_1"/></joint>\n'
    )


def boxes(*sizes_and_middles: tuple[tuple[float, ...], tuple[float, ...]]) -> trimesh.Trimesh:
    """Return a mesh of several boxes."""
    parts: list[trimesh.Trimesh] = []
    for size, middle in sizes_and_middles:
        parts.append(trimesh.creation.box(size))
        parts[-1].apply_translation(middle)
    mesh = trimesh.util.concatenate(parts)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


@pytest.mark.parametrize(("thick", "ending"), [(0.05, "obj"), (0.3, "obj"), (0.3, "stl")])
def test_the_top_of_a_concave_mesh_is_the_level_part_of_its_hull(
    write_home: Write, tmp_path: Path, thick: float, ending: str
) -> None:
    mesh = boxes(((1.6, 2.0, 0.5), (0, 0, 0.25)), ((1.6, thick, 1.0), (0, 1.0 - thick / 2, 0.5)))
    mesh.export(tmp_path / f"bed.{ending}", file_type="stl_ascii" if ending == "stl" else None)
    path = write_home(
        home_text({**ROOM, "livingroom/desk_1": ((1.2, 0.6, 0.75), (-2, 0, 0.375))}, bed(mesh, f"bed.{ending}"))
    )
    tops = [surface for surface in space_of(load_home(path)).surfaces if surface.receptacle == "livingroom/bed_1"]
    report = judge(path)
    assert any(problem.link == "livingroom/bed_1" and "hull" in problem.measured for problem in report.warnings)
    if thick < 0.1:  # nothing stands on the edge of the headboard
        assert not tops and [problem.link for problem in report.errors] == ["livingroom/bed_1"]
        return
    (top,) = tops
    free = top.points[top.free > 0]
    assert top.height == pytest.approx(1.0) and (free[:, 1] > 1.5 + 1.0 - thick - 1e-6).all()
    assert not report.errors


def test_what_stands_on_a_top_of_any_convex_shape_rests(write_home: Write, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for number in range(4):
        points = np.concatenate([rng.uniform(-0.9, 0.9, (12, 2)), 0.6 * rng.uniform(-0.9, 0.9, (12, 2))])
        heights = np.repeat([0.0, 0.6], 12)
        mesh = trimesh.Trimesh(np.column_stack([points, heights])).convex_hull
        mesh.export(tmp_path / f"bed{number}.obj")
        extra = bed(mesh, f"bed{number}.obj")
        report = judge(
            write_home(home_text({**ROOM, "livingroom/floor_1": ((8, 8, 0.1), (0, 0, -0.05))}, extra), f"{number}.urdf")
        )
        assert not report.errors, report.errors


def test_a_ceiling_blinds_the_drone(write_home: Write) -> None:
    path = write_home(home_text({**SMALL_HOME, **CEILING}))
    (error,) = judge(path).errors
    assert error.link == "livingroom/ceiling_1" and "drone" in error.measured and "ceiling" in error.fix
    assert not judge(path, ["humanoid"]).errors


@pytest.mark.parametrize(
    "home",
    [
        {**SMALL_HOME, **CEILING},
        {name: SMALL_HOME[name] for name in ("livingroom/floor_1", "livingroom/desk_1")},
        {**SMALL_HOME, "kitchen/floor_1": ((2, 2, 0.1), (5, 0, -0.05))},
        {**SMALL_HOME, "livingroom/bench_1": ((0.4, 0.4, 0.1), (-1.5, 0, 0.05))},
        {**SMALL_HOME, "Livingroom/bench1": ((0.4, 0.4, 0.4), (-1.5, 0, 0.2))},
        {**SMALL_HOME, **{f"livingroom/stool_{n}": ((0.1, 0.1, 0.1), (0, 0, 0.05)) for n in range(70)}},
    ],
    ids=["ceiling", "one receptacle", "unreachable", "too low", "name", "too many"],
)
def test_check_and_environment_agree(write_home: Write, home: Boxes) -> None:
    path = write_home(home_text(home))
    first = str(judge(path).errors[0])
    with pytest.raises(HomeError) as refusal:
        chmarl_pb.parallel_env(home=str(path))
    assert str(refusal.value).startswith(first) and "\n" not in str(refusal.value)


def test_a_tiny_home_gets_fewer_other_objects(write_home: Write) -> None:
    path = write_home(home_text(TINY))
    report = judge(path)
    assert not report.errors and any("other objects" in problem.measured for problem in report.warnings)
    env = chmarl_pb.parallel_env(home=str(path))
    for seed in range(5):
        env.reset(seed=seed)
        assert 1 <= len(env.world.objects) < 19
    env.close()


@pytest.mark.parametrize("home", [pytest.param(LONG, marks=pytest.mark.slow), CROSS], ids=["long", "cross"])
def test_a_sparse_large_home_is_ready_after_few_views(write_home: Write, draws: list[int], home: Boxes) -> None:
    simulation = Simulation(str(write_home(home_text(home))))
    report = check_home(simulation.home.path)
    assert not report.problems
    env = chmarl_pb.envs.parallel.HouseholdEnv(home=str(simulation.home.path))
    draws.clear()
    for seed in range(3):
        env.reset(seed=seed)
    assert len(draws) < 600  # each takes 4 ms; 10,000 were drawn for one reset once
    env.close()
    simulation.close()


def curtain(number: int, size: tuple[float, ...], place: tuple[float, ...]) -> str:
    """Return a link that is seen, but not solid."""
    where, extents = (" ".join(map(str, values)) for values in (place, size))
    name = f"livingroom/curtain_{number}"
    return (
        f'<link name="{name}"><visual><origin xyz="{where}"/><geometry><box size="{extents}"/></geometry></visual>'
        f'</link>\n<joint name="to_{name}" type="fixed"><parent link="world"/><child link="{name}"/></joint>\n'
    )


def test_few_views_are_drawn_of_furniture_behind_curtains(write_home: Write, draws: list[int]) -> None:
    home: Boxes = {"livingroom/floor_1": ((60, 6, 0.1), (0, 0, -0.05))}
    hidden = ""
    for number in range(24):
        place = (2.4 * number - 28, 1.5, 0.375)
        home[f"livingroom/{('desk', 'cabinet')[number % 2]}_{number}"] = ((1.0, 0.6, 0.75), place)
        hidden += curtain(number, (1.06, 0.66, 2.0), (*place[:2], 1.0))
    errors = judge(write_home(home_text(home, hidden))).errors
    assert len(errors) == 4 and all("does not see what stands on it" in str(error) for error in errors)
    assert len(draws) < 600


def test_a_home_in_which_a_search_is_hopeless_is_refused(
    write_home: Write, monkeypatch: pytest.MonkeyPatch, draws: list[int]
) -> None:
    monkeypatch.setattr(planner, "_MOST_LOOKS", 5)
    home: Boxes = {
        "livingroom/floor_1": ((20, 6, 0.1), (0, 0, -0.05)),
        "livingroom/desk_1": ((1.2, 0.6, 0.75), (9, 2, 0.375)),
        "livingroom/sofa_1": ((1.8, 0.8, 0.45), (-9, 2, 0.225)),
    }
    path = write_home(home_text(home, curtain(1, (0.02, 6.0, 2.4), (7.5, 0, 1.2))))
    (error,) = judge(path).errors
    assert "is not seen from 5 poses on the way" in str(error) and "take away what hides it" in str(error)
    assert len(draws) < 400


def test_a_trial_is_kept_by_the_content_of_the_files(
    write_home: Write, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    first = judge(write_home(home_text({**SMALL_HOME, **CEILING})))
    (kept,) = (folder.parent / "trials").glob("*.json")
    monkeypatch.setattr(verdict, "_here", {})
    monkeypatch.setattr(verdict, "Simulation", None)  # would fail if it were needed
    again = judge(write_home(home_text({**SMALL_HOME, **CEILING}), "copy.urdf"))
    assert [problem.measured for problem in again.problems] == [problem.measured for problem in first.problems]
    assert again.errors[0].file.endswith("copy.urdf")
    kept.write_text(json.dumps({"problems": [{"of": "another version"}]}))
    monkeypatch.setattr(verdict, "_here", {})
    monkeypatch.setattr(verdict, "Simulation", Simulation)
    assert judge(write_home(home_text({**SMALL_HOME, **CEILING}))).errors


def test_what_is_known_of_robots_is_the_same_in_every_process(tmp_path: Path) -> None:
    code = "from chmarl_pb.robots.file import find_model; from chmarl_pb.tasks.verdict import _facts; "
    code += "print(_facts(find_model({!r})))"
    for file in ("scout.toml", "scout.urdf"):
        shutil.copy(EXAMPLES / "scout" / file, tmp_path)
    robot = tmp_path / "scout.toml"
    commands = [[sys.executable, "-c", code.format(name)] for name in ("drone", "drone", str(robot), str(robot))]
    texts = [subprocess.run(one, capture_output=True, text=True, check=True).stdout for one in commands]
    assert texts[0] == texts[1] and texts[2] == texts[3] and " at 0x" not in "".join(texts)
    urdf = tmp_path / "scout.urdf"
    urdf.write_text(f"{urdf.read_text()}\n<!-- changed -->\n")
    assert f"{verdict._facts(find_model(robot))}\n" != texts[2]
    made = replace(find_model(robot), make=partial(print, "made"))
    assert "partial" in verdict._facts(made)


def test_a_benchmark_home_passes_its_trial() -> None:
    assert judge("home_4").problems == ()
