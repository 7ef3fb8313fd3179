"""Files that appear whole or not at all, locks that die with their process, rows that tell when they are damaged."""

import errno
import json
import os
import signal
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chmarl_pb import files
from chmarl_pb.errors import BusyError, WriteError
from chmarl_pb.files import Lock, append_line, replacing, sealed, unsealed, write_atomically, writing
from tests.helpers.disk import full_disk


def test_links_and_pipes_are_written_to_and_stay(tmp_path: Path) -> None:
    """Nothing takes the place of /dev/null or /dev/stdout."""
    pipe, link, target = tmp_path / "pipe", tmp_path / "link.json", tmp_path / "results" / "target.json"
    link.symlink_to(target)
    for text in ("new", "newer"):
        write_atomically(link, text)
        assert link.is_symlink() and target.read_text() == text
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    write_atomically(loop, "no loop")
    assert loop.read_text() == "no loop"
    loop.unlink()
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as reader:
        heard = reader.submit(pipe.read_text)
        write_atomically(pipe, "heard")
        assert heard.result() == "heard" and pipe.is_fifo()
    write_atomically(Path(os.devnull), "gone")
    assert Path(os.devnull).is_char_device()
    assert {path.name for path in tmp_path.rglob("*")} == {"pipe", "link.json", "results", "target.json"}


def test_a_folder_in_the_place_of_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "result.json").mkdir()
    with pytest.raises(WriteError, match=r"result\.json: cannot be written \(Is a directory\)") as raised:
        write_atomically(tmp_path / "result.json", "new")
    assert ".tmp" not in str(raised.value) and [path.name for path in tmp_path.rglob("*")] == ["result.json"]


# Locks

HOLD = """
import sys
from pathlib import Path
from chmarl_pb.files import Lock
lock = Lock(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def hold(path: Path) -> "subprocess.Popen[str]":
    """Start a process that holds a lock until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    return process


