"""Where policies come from: built in, published weights, ``module:callable``, a checkpoint, or a factory."""

import os
from collections.abc import Callable, Collection, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import entry_points
from inspect import isclass, isfunction
from pathlib import Path
from typing import Any, cast

from chmarl_pb.errors import MissingExtraError, OptionError
from chmarl_pb.files import file_hash
from chmarl_pb.fingerprint import fingerprint, name_of, sha256_of
from chmarl_pb.named import import_named
from chmarl_pb.policies.eyes import Eyes, Seeing
from chmarl_pb.policies.policy import Factory, Policy
from chmarl_pb.policies.registry import BUILT_IN, make_policy
from chmarl_pb.policies.weights import Weights, checked_file, published, published_names

#: Group of entry points that load checkpoints: name = the file's ending without the dot, value = a
#: "module:callable" which takes the path and returns a Factory. Its attribute ``code``, if it has one, are the user's
#: own functions and classes by which the checkpoint is played: results are told apart by these, too.
ENTRY_POINTS = "chmarl_pb.checkpoints"

#: Group of entry points that bring eyes: name -> a "module:callable" which takes nothing and returns ``Eyes``.
EYES = "chmarl_pb.eyes"
_AT = "@"  # between the names of a policy and of its eyes

_LOADERS: dict[str, Callable[[Path], Factory]] = {}


@dataclass(frozen=True)
class Source:
    """A policy, ready to be made for an environment.

    Attributes:
        name: as given.
        make: makes the policy that drives an environment.
        deterministic: whether it plays every task the same way, so that one seed is enough.
        privileged: whether it is given more than observations: the environment and whole infos.
        centralized: whether one object drives all robots.
        needs_graphs: whether it is also privileged where observations hold no scene graph.
        rules: options of the environment that it was trained with, where they are not the paper's.
        observation: what it observes, if that is known.
        weights: what is published of it.
        sha256: of the checkpoint, with the user's own code that it names; of what tells it apart
            (:func:`chmarl_pb.fingerprint.fingerprint`); or of what its eyes have learned. None for what comes with the
            package, and where nothing tells it apart.
        told: tells ``sha256`` anew, of what may change as long as the policy is used: a checkpoint, which is read
            whenever the policy is made, or a module, which each process imports. None: nothing of it does.
    """

    name: str
    make: Factory
    deterministic: bool
    privileged: bool = False
    centralized: bool = False
    needs_graphs: bool = False
    rules: Mapping[str, Any] = field(default_factory=dict)
    observation: str | None = None
    weights: Weights | None = None
    sha256: str | None = None
    told: Callable[[], str | None] | None = None

    def check(self, sha256: str | None = None) -> None:
        """Check that what may change is still as it was.

        Args:
            sha256: as it was; None: as when this was made.

        Raises:
            OptionError: it has changed.
        """
        if self.told is not None and not (sha256 or self.sha256) == self.sha256 == self.told():
            raise OptionError(f"{self.name}: changed while it was evaluated; copy it, or evaluate again")

    @property
    def options(self) -> dict[str, Any]:
        """Options of an environment that it can drive."""
        return {**self.rules, **({"observation": self.observation} if self.observation else {})}

    def __call__(self, env: Any) -> Policy:
        """Return the policy that drives an environment."""
        return self.make(env)


def register_loader(ending: str, load: Callable[[Path], Factory]) -> None:
    """Let checkpoints be evaluated, in this process; the entry points ``ENTRY_POINTS`` do it in all processes.

    Args:
        ending: of the file's name, with the dot, e.g. ".pt".
        load: returns what makes the policy of a checkpoint.
    """
    _LOADERS[ending] = load


def load_policy(name: str | Path) -> Source:
    """Return a policy that is there already, to watch or evaluate it: nothing is trained.

    >>> search = chmarl_pb.load_policy("search")
    >>> env = chmarl_pb.parallel_env(split="val-unseen", **search.options)
    >>> chmarl_pb.rollout(env, search(env), seed=10).success
    True
    >>> env.close()

    Args:
        name: of published weights or of a built-in policy, a checkpoint's path, or ``module:callable``; as
            ``chmarl-pb evaluate --policy`` takes it.

    Returns:
        What makes the policy for an environment; ``options`` are those of an environment that it can drive.

    Raises:
        OptionError: there is no such policy, or its file is not the published one.
        CheckpointError: the checkpoint cannot be read.
    """
    return find_policy(str(name))


