"""Extras: packages that only parts of this one need. A missing one is one sentence, with the command that adds it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import requires
from importlib.util import find_spec
from pathlib import Path

from chmarl_pb.errors import MissingExtraError

_CHECKOUT = Path(__file__).resolve().parents[1]


@contextmanager
def needs(what: str, extra: str, script: bool = False) -> Iterator[None]:
    """Import modules of an extra within; say how to install it if one is missing.

    Args:
        what: what needs them, as the sentence begins.
        extra: its name in ``pyproject.toml``.
        script: whether nobody catches errors: the sentence is printed, and the process ends. That is so, too, while
            ``python -m`` imports the packages of a command before the command itself.

    Raises:
        MissingExtraError: a module cannot be imported.
    """
    try:
        yield
    except ImportError as error:
        sentence = f"{what} needs the extra {extra!r} ({error}); run `{command(extra)}`"
        if isinstance(error, MissingExtraError):  # something below has said it
            sentence = str(error)
        if script or sys.argv[:1] == ["-m"]:
            print(f"error: {sentence}", file=sys.stderr)
            raise SystemExit(2) from error
        raise MissingExtraError(sentence) from error


def check(what: str, extra: str, *modules: str) -> None:
    """Check that modules of an extra are there, without the time that it takes to import them; see ``needs``.

    Raises:
        MissingExtraError: a module is missing.
    """
    with needs(what, extra):
        for module in modules:
            if find_spec(module) is None:
                raise ModuleNotFoundError(f"No module named {module!r}")


def command(extra: str) -> str:
    """Return the command that installs an extra: from the checkout, or beside a wheel what the extra consists of.

    The package itself is on no index, so its own name would not do.
    """
    if (_CHECKOUT / "pyproject.toml").is_file() and (_CHECKOUT / "scenes").is_dir():
        wanted = ["-e", f'"{_CHECKOUT}[{extra}]"']
    else:
        lines = [line.replace('"', "'").partition(";") for line in requires("chmarl-pb") or ()]
        wanted = [f'"{package.strip()}"' for package, _, marker in lines if f"extra == '{extra}'" in marker]
    return " ".join([sys.executable, "-m pip install", *wanted])
