"""The package is built in rows: a module imports only from its own row and the rows above it."""

import ast
import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "chmarl_pb"
PAGE = PACKAGE.parent / "docs" / "architecture.md"
ROWS = [  # of the page's table, each with the names of its packages and files
    [name.removesuffix(".py").split("/")[0] for name in re.findall(r"`([\w.]+)/?`", line.split("|")[2])]
    for line in PAGE.read_text().splitlines()
    if re.match(r"\| \d+ \|", line)
]
ROW_OF = {name: number for number, names in enumerate(ROWS) for name in names}
MAY_USE_PYBULLET = {"world", "robots", "rendering"}
PYBULLET = "chmarl_pb.world.bullet.pybullet"  # the one import of PyBullet itself, without its greeting, lies there
HEAVY = {"torch", "torchvision", "stable_baselines3", "sb3_contrib"}  # of the extra ``train``, for ``learning`` alone
FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")
SCRIPTS = sorted((PACKAGE.parent / "training").rglob("*.py"))


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
        if name.startswith(".") or parts[0] == "training" or (parts[0] in HEAVY and own != "learning"):
            found.append(name)
        elif parts[0] == "pybullet" or (name == PYBULLET and own not in MAY_USE_PYBULLET):
            found.append(name)
        elif parts[0] == "chmarl_pb" and len(parts) > 1 and ROW_OF.get(parts[1], 0) > ROW_OF[own]:
            found.append(name)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_module_imports_no_lower_row(path: Path) -> None:
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    assert own in ROW_OF, f"{own} has no row; give it one in {PAGE.name}"
    assert faults(own, path.read_text()) == (["pybullet"] if path == PACKAGE / "world" / "bullet.py" else [])


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def test_no_modules_import_each_other() -> None:
    """Also not by way of others, nor inside functions."""
    paths = {module_of(path): path for path in (*FILES, *SCRIPTS)}
    graph = {}
    for module, path in paths.items():
        names = imported(path.read_text())
        needed = {name if name in paths else name.rpartition(".")[0] for name in names}
        graph[module] = needed & paths.keys() - {module}
    assert list(TopologicalSorter(graph).static_order())  # raises CycleError, which names the modules


def test_no_folders_of_a_package_import_each_other() -> None:
    """Also not by way of others; modules beside the folders count by themselves."""
    folders: dict[str, str] = {}
    for path in FILES:
        parts = path.relative_to(PACKAGE).parts
        folders[module_of(path)] = ".".join(parts[:2]) if len(parts) > 2 else module_of(path)
    graph: dict[str, set[str]] = {}
    for path in FILES:
        if path.name == "__init__.py":
            continue  # what a package offers
        own = folders[module_of(path)]
        names = imported(path.read_text())
        needed = {folders.get(name) or folders.get(name.rpartition(".")[0], own) for name in names}
        graph.setdefault(own, set()).update(needed - {own})
    assert list(TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("path", [*FILES, *SCRIPTS], ids=module_of)
def test_no_module_is_named_as_what_its_package_offers(path: Path) -> None:
    package = path.parent / "__init__.py"
    offered = {name.rpartition(".")[2] for name in imported(package.read_text())} if package.exists() else set()
    assert path.stem not in offered - {"bullet"}


@pytest.mark.parametrize(
    ("own", "line"),
    [
        ("world", "from chmarl_pb.robots.arm import Arm"),
        ("catalog", "from chmarl_pb import homes"),
        ("homes", "def f():\n    import chmarl_pb.world"),
        ("tasks", "from chmarl_pb.envs import parallel as p"),
        ("policies", "from chmarl_pb.world.bullet import pybullet as p"),
        ("robots", "import pybullet"),
        ("envs", "from torch.nn import Module"),
        ("envs", "import chmarl_pb.cli.train"),
        ("learning", "import training.train"),
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