def test_a_lock_keeps_others_out_and_dies_with_its_process(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "result.json"
    process = hold(path)
    with pytest.raises(
        BusyError, match=rf"result\.json: another process is writing it; wait until process {process.pid}"
    ):
        Lock(path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert list(path.parent.iterdir()) == [path.with_name(".result.json.lock")]  # which nobody holds
    with Lock(path), pytest.raises(BusyError):
        Lock(path)
    assert list(path.parent.iterdir()) == []


def test_who_waits_for_a_lock_gets_it_when_it_is_free(tmp_path: Path) -> None:
    process = hold(tmp_path / "page.md")
    waiting = subprocess.Popen(
        [sys.executable, "-c", HOLD.replace("argv[1])", "argv[1]), wait=True"), str(tmp_path / "page.md")],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    with pytest.raises(subprocess.TimeoutExpired):
        waiting.communicate(timeout=1)
    process.communicate("")
    assert waiting.communicate(timeout=60)[0] == "held\n"
    Lock(tmp_path / "page.md").close()


def test_a_child_that_inherits_a_lock_holds_it(tmp_path: Path) -> None:
    lock = Lock(tmp_path / "state.json")
    child = subprocess.Popen(["cat"], stdin=subprocess.PIPE, pass_fds=[lock.fileno()])
    lock._file.close()  # as if this process were gone
    with pytest.raises(BusyError):
        Lock(tmp_path / "state.json")
    child.communicate()
    Lock(tmp_path / "state.json").close()


def test_a_lock_whose_file_is_removed_by_its_last_holder_is_taken_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, take = Lock(tmp_path / "a"), Lock._take
    taken: list[int] = []

    def take_late(self: Lock, path: Path, wait: bool) -> None:
        if not taken:
            first.close()  # between the opening of its file and the locking
        taken.append(1)
        take(self, path, wait)

    monkeypatch.setattr(Lock, "_take", take_late)
    second = Lock(tmp_path / "a")
    assert len(taken) == 2
    with pytest.raises(BusyError):
        Lock(tmp_path / "a")
    second.close()
    second.close()


def test_a_file_system_without_locks_is_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(file: object, kind: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    with pytest.warns(RuntimeWarning, match=r"result\.json: the file system cannot lock it"):
        Lock(tmp_path / "result.json").close()
    monkeypatch.setattr(files, "fcntl", None)
    with pytest.warns(RuntimeWarning, match="let no other process"):
        Lock(tmp_path / "result.json").close()


# Full disks


def test_a_full_disk_is_named_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text("old")
    with full_disk(10_000), pytest.raises(WriteError, match=r"page\.html: cannot be written \(File too large\)"):
        write_atomically(tmp_path / "page.html", "x" * 20_000)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("page.html", "old")]


@pytest.mark.parametrize("error", [RuntimeError("iostream error"), ValueError("could not write"), OSError("no number")])
def test_whatever_a_library_says_of_a_full_disk(tmp_path: Path, error: Exception) -> None:
    """They fill the disk, and then raise something that does not say so."""
    with full_disk(10_000), pytest.raises(WriteError, match=r"model\.pt: cannot be written"):
        with replacing(tmp_path / "model.pt") as temporary:
            temporary.write_bytes(b"x" * 10_000)
            raise error
    with pytest.raises(type(error), match=str(error)), replacing(tmp_path / "model.pt"):
        raise error  # the disk has room: it was something else
    with full_disk(10_000), pytest.raises(WriteError, match="joined"), writing(tmp_path / "joined", tmp_path):
        raise error
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_takes_no_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for write in (write_atomically, lambda path, _: Lock(path)):
        for place in ("file/x.json", "file/deeper/x.json"):
            with pytest.raises(WriteError, match=rf"{place}: cannot be written, .*/file.* is no folder"):
                write(tmp_path / place, "")


def test_a_line_is_added_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    append_line(path, "a" * 5000)
    with full_disk(8_000), pytest.raises(WriteError, match=r"rows\.jsonl: cannot be written"):
        append_line(path, "b" * 5000)
    append_line(path, "c")
    assert path.read_text() == "a" * 5000 + "\nc\n"


# Rows

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda parts: st.lists(parts, max_size=3) | st.dictionaries(st.text(max_size=3), parts, max_size=3),
    max_leaves=8,
)


@given(row=st.dictionaries(st.text(max_size=3), VALUES, max_size=4), where=st.integers(0, 10**6), bit=st.integers(0, 6))
def test_a_sealed_row_is_given_back_or_refused(row: dict[str, Any], where: int, bit: int) -> None:
    line = sealed(row)
    assert "\n" not in line and unsealed(line) == row
    damaged = bytearray(line, "ascii")
    damaged[where % len(damaged)] ^= 1 << bit
    try:
        found = unsealed(damaged.decode())
    except ValueError:
        return
    assert found == row  # as if 1e+22 had become 1E+22


def test_a_row_is_good_where_it_belongs() -> None:
    assert unsealed(sealed({"a": 1}, "here"), "here") == {"a": 1}
    for line in (sealed({"a": 1}, "there"), sealed({"a": 1}), json.dumps({"a": 1}), "[]", "", '{"a"'):
        with pytest.raises(ValueError):
            unsealed(line, "here")


def test_files_are_as_open_as_the_user_asks_for(tmp_path: Path) -> None:
    code = (
        "import os, sys; os.umask(int(sys.argv[1], 8)); from pathlib import Path; "
        "from chmarl_pb.files import write_atomically; write_atomically(Path(sys.argv[2]), 'x')"
    )
    for mask, mode in (("022", 0o644), ("077", 0o600)):
        path = tmp_path / mask
        subprocess.run([sys.executable, "-c", code, mask, str(path)], check=True)
        assert stat.S_IMODE(path.stat().st_mode) == mode
    path.chmod(0o640)
    write_atomically(path, "y")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640, "a file that is there keeps its own"
