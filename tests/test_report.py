import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from chmarl_pb.cli import main
from chmarl_pb.envs.episode_file import load_episode, replay_episode
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation import paper
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.report import write_report
from chmarl_pb.evaluation.tables import paper_table
from chmarl_pb.tasks.splits import load_tasks

TASKS = load_tasks("test-unseen")[:2]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    evaluate("planner", tasks=TASKS, workers=1, out=folder / "planner.json")
    evaluate("random", tasks=TASKS, workers=1, max_steps=8, out=folder / "random.json", label="<b>QMIX</b>")
    evaluate("random", tasks=TASKS, workers=1, max_steps=8, out=folder / "qmix.json", label="QMIX + messages")
    return folder


@pytest.fixture(scope="module")
def page(results: Path) -> str:
    write_report([results], results / "page.html")
    return (results / "page.html").read_text()


def test_page_is_whole_and_needs_no_network(page: str) -> None:
    HTMLParser().feed(page)
    assert page.rstrip().endswith("</html>") and page.count("<svg") >= 4
    assert not re.search(r"<script|<link|<img|@import|url\((?!#)", page)
    assert not re.search(r'(?:src|href)="https?:', page.replace('xmlns:xlink="http', ""))
    assert not re.search(r"\$[a-z]", page)


def test_names_are_escaped(page: str) -> None:
    assert "&lt;b&gt;QMIX" in page and "<b>QMIX" not in page


def test_every_number_of_the_paper_is_there(page: str) -> None:
    for table in (paper.VISUAL, paper.SCENE_GRAPH, paper.FEEDBACK):
        for row in table.rows:
            assert len(row.success) == len(row.plw) == len(paper.SPLITS)
            assert "".join(f"<td>{value:.2f}</td>" for value in (*row.success, *row.plw)) in page


def test_a_label_puts_a_result_beside_the_papers(results: Path) -> None:
    report = evaluate("planner", tasks=TASKS[:1], workers=1, label="qmix + messages")
    html = paper_table(paper.SCENE_GRAPH, [report], others=True)
    beside = html[html.index("QMIX + messages") :]
    assert "100.00" in beside[: beside.index("QTRAN")]
    assert "100.00" not in paper_table(paper.VISUAL, [report], others=True)


def test_replays_lie_beside_the_page(results: Path, page: str) -> None:
    links = re.findall(r'href="(page_episodes/[^"]+)"', page)
    assert links
    for link in links:
        assert load_episode(results / link)
    assert replay_episode(load_episode(results / links[0])) is None


def test_bad_sources_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match="no results"):
        write_report([tmp_path], tmp_path / "page.html")
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(ResultError, match=r"other\.json"):
        write_report([tmp_path / "other.json"], tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_command_line(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(results / "planner.json"), "--out", str(tmp_path / "report.html")]) == 0
    assert "report.html" in capsys.readouterr().out
