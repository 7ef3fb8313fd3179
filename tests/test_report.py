import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from chmarl_pb.cli import main
from chmarl_pb.envs.episode_file import load_episode, replay_episode
from chmarl_pb.envs.provenance import tasks_hash
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation import paper
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.report import write_report
from chmarl_pb.evaluation.result import load_result
from chmarl_pb.evaluation.tables import paper_table, title_of
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
    one = evaluate("planner", tasks=TASKS[:1], workers=1, label="qmix + messages")
    assert "1 chosen tasks" in title_of(one)
    report = replace(one, settings=one.settings | {"tasks_sha256": tasks_hash(load_tasks("test-unseen"))})
    html = paper_table(paper.SCENE_GRAPH, [report], others=True)
    beside = html[html.index("QMIX + messages") :]
    assert "100.00" in beside[: beside.index("QTRAN")]
    assert "100.00" not in paper_table(paper.VISUAL, [report], others=True)


def test_what_is_no_result_of_the_benchmark_stands_beside_nothing(results: Path) -> None:
    reports = [load_result(results / f"{name}.json") for name in ("planner", "qmix")]
    html = paper_table(paper.SCENE_GRAPH, reports, others=True)
    assert "planner (2 chosen tasks)" in html and "QMIX + messages (2 chosen tasks, at most 8 steps)" in html
    beside = html[html.index("QMIX + messages") :]
    assert "<td>100.00" not in beside[: beside.index("QTRAN")]
    assert "100.00" not in paper_table(paper.SCENE_GRAPH, reports, others=False)


@pytest.mark.parametrize("part", ["settings", "run", "episodes"])
def test_damaged_results_are_refused(results: Path, tmp_path: Path, part: str) -> None:
    data, path = json.loads((results / "planner.json").read_text()), tmp_path / "damaged.json"
    damaged = [data | {part: content} for content in (None, [], {}, "text", 3)]
    if part == "episodes":
        first, *others = data["episodes"]
        damaged += [
            data | {part: [first | change, *others]} for change in ({"steps": "5"}, {"task": 1}, {"actions": 7})
        ]
        damaged.append(data | {part: others})
    else:
        damaged += [data | {part: {key: value for key, value in data[part].items() if key != name}}
                    for name in data[part] if name not in ("label", "homes_sha256", "policy_sha256")]  # fmt: skip
    for content in damaged:
        path.write_text(json.dumps(content))
        with pytest.raises(ResultError, match=r"damaged\.json: not a whole result"):
            load_result(path)


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
