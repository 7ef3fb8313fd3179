"""What tells what robots see is compiled by another process while this one draws, and only if that was never done."""

from contextlib import AbstractContextManager, nullcontext

import pytest

from chmarl_pb.compiled import COMPILES, is_stored
from chmarl_pb.rendering import visible_pixels
from chmarl_pb.viewer import studio

pytestmark = pytest.mark.skipif(not COMPILES, reason="nothing is compiled")


def test_machine_code_is_stored_once_it_is_compiled() -> None:
    studio.see_once()
    assert is_stored(visible_pixels.visible)


@pytest.mark.parametrize(("stored", "cores", "started"), [(False, 2, True), (True, 2, False), (False, 1, False)])
def test_another_process_is_started_only_where_it_helps(
    stored: bool, cores: int, started: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []

    def meanwhile(work: object) -> AbstractContextManager[None]:
        found.append(work)
        return nullcontext()

    monkeypatch.setattr(studio, "is_stored", lambda _: stored)
    monkeypatch.setattr(studio, "meanwhile", meanwhile)
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    with studio.compiling():
        pass
    assert found == [studio.see_once] * started