def find_policy(policy: str | os.PathLike[str] | Factory | Policy) -> Source:
    """Return the policy that is meant.

    Args:
        policy: a built-in name, perhaps with eyes (``search@detector``, see :mod:`chmarl_pb.policies.eyes`), that of
            published weights,
            ``module:callable`` (the callable takes the environment and returns a ``Policy``), the path of a
            checkpoint, such a callable itself, or a ``Policy`` that drives whatever environment it is given. With the
            attribute ``deterministic = True`` it is played once for each task; a string ``fingerprint`` tells it apart
            from others of its name, in place of :func:`chmarl_pb.fingerprint.fingerprint`; for ``privileged`` and
            ``centralized`` see :mod:`chmarl_pb.policies.seats`.

    Raises:
        OptionError: there is no such policy, or it cannot be loaded.
    """
    if isinstance(policy, Source):
        return policy
    if isinstance(policy, os.PathLike):
        policy = os.fspath(policy)
    if not isinstance(policy, str):
        make = policy if callable(policy) else partial(_given, policy)
        return Source(name_of(policy), make, **_declared(policy, _own_hash(policy)))
    if (known := BUILT_IN.get(policy)) is not None:
        make = partial(make_policy, policy)
        return Source(policy, make, known.deterministic, known.privileged, needs_graphs=known.reads_graphs)
    if (row := published(policy)) is not None:
        found = _checkpoint(checked_file(row))
        return replace(found, name=policy, rules={**found.rules, **row.rules}, observation=row.observation, weights=row)
    path = Path(policy)
    if path.exists():
        return _checkpoint(path)
    name, at, eyes = policy.partition(_AT)
    if at and name in BUILT_IN:
        return _with_eyes(name, eyes)
    colon = ":" in policy
    if path.name != policy or (path.suffix and not colon):
        raise OptionError(f"{policy}: no such file; name a checkpoint that is there")
    if not colon:
        raise OptionError(
            f"unknown policy {policy!r}; use one of: {', '.join((*BUILT_IN, *published_names()))}, module:callable, or "
            "a checkpoint's path"
        )
    factory = imported(policy, "policy")
    told = partial(fingerprint, factory) if _is_code(factory) and not _has_fingerprint(factory) else None
    return Source(policy, factory, **_declared(factory, _own_hash(factory)), told=told)


def _with_eyes(name: str, eyes: str) -> Source:
    if not BUILT_IN[name].reads_graphs:
        seeing = sorted(name for name, policy in BUILT_IN.items() if policy.reads_graphs)
        raise OptionError(f"{name!r} takes no eyes; use one of: {', '.join(seeing)}")
    found = find_eyes(eyes)
    make, deterministic = partial(_seeing, name, found), BUILT_IN[name].deterministic
    told = partial(getattr, found, "fingerprint")
    return Source(f"{name}{_AT}{eyes}", make, deterministic, sha256=found.fingerprint, told=told)


def _seeing(name: str, eyes: Eyes, env: Any) -> Policy:
    """Return a built-in policy that sees by eyes."""
    return Seeing(make_policy(name, env), eyes, env)


def find_eyes(name: str) -> Eyes:
    """Return what recognises things in pictures.

    Args:
        name: of an entry point of the group ``EYES``, or ``module:callable``.

    Raises:
        OptionError: there are no such eyes.
    """
    installed = {point.name: point for point in entry_points(group=EYES)}
    if name not in installed and ":" not in name:
        raise OptionError(f"unknown eyes {name!r}; use one of: {', '.join(sorted(installed))}, or module:callable")
    eyes: Eyes = installed[name].load()() if name in installed else imported(name, "eyes")()
    if not callable(eyes) or not isinstance(getattr(eyes, "fingerprint", None), str):
        raise OptionError(f"{name}: makes no eyes; they are called with a picture and have a text `fingerprint`")
    return eyes


