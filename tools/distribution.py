"""``python -m tools.distribution build/dist``: try the wheel and the sdist of a folder as users get them.

Each is installed, alone with its dependencies, in an empty environment of every Python that the package is for and that
is there, and ``chmarl-pb doctor`` is run outside of the checkout: what a package lacks is missed there.
"""

import argparse
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from chmarl_pb.errors import ChmarlError

PYTHONS = ("3.10", "3.11", "3.12", "3.13")
#: What each package must hold, below the folder that an sdist begins with.
NEEDED = {
    ".whl": ("chmarl_pb/py.typed", "chmarl_pb/_assets/scenes/home_1.urdf", "chmarl_pb/_assets/weights/manifest.json"),
    ".gz": ("pyproject.toml", "LICENSE", "README.md", "scenes/home_1.urdf", "tests/conftest.py", "training/train.py"),
}
_STRAY = {"out", "build", "dist", "__pycache__", ".venv", ".git"}


def check_contents(package: Path) -> None:
    """Raise ``ChmarlError`` if a wheel or an sdist lacks a file that it needs, or holds what was built or played."""
    names = list(_names(package))
    lacking = [name for name in NEEDED[package.suffix] if name not in names]
    stray = [name for name in names if _STRAY & {*PurePosixPath(name).parts}]
    if package.suffix == ".whl" and not any(name.endswith("licenses/LICENSE") for name in names):
        lacking.append("LICENSE")
    if lacking or stray:
        raise ChmarlError(
            f"{package}: lacks {lacking or 'nothing'}, and should not hold {stray[:5] or 'anything else'}"
        )


def _names(package: Path) -> Iterator[str]:
    if package.suffix == ".whl":
        with zipfile.ZipFile(package) as wheel:
            yield from wheel.namelist()
    else:
        with tarfile.open(package) as source:
            yield from (name.partition("/")[2] for name in source.getnames())


def interpreters() -> Iterator[tuple[str, str]]:
    """Yield the version and the command of each Python of ``PYTHONS`` that runs here."""
    for version in PYTHONS:
        here = f"{sys.version_info.major}.{sys.version_info.minor}"
        command = sys.executable if version == here else f"python{version}"
        try:
            subprocess.run([command, "-c", "import venv, ensurepip"], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            print(f"Python {version}: not here, not tried")
        else:
            yield version, command


def install_and_try(package: Path, command: str) -> None:
    """Install a package in an empty environment and let it test itself; what fails prints itself and raises."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([command, "-m", "venv", folder], check=True)
        programs = Path(folder) / ("Scripts" if sys.platform == "win32" else "bin")
        subprocess.run([programs / "python", "-m", "pip", "install", "--quiet", package.resolve()], check=True)
        subprocess.run([programs / "chmarl-pb", "doctor", "--quiet"], check=True, cwd=folder)


def main(arguments: Sequence[str] | None = None) -> int:
    """Check and try the packages of a folder."""
    parser = argparse.ArgumentParser(prog="python -m tools.distribution", description="Try wheel and sdist.")
    parser.add_argument("folder", type=Path, help="with one wheel and one sdist, as `python -m build` makes them")
    packages = sorted(path for path in parser.parse_args(arguments).folder.iterdir() if path.suffix in NEEDED)
    if len(packages) != len(NEEDED):
        raise ChmarlError(f"{len(packages)} packages; one wheel and one sdist are needed")
    for package in packages:
        check_contents(package)
    for version, command in interpreters():
        for package in packages:
            install_and_try(package, command)
            print(f"Python {version}: {package.name} installs and tests itself")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
