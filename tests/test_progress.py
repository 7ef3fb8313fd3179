"""Progress bars, as they are seen where no terminal is."""

import io

import pytest
from rich.console import Console
from rich.progress import MofNCompleteColumn

from chmarl_pb.progress import LateProgress, silence


def shown(total: int) -> str:
    """Return what is printed of counting so far."""
    out = io.StringIO()
    with LateProgress(MofNCompleteColumn(), console=Console(file=out)) as bar:
        assert list(bar.count(range(total), 30, "counting")) == list(range(total))
    return out.getvalue().strip()


def test_the_last_count_is_shown() -> None:
    assert shown(30) == "30/30"
    assert shown(7) == "7/30"


def test_nothing_is_shown_before_there_is_progress_nor_in_silence() -> None:
    assert not shown(0)
    with silence():
        assert not shown(30)


def test_results_in_a_pipe_stay_there_while_a_bar_is_on_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    terminal = io.StringIO()
    with LateProgress(MofNCompleteColumn(), console=Console(file=terminal, force_terminal=True)) as bar:
        for number in bar.count(range(3), 3, "counting"):
            print("result", number)
    assert capsys.readouterr().out == "result 0\nresult 1\nresult 2\n"
    assert "3/3" in terminal.getvalue() and "result" not in terminal.getvalue()