def _declared(made_by: object, sha256: str | None) -> dict[str, Any]:
    """Return what a policy, or what makes it, says of itself, as arguments of a ``Source``, with the hash given."""
    names = ("deterministic", "privileged", "centralized")
    return {**{name: bool(getattr(made_by, name, False)) for name in names}, "sha256": sha256}


def _own_hash(made_by: object) -> str | None:
    """Return what tells a policy of the user's, or what makes it, apart."""
    return made_by.fingerprint if _has_fingerprint(made_by) else fingerprint(made_by)  # type: ignore[attr-defined]


def _has_fingerprint(made_by: object) -> bool:
    return isinstance(getattr(made_by, "fingerprint", None), str)


def _is_code(made_by: object) -> bool:
    """Return whether a policy is made by what a module says alone, and not by what holds other things, which change."""
    if not isclass(made_by) and not (isfunction(made_by) and made_by.__closure__ is None):
        return False
    return "<" not in made_by.__qualname__ and made_by.__module__ not in ("__main__", "__mp_main__")


def _given(policy: Policy, env: Any) -> Policy:
    """Return a copy of a policy that is there already: each robot has its own."""
    return deepcopy(policy)


def imported(path: str, what: str) -> Callable[..., Any]:
    """Return a callable that is named as ``module:callable``; modules are also found in the current folder.

    Args:
        path: its name.
        what: it makes, for messages: "policy" or "environment".

    Raises:
        OptionError: it cannot be imported, or called.
    """
    if ":" not in path:
        raise OptionError(f"{what} {path!r} is not a name like module:callable")
    try:
        found = import_named(path)
    except MissingExtraError:
        raise
    except (ImportError, AttributeError, ValueError) as error:
        raise OptionError(f"{what} {path}: {error}; name a module that can be imported from here") from error
    except SyntaxError as error:
        raise OptionError(f"{what} {path}: {error.filename}, line {error.lineno}: {error.msg}") from error
    except SystemExit as error:
        raise OptionError(f"{what} {path}: its module calls sys.exit({error.code!r}) when it is imported") from error
    if not callable(found):
        raise OptionError(f"{what} {path} is not callable; name a function that makes it")
    return cast(Callable[..., Any], found)


def _checkpoint(path: Path) -> Source:
    installed = {f".{point.name}": point for point in entry_points(group=ENTRY_POINTS)}
    ending = path.suffix
    if ending in _LOADERS:
        load = _LOADERS[ending]
    elif ending in installed:
        load = installed[ending].load()
    elif path.is_dir():
        raise OptionError(f"{path}: is a folder; name the file of the weights in it, e.g. {path / 'best.pt'}")
    else:
        known = ", ".join(sorted({*_LOADERS, *installed})) or "none"
        raise OptionError(
            f"{path}: no learner can load a checkpoint that ends in {ending!r} (known endings: {known}); install the "
            f"learner that wrote it, or give module:callable"
        )
    before = _hash_of(path)  # of what is read from here on, or it has changed
    factory = load(path)
    told = partial(_hash_now, path, factory)
    sha256 = _with_code(before, getattr(factory, "code", ()))
    return Source(str(path), factory, **_declared(factory, sha256), rules=getattr(factory, "rules", {}), told=told)


def _hash_now(path: Path, factory: Factory) -> str | None:
    """Return what tells a checkpoint apart, and with it what has been read of it."""
    return _with_code(_hash_of(path), getattr(factory, "code", ()))


def _hash_of(path: Path) -> str | None:
    return file_hash(path) if path.is_file() else None


def _with_code(sha256: str | None, code: Collection[object]) -> str | None:
    """Return what tells a checkpoint apart: the hash of its file, and the user's own code that it is played by.

    Args:
        sha256: of the file; None: it is none.
        code: that it names, if any.
    """
    told = [fingerprint(one) for one in code]
    if sha256 is None or None in told:
        return None
    return sha256_of(part.encode() for part in (sha256, *filter(None, told))) if told else sha256
