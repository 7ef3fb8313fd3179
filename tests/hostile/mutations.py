"""Damage and malice for files of any kind: a valid file and a random stream give a file that nobody expects."""

import io
import json
import os
import pickle
import re
import string
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from chmarl_pb.learning.storage.seal import LENGTH, seal
from tests.helpers.damage import Evil

_Option = TypeVar("_Option")
Stream = np.random.Generator
Mutation = Callable[[bytes, Stream], bytes]

SECRET = "secret.obj"  # beside the folder of a case: nobody may open it
RAN = "code-ran"  # beside it, too: nobody may make it

_MOST = 2**22  # bytes that a mutation makes of a file
_NUMBER = re.compile(rb"-?\b\d+(?:\.\d+)?(?:e-?\d+)?\b")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9./-]*")
_QUOTED = re.compile(rb'"[^"\n]*"')
NUMBERS = (
    b"0", b"-1", b"1e308", b"-1e308", b"1e-320", b"nan", b"inf", b"-inf", b"2147483648", b"-2147483649", b"1e6",
    b"4294967296", b"18446744073709551616", b"9" * 400, b"9" * 5000, b"0x10", b"1_0", b"", b"1e", b"--1", b"true",
)  # fmt: skip
NAMES = (
    "../secret.obj", "../../etc/passwd", "/etc/passwd", "/dev/zero", "..\\secret.obj", "./../secret.obj",
    "", ".", "..", "a\0b",
    "x" * 5000, "http://localhost/x", "file:///etc/passwd", "package://x/y", "os:system", "../code-ran", "%s%n%x",
    "$(touch ../code-ran)", "`touch ../code-ran`", "\u00e9\u202e", "__class__", "NaN", "null", "~root/.profile", "con",
)  # fmt: skip

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.integers(-(2**70), 2**70) | st.floats() | st.text(max_size=8)
    | st.sampled_from(NAMES),
    lambda parts: st.lists(parts, max_size=4) | st.dictionaries(st.text(string.ascii_lowercase, max_size=5), parts),
    max_leaves=12,
)  # fmt: skip


