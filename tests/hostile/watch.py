"""Cases in a process that may die, watched: what one opens, what it starts, how much it takes, and how it ends."""

import ctypes
import json
import os
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TextIO

from chmarl_pb.errors import ChmarlError
from tests.hostile import kinds
from tests.hostile.mutations import RAN, SECRET

SECONDS = 30
BYTES = 2 * 2**30

_STARTS = (
    "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.forkpty", "os.startfile", "subprocess.Popen", "pty.spawn",
    "pickle.find_class", "socket.connect", "socket.bind", "urllib.Request", "ctypes.dlopen", "os.putenv",
    "webbrowser.open",
)  # fmt: skip
_CHANGES = ("os.remove", "os.rename", "os.rmdir", "os.link", "os.symlink", "os.truncate", "shutil.rmtree", "os.chmod")
_OWN = tuple(
    {str(Path(path).resolve()) for path in (sys.prefix, sys.base_prefix, Path(__file__).parents[2], "/proc", "/sys")}
    | {"/dev/null", "/dev/urandom", "/dev/shm/chmarl-pb", "/usr/share/zoneinfo", "/etc/ld.so.cache", "/lib", "/usr/lib"}
)


@dataclass(frozen=True)
class End:
    """How a case ended.

    Attributes:
        outcome: "loads", "refused", "traceback", "crash", "hang", "memory".
        says: the message, or what else there is to say.
        deeds: what it must not do and has done.
        seconds: how long it took.
    """

    outcome: str
    says: str
    deeds: tuple[str, ...]
    seconds: float

    @property
    def is_good(self) -> bool:
        """Whether that is how it has to end."""
        return self.outcome in ("loads", "refused") and not self.deeds


class Guard:
    """An audit hook that notes, as long as a case runs, what a reader of files has no business to do."""

    def __init__(self) -> None:
        """Add the hook; it cannot be taken away, so this process does nothing else."""
        self.deeds: list[str] = []
        self.folder, self._own = "", _OWN
        sys.addaudithook(self._note)

    def begin(self, folder: Path) -> None:
        """Watch, while a case may use a folder, and the caches that all cases share."""
        self._own = (*_OWN, *(os.path.realpath(os.environ[name]) for name in ("CHMARL_CACHE", "TMPDIR")))
        self.folder = os.path.realpath(folder)

    def _note(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.folder:
            return
        if event in _STARTS and not (event == "ctypes.dlopen" and self._is_own(arguments[0])):
            self.deeds.append(f"{event} {str(arguments)[:120]}")
        elif event in ("open", "os.listdir", "os.mkdir", *_CHANGES) and not self._is_own(arguments[0]):
            self.deeds.append(f"{event} {str(arguments[0])[:120]}")
        elif event == "exec" and not self._is_own(arguments[0].co_filename):
            self.deeds.append(f"exec of {arguments[0].co_filename[:80]}")

    def _is_own(self, path: Any) -> bool:
        if not isinstance(path, str | bytes | os.PathLike) or os.fspath(path) in ("", b""):
            return True  # a descriptor that is open
        name = os.fsdecode(path)
        if name.startswith("<") and name.endswith(">"):
            return True  # code that a library makes, as dataclasses does
        place = os.path.join(os.path.realpath(os.path.dirname(name) or "."), os.path.basename(name))
        final = os.path.realpath(place)
        return any(os.path.join(final, "").startswith(os.path.join(own, "")) for own in (self.folder, *self._own))


class Openings:
    """Tells whether the secret beside the cases was opened, also by libraries that are not written in Python."""

    def __init__(self, secret: Path) -> None:
        """Begin to watch a file."""
        libc = ctypes.CDLL(None, use_errno=True)
        self._descriptor = libc.inotify_init1(os.O_NONBLOCK)
        if libc.inotify_add_watch(self._descriptor, os.fsencode(secret), 0x20) < 0:  # IN_OPEN
            raise OSError(ctypes.get_errno(), "inotify")

    def any(self) -> bool:
        """Return whether there was one since the last question."""
        try:
            return bool(os.read(self._descriptor, 4096))
        except BlockingIOError:
            return False


def _say(error: BaseException) -> str:
    frames, trace = [], error.__traceback__
    while trace is not None:
        frames.append(f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}")
        trace = trace.tb_next
    return f"{type(error).__name__}: {str(error)[:300]} at {' '.join(frames[-6:])}"


def _outcome(load: Callable[[Path], object], folder: Path) -> tuple[str, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            load(folder)
        return "loads", ""
    except ChmarlError as error:
        text = str(error)
        readable = text.strip() and len(text) < 30_000 and "\0" not in text
        return ("refused", text) if readable else ("traceback", f"a message that nobody can read: {text[:200]!r}")
    except MemoryError as error:
        return "memory", _say(error)
    except BaseException as error:
        return "traceback", _say(error)


class Worker:
    """A process that loads the files of one case after the other; when it dies, another one goes on."""

    _LIFE = 50  # cases, so that little of what one leaves behind meets others

    def __init__(self, guard: Guard, openings: Openings) -> None:
        """Begin without a process; it is forked when it is needed."""
        self._guard, self._openings = guard, openings
        self._child, self._cases = 0, 0

    def end_of(self, load: Callable[[Path], object], folder: Path) -> End:
        """Load the files of a folder, and tell how that ended."""
        if not self._child:
            self._start()
        start = time.monotonic()
        self._asks.write(f"{load.__name__} {folder}\n")
        self._asks.flush()
        line = self._answers.readline()
        outcome, says, deeds = json.loads(line) if line else self._killed()
        deeds += [f"open of {SECRET}"] * self._openings.any()
        if (folder.parent / RAN).exists():
            (folder.parent / RAN).unlink()
            deeds.append("code was run")
        self._cases += 1
        if self._child and (self._cases >= self._LIFE or outcome == "memory"):
            self.close()
        return End(outcome, says, tuple(deeds), time.monotonic() - start)

    def close(self) -> None:
        """Let the process end."""
        if self._child:
            self._asks.close()
            self._killed()

    def _start(self) -> None:
        (reads, asks), (hears, answers) = os.pipe(), os.pipe()
        self._child, self._cases = os.fork(), 0
        if self._child == 0:
            os.close(asks)
            os.close(hears)
            _serve(os.fdopen(reads), os.fdopen(answers, "w"), self._guard)
        os.close(reads)
        os.close(answers)
        self._asks, self._answers = os.fdopen(asks, "w"), os.fdopen(hears)

    def _killed(self) -> tuple[str, str, list[str]]:
        _, status = os.waitpid(self._child, 0)
        self._child = 0
        self._answers.close()
        number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        if number == signal.SIGALRM:
            return "hang", f"more than {SECONDS} s", []
        return "crash", signal.Signals(number).name if number else f"exit {os.WEXITSTATUS(status)}", []


def _serve(asked: TextIO, answers: TextIO, guard: Guard) -> NoReturn:
    """Load what is asked for, within limits, until nothing more comes."""
    try:
        null = os.open(os.devnull, os.O_RDWR)
        for number in (1, 2):
            os.dup2(null, number)
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + BYTES
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        for line in asked:
            load, _, folder = line.strip().partition(" ")
            os.chdir(folder)
            signal.alarm(SECONDS)
            guard.begin(Path(folder))
            outcome, says = _outcome(getattr(kinds, load), Path(folder))
            guard.folder = ""
            signal.alarm(0)
            answers.write(json.dumps([outcome, says[:2000], guard.deeds[:5]]) + "\n")
            answers.flush()
            guard.deeds.clear()
    finally:
        os._exit(0)
