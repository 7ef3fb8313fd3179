"""The package is built in rows: a module imports only from its own row and the rows above it."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "chmarl_pb"
ROWS = (
    ("errors",),
    ("extras",),
    ("progress",),
    ("files",),
    ("compiled",),
    ("assets",),
    ("catalog",),
    ("homes",),
    ("world",),
    ("processes",),
    ("robots",),
    ("sensing",),
    ("tasks",),
    ("planner",),
    ("envs",),
    ("data", "evaluation"),
    ("demo",),
    ("bench",),
    ("commands",),
    ("cli",),
)
ROW_OF = {name: number for number, names in enumerate(ROWS) for name in names}
MAY_USE_PYBULLET = {"world", "robots", "sensing"}
PYBULLET = "chmarl_pb.world.bullet.pybullet"  # the one import of PyBullet itself, without its greeting, lies there
FORBIDDEN = {"torch", "torchvision", "stable_baselines3", "sb3_contrib", "training"}
MAY_USE_SB3 = {"envs/sb3_vec.py"}  # imported by nothing else of the package, only when it is asked for
FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def imported(source: str) -> list[str]:
    """Return the full names of all imports of a source, also inside functions, but not those under TYPE_CHECKING."""
    tree = ast.parse(source)
    typing_only = {
        node
        for test in ast.walk(tree)
        if isinstance(test, ast.If) and "TYPE_CHECKING" in ast.unparse(test.test)
        for part in test.body
        for node in ast.walk(part)
    }
    names: list[str] = []
    for node in ast.walk(tree):
        if node in typing_only:
            continue
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{'.' * node.level}{node.module or ''}.{alias.name}" for alias in node.names]
    return names


def faults(own: str, source: str) -> list[str]:
    """Return what a source of a module of the package imports against the rules.

    Args:
        own: the module's first name below the package, e.g. ``robots``.
        source: its text.
    """
    found = []
    for name in imported(source):
        parts = name.split(".")
        if name.startswith(".") or parts[0] in FORBIDDEN:
            found.append(name)
        elif parts[0] == "pybullet" or (name == PYBULLET and own not in MAY_USE_PYBULLET):
            found.append(name)
        elif parts[0] == "chmarl_pb" and len(parts) > 1 and ROW_OF.get(parts[1], 0) > ROW_OF[own]:
            found.append(name)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_module_imports_no_lower_row(path: Path) -> None:
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    assert own in ROW_OF, f"{own} has no row; give it one here and in the design"
    found = faults(own, path.read_text())
    if path.relative_to(PACKAGE).as_posix() in MAY_USE_SB3:
        found = [name for name in found if not name.startswith("stable_baselines3")]
    if path == PACKAGE / "world" / "bullet.py":
        found.remove("pybullet")
    assert found == []


@pytest.mark.parametrize(
    ("own", "line"),
    [
        ("world", "from chmarl_pb.robots.arm import Arm"),
        ("catalog", "from chmarl_pb import homes"),
        ("homes", "def f():\n    import chmarl_pb.world"),
        ("tasks", "from chmarl_pb.envs import parallel as p"),
        ("planner", "from chmarl_pb.world.bullet import pybullet as p"),
        ("robots", "import pybullet"),
        ("envs", "from torch.nn import Module"),
        ("envs", "import training.train"),
        ("robots", "from . import arm"),
    ],
)
def test_checker_catches(own: str, line: str) -> None:
    assert len(faults(own, f"import numpy as np\n{line}\n")) == 1


@pytest.mark.parametrize(
    ("own", "source"),
    [
        ("robots", "from chmarl_pb.world import World\nfrom chmarl_pb.world.bullet import pybullet"),
        ("tasks", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from chmarl_pb.envs import parallel"),
        ("cli", "import chmarl_pb\nfrom chmarl_pb import catalog"),
    ],
)
def test_checker_lets_pass(own: str, source: str) -> None:
    assert faults(own, source) == []
