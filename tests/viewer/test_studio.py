"""What draws pictures is compiled by another process while a policy plays, and only where that was never done."""

import subprocess
import sys
from typing import Any

import pytest

from chmarl_pb.compiled import COMPILES, is_stored
from chmarl_pb.rendering import raster
from chmarl_pb.viewer import studio

pytestmark = pytest.mark.skipif(not COMPILES, reason="nothing is compiled")


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """The processes that are started, which only wait."""
    found: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def start(_: list[str], **options: Any) -> subprocess.Popen[bytes]:
        found.append(popen([sys.executable, "-c", "import time; time.sleep(600)"], **options))
        return found[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    return found


def test_machine_code_is_stored_once_it_is_compiled() -> None:
    studio.draw_once()
    assert is_stored(raster.picture)


def test_nothing_is_started_where_machine_code_is_stored(
    started: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio, "is_stored", lambda _: True)
    with studio.compiling():
        pass
    assert not started


def test_the_other_process_ends_with_what_fails(
    started: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio, "is_stored", lambda _: False)
    with pytest.raises(ValueError, match="no such task"), studio.compiling():
        raise ValueError("no such task")
    assert len(started) == 1 and started[0].returncode is not None
