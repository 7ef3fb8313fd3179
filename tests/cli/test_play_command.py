"""``chmarl-pb play``: what it says before there is a page."""

from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.cli import main
from chmarl_pb.cli.play import _is_loopback, _reachable
from chmarl_pb.tasks.splits import load_tasks

pytest.importorskip("viser", reason="the extra 'viewer' is not installed")


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["--task", "nonsense"], "unknown task 'nonsense'"),
        (["--policy", "nobody"], "unknown policy 'nobody'"),
        (["--host", "192.0.2.1"], "name an address of this machine"),
    ],
)
def test_faults_are_one_line(words: list[str], fault: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["play", "--no-open", "--port", "0", *words]) == 2
    out, err = capfd.readouterr()
    assert out == "" and fault in err and err.count("\n") == 1


@pytest.mark.parametrize("port", ["-1", "65536", "99999"])
@pytest.mark.parametrize("command", [("play",), ("watch", "random", "--live")], ids=" ".join)
def test_ports_that_are_none_are_refused(
    command: tuple[str, ...], port: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "--no-open", "--port", port]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err == f"chmarl-pb: --port {port} is not a whole number from 0 to 65535\n"


def test_help_shows_an_example_and_what_a_host_means(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["play", "--help"])
    words = " ".join(capsys.readouterr().out.split())
    assert "example: chmarl-pb play --task" in words and "nothing is encrypted" in words


def test_episode_page_is_one_file(tmp_path: Path) -> None:
    task = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)
    file, page = str(tmp_path / "episode.json"), tmp_path / "episode.html"
    assert main(["episode", "save", "--task", task.id, "--out", file]) == 0
    assert main(["episode", "page", file, "--out", str(page)]) == 0
    assert "__VISER_EMBED_DATA__" in page.read_text()


@pytest.mark.parametrize(
    ("host", "loopback", "shown"),
    [
        ("127.0.0.1", True, "127.0.0.1"),
        ("::1", True, "[::1]"),
        ("localhost", True, "localhost"),
        ("10.0.0.7", False, "10.0.0.7"),
    ],
)
def test_addresses(host: str, loopback: bool, shown: str) -> None:
    assert (_is_loopback(host), _reachable(host)) == (loopback, shown)


def test_all_addresses_are_shown_by_the_name_of_the_machine(monkeypatch: Any) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "lab")
    assert (_is_loopback("0.0.0.0"), _reachable("0.0.0.0")) == (False, "lab")