def drawn(strategy: st.SearchStrategy[Any], count: int) -> list[Any]:
    """Return what Hypothesis draws of a strategy, the same each time."""
    found: list[Any] = []

    @seed(0)
    @settings(
        max_examples=count, database=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(strategy)
    def gather(value: Any) -> None:
        found.append(value)

    gather()
    return found


def _choice(rng: Stream, options: Sequence[_Option]) -> _Option:
    return options[int(rng.integers(len(options)))]


def _span(content: bytes, rng: Stream) -> tuple[int, int]:
    begin = int(rng.integers(len(content) + 1))
    return begin, min(len(content), begin + int(2 ** rng.uniform(0, 10)))


# Bytes


def flips(content: bytes, rng: Stream) -> bytes:
    changed = bytearray(content or b"\0")
    for _ in range(int(2 ** rng.uniform(0, 5))):
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def cut(content: bytes, rng: Stream) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def spliced(content: bytes, rng: Stream) -> bytes:
    """Lose, double, zero or replace a part."""
    begin, end = _span(content, rng)
    size = end - begin
    new = _choice(rng, (b"", content[begin:end] * 2, bytes(size), rng.bytes(size), b"\xff" * size, content))
    return content[:begin] + new + content[end:]


def swollen(content: bytes, rng: Stream) -> bytes:
    begin, end = _span(content, rng)
    part = content[begin:end] or b"\n"
    return content[:begin] + part * min(int(2 ** rng.uniform(4, 14)), _MOST // len(part)) + content[end:]


def field(content: bytes, rng: Stream) -> bytes:
    """Put an odd whole number where a binary format may have a count, a size or an offset."""
    place = int(rng.integers(max(1, min(len(content), _choice(rng, (32, 128, len(content) + 1))))))
    number = _choice(rng, (0, 1, 2**31 - 1, 2**31, 2**32 - 1, len(content), len(content) * 1000, 85899346)) % 2**32
    return content[:place] + number.to_bytes(4, _choice(rng, ("little", "big"))) + content[place + 4 :]


# Texts


def _token(pattern: re.Pattern[bytes], new: Callable[[Stream, list[bytes]], bytes]) -> Mutation:
    def change(content: bytes, rng: Stream) -> bytes:
        found = list(pattern.finditer(content))
        if not found:
            return flips(content, rng)
        for _ in range(int(rng.integers(1, 4))):
            match = _choice(rng, found)
            changed = content[: match.start()] + new(rng, [one[0] for one in found]) + content[match.end() :]
        return changed

    return change


def _quoted(rng: Stream, _: list[bytes]) -> bytes:
    return b'"' + _choice(rng, NAMES).encode() + b'"'


numbers = _token(_NUMBER, lambda rng, _: bytes(_choice(rng, NUMBERS)))
words = _token(_WORD, lambda rng, others: bytes(_choice(rng, others)))
names = _token(_WORD, lambda rng, _: bytes(_choice(rng, NAMES).encode()))
quoted = _token(_QUOTED, _quoted)
moved = _token(_QUOTED, lambda rng, others: bytes(_choice(rng, others)))


def lines(content: bytes, rng: Stream) -> bytes:
    """Lose, double, swap or repeat lines."""
    rows = content.splitlines(keepends=True) or [b""]
    one, other = (int(rng.integers(len(rows))) for _ in range(2))
    match int(rng.integers(4)):
        case 0:
            del rows[one]
        case 1:
            rows[one], rows[other] = rows[other], rows[one]
        case 2:
            rows.insert(other, rows[one])
        case _:
            rows[one : one + 1] = [rows[one]] * min(int(2 ** rng.uniform(2, 15)), _MOST // (len(rows[one]) + 1))
    return b"".join(rows)


TEXT: tuple[Mutation, ...] = (flips, cut, spliced, swollen, numbers, numbers, words, names, quoted, moved, lines, lines)
BINARY: tuple[Mutation, ...] = (flips, cut, spliced, swollen, field, field)

# XML, JSON, TOML

_BOMB = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10 if n else "bomb"}">' for n in range(10))
_PROLOGUES = (
    f"<!DOCTYPE x [{_BOMB}]>", '<!DOCTYPE x [<!ENTITY e9 SYSTEM "../secret.obj">]>',
    '<!DOCTYPE x SYSTEM "../secret.obj">', '<?xml version="1.0" encoding="utf-16"?>',
    '<?xml-stylesheet href="../secret.obj"?>',
)  # fmt: skip


def xml(content: bytes, rng: Stream) -> bytes:
    """Add what is dangerous in XML, or move elements about."""
    tags = list(re.finditer(rb"<[A-Za-z_/][^<>]*>", content))
    if not tags or rng.random() < 0.2:
        body = content.partition(b"?>")[2] or content
        return _choice(rng, _PROLOGUES).encode() + body.replace(b"0.", b"&e9;", 1)
    one, other, depth = _choice(rng, tags), _choice(rng, tags), int(2 ** rng.uniform(1, 17))
    new = _choice(
        rng,
        (
            b"<a>" * depth + b"</a>" * depth, one[0] * min(depth, 5000), b"", one[0][:-1] + b' x="1"' * 3 + b">",
            b"<![CDATA[" + b"x" * depth + b"]]>", b'<include href="../secret.obj"/>', one[0] + b"&e9;",
            b'<mesh filename="../secret.obj"/>', b"<!-- " + b"-" * depth + b" -->",
        ),
    )  # fmt: skip
    return content[: other.start()] + bytes(new) + content[other.end() :]


def _places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [at] * bool(at) + [place for key, part in items for place in _places(part, (*at, key))]


def changed_json(values: list[Any]) -> Mutation:
    """Return a mutation that puts another value somewhere, or loses one."""

    def change(content: bytes, rng: Stream) -> bytes:
        data = json.loads(content)
        data.pop("sha256", None)  # of a result: else only that would be looked at
        for _ in range(int(rng.integers(1, 3))):
            shallow = [place for place in _places(data) if len(place) <= int(rng.integers(1, 7))]
            *way, last = _choice(rng, shallow or _places(data))
            holder = data
            for key in way:
                holder = holder[key]
            if rng.random() < 0.15:
                del holder[last]
            else:
                holder[last] = _choice(rng, values)
        return json.dumps(data).encode()

    return change


def nested(content: bytes, rng: Stream) -> bytes:
    """Nest brackets deeply where a value was."""
    depth = int(2 ** rng.uniform(4, 18))
    open_, close = _choice(rng, ((b"[", b"]"), (b'{"a":', b"}"), (b"{a=", b"}")))
    found = list(_NUMBER.finditer(content)) or list(re.finditer(rb"$", content))
    match = _choice(rng, found)
    return content[: match.start()] + open_ * depth + b"1" + close * depth + content[match.end() :]


# Archives: checkpoints, models, arrays


def _evil() -> bytes:
    return pickle.dumps(Evil(Path("..") / RAN), int(pickle.DEFAULT_PROTOCOL))


def archive(content: bytes, rng: Stream) -> bytes:
    """Change a member of a zip, and make all its checksums right again."""
    is_sealed = content[-LENGTH:].startswith(b"\nchmarl_pb sha256")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as old:
            members = {one.filename: old.read(one) for one in old.infolist()}
    except Exception:  # an earlier mutation has damaged it: zipfile raises what it likes
        return flips(content, rng)
    name = _choice(rng, list(members) + [one for one in members if one.endswith((".pkl", ".json"))] * 5)
    small = name.endswith((".pkl", ".json"))
    match int(rng.integers(8)):
        case 0:
            members[name] = _evil()
        case 1:
            members[_choice(rng, NAMES[:6]) or "x"] = members.pop(name)
        case 2:
            members[name] = bytes(2**28)
        case 3:
            del members[name]
        case _:
            members[name] = _choice(rng, TEXT if small else BINARY)(members[name], rng)
    kind = zipfile.ZIP_DEFLATED if rng.random() < 0.15 or len(members.get(name, b"")) > 2**24 else zipfile.ZIP_STORED
    new = io.BytesIO()
    with zipfile.ZipFile(new, "w", kind) as file:
        for member, part in members.items():
            file.writestr(member.replace("\0", "_"), part)
    return sealed(new.getvalue()) if is_sealed and rng.random() < 0.9 else new.getvalue()


def evil(content: bytes, rng: Stream) -> bytes:
    """Be a pickle that runs code."""
    return _choice(rng, (_evil(), sealed(_evil()), _evil() + content))


def sealed(content: bytes) -> bytes:
    """Return a file with the right sha256 behind it."""
    path = Path(f"/tmp/hostile-{os.getpid()}")
    path.write_bytes(content)
    try:
        seal(path)
        return path.read_bytes()
    finally:
        path.unlink()


# Files that are no files


def replaced(path: Path, rng: Stream, outside: bool) -> None:
    """Put something else than a file there, perhaps a link to a file outside of the folder."""
    path.unlink()
    match int(rng.integers(0 if outside else 1, 6)):
        case 0:
            path.symlink_to(Path("..") / SECRET)
        case 1:
            path.symlink_to("/dev/zero")
        case 2:
            path.symlink_to(path.name)
        case 3:
            path.mkdir()
        case 4:
            os.mkfifo(path)
        case _:
            with path.open("wb") as file:
                file.truncate(2**40)
