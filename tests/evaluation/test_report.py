import json
import re
from collections.abc import Callable
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("matplotlib")

from chmarl_pb.cli import main
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation import paper, plots, tables
from chmarl_pb.evaluation import report as pages
from chmarl_pb.evaluation.cooperation import reference_scores
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.episode_file import load_episode, replay_episode
from chmarl_pb.evaluation.groups import grouped
from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.plots import bar_rows, solved_within
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.provenance import tasks_hash
from chmarl_pb.evaluation.replays import replays
from chmarl_pb.evaluation.report import write_report
from chmarl_pb.evaluation.result import Report, load_result
from chmarl_pb.evaluation.tables import paper_table, title_of
from chmarl_pb.policies.registry import SHORTCUTS
from chmarl_pb.tasks.splits import load_tasks

TASKS = load_tasks("test-unseen")[:2]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    evaluate("planner", tasks=TASKS, workers=1, out=folder / "planner.json")
    evaluate("random", tasks=TASKS, workers=1, max_steps=8, out=folder / "random.json")
    evaluate("random", tasks=TASKS, workers=1, max_steps=8, out=folder / "qmix.json", label="QMIX + messages")
    one = load_result(folder / "random.json")
    replace(one, run={**one.run, "label": "<b>QMIX</b>"}).save(folder / "random.json")  # as older results may have
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


def whole(report: Report, **options: Any) -> Report:
    """Return a result as if it were of all tasks, with other options, of a policy that is told no more than others."""
    whole_split = tasks_hash(load_tasks(report.settings["split"]))
    settings = report.settings | {"tasks_sha256": whole_split, "privileged": False, "policy": "mine"}
    return replace(report, settings=settings | {"options": settings["options"] | options})


def seed_of(report: Report, plw: float, **changes: str) -> Report:
    """Return a result with a PLW of so many per cent, as another training seed would have it."""
    first = report.episodes[0]
    scored = replace(
        first, task=replace(first.task, optimal_steps=100_000), steps=round(10_000_000 / plw), success=True
    )
    report = replace(report, episodes=(scored,), settings=report.settings | changes)
    assert abs(100 * report.plw - plw) < 0.01
    return report


def test_results_of_one_title_make_one_bar_at_their_mean(results: Path) -> None:
    one = whole(load_result(results / "planner.json"))
    reports = [seed_of(one, 16.5), seed_of(one, 51.0), seed_of(one, 80.0, observation="visual")]
    reports.append(seed_of(whole(one, feedback="planner"), 90.0))
    reports.append(seed_of(one, 70.0, split="val-seen"))
    rows = {
        observation: bar_rows(
            [group for group in grouped(reports) if group.observation == observation],
            lambda report: report.plw, lambda report: report.summary.plw,
        )
        for observation in ("scene_graph", "visual")
    }  # fmt: skip
    bar = rows["scene_graph"]["mine"]["test-unseen"]
    assert bar.mean == pytest.approx(33.75, abs=0.01) and bar.points == pytest.approx((16.5, 51.0), abs=0.01)
    assert bar.low is None  # their spread is what counts
    assert rows["visual"]["mine"]["test-unseen"].mean == pytest.approx(80, abs=0.01)
    assert rows["scene_graph"]["mine (changed: planner feedback)"]["test-unseen"].mean == pytest.approx(90, abs=0.01)
    assert sorted(len(bars) for bars in rows["scene_graph"].values()) == [1, 1, 1]  # of val-seen it is not whole


def test_a_bar_is_drawn_where_its_mean_is(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = whole(load_result(results / "planner.json"))
    kept = Kept(plots._svg)
    monkeypatch.setattr(plots, "_svg", kept)
    plots.score_bars(grouped([seed_of(one, 16.5), seed_of(one, 51.0)]), {"test-unseen": {"blind": 0.4}})
    (axes,) = kept.figure.axes
    assert [patch.get_width() for patch in axes.patches] == pytest.approx([33.75], abs=0.01)
    assert "blind" in [text.get_text() for text in axes.texts]


class Kept:
    """Keeps the figure that is drawn last."""

    def __init__(self, draw: Callable[[Any], str]):
        self.draw = draw

    def __call__(self, figure: Any) -> str:
        self.figure = figure
        return self.draw(figure)


def test_curves_are_means_over_the_results_of_a_title(results: Path) -> None:
    one = load_result(results / "planner.json")
    failed = replace(one, episodes=tuple(replace(episode, success=False) for episode in one.episodes))
    _, shares = solved_within(grouped([one, failed])[0])
    assert shares[0] == 0 and shares[-1] == 50


def test_a_gain_of_exactly_nothing_has_a_bar_too(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = load_result(results / "planner.json")
    gain = SimpleNamespace(share=0.0)
    monkeypatch.setattr(Report, "cooperation", property(lambda report: gain))

    def share(report: Report) -> float | None:
        return report.cooperation.share if report.cooperation else None

    rows = bar_rows(grouped([one]), share, lambda report: Figure(None))
    assert next(iter(rows.values()))["test-unseen"].mean == 0
    assert "<svg" in plots.cooperation_bars(grouped([one]))


def test_other_options_stand_beside_nothing(results: Path) -> None:
    row = next(row for row in paper.SCENE_GRAPH.rows if row.name == "QMIX + messages")
    one = load_result(results / "qmix.json")
    good = whole(one, max_steps=28)
    assert tables._stands_beside(row, good)
    for options in ({"feedback": "planner"}, {"messages": False}, {"goal": True}, {"max_steps": 56}):
        assert not tables._stands_beside(row, whole(good, **options))
        assert title_of(whole(good, **options)) != title_of(good)


@pytest.mark.parametrize(
    ("name", "given", "stands"),
    [
        ("QMIX + messages", {"privileged": True}, False),
        ("QMIX + messages", {"centralized": True}, False),
        ("BC decentralized + messages", {"centralized": True}, False),
        ("BC centralized", {"centralized": True}, True),
        ("BC centralized", {"centralized": True, "privileged": True}, False),
    ],
)
def test_who_is_told_more_than_the_papers_learner_stands_in_a_row_of_its_own(
    results: Path, name: str, given: dict[str, bool], stands: bool
) -> None:
    row = next(row for row in paper.SCENE_GRAPH.rows if row.name == name)
    one = whole(load_result(results / "qmix.json"), max_steps=28, messages=row.messages)
    one = replace(one, settings=one.settings | given, run=one.run | {"label": name})
    assert tables._stands_beside(row, one) == stands
    html = paper_table(paper.SCENE_GRAPH, [one], others=True)
    assert (f"<th>{title_of(one)}</th>" in html) != stands


_OTHER = {
    "messages": False, "feedback": "planner", "max_steps": 9, "image_size": 32, "execution": "simulated", "goal": True,
    "task": "tidy", "renderer": "tiny", "robots": ["drone", "humanoid"], "catalog": "mine.toml", "pointing": True,
    "lookalikes": True, "templates": 2, "track": "grounded",
}  # fmt: skip


def test_whatever_option_may_change_numbers_sets_results_apart(results: Path) -> None:
    recorded = {option.name for option in fields(Options)} - {"home", "render_mode", "split", "observation"}
    assert recorded == _OTHER.keys(), "give the new option another value here, and let results note it"
    one = load_result(results / "qmix.json")
    one = replace(one, settings=one.settings | {"observation": "depth"})
    for name, value in _OTHER.items():
        settings = one.settings | {"options": one.settings["options"] | {name: value}}
        groups = grouped([one, replace(one, settings=settings)])
        assert len(groups) == (1 if name == "renderer" else 2), name  # which draws the same pictures


@pytest.mark.parametrize(("observation", "count"), [("scene_graph", 1), ("text", 1), ("scene_graph+depth", 2)])
def test_the_size_of_pictures_counts_where_there_are_any(results: Path, observation: str, count: int) -> None:
    one = load_result(results / "qmix.json")
    sizes = [one.settings["options"] | {"image_size": pixels} for pixels in (32, 64)]
    settings = [one.settings | {"observation": observation, "options": options} for options in sizes]
    groups = grouped([replace(one, settings=changed) for changed in settings])
    assert len(groups) == count and ("px" in groups[0].title) == (count == 2)


def test_styles_of_feedback_do_not_merge_in_a_track_without_any(results: Path) -> None:
    one = load_result(results / "qmix.json")
    grounded = one.settings["options"] | {"track": "grounded", "messages": "symbols", "pointing": True}
    given = [one.settings | {"options": grounded | {"feedback": style}} for style in (False, True, "planner")]
    assert len(grouped([replace(one, settings=settings) for settings in given])) == 3


def test_several_versions_of_the_source_in_a_row_are_said(results: Path, tmp_path: Path) -> None:
    one = load_result(results / "qmix.json")
    other = replace(one, settings=one.settings | {"source_sha256": "!<b>" + 60 * "0"})
    for reports, said in (([one, one], False), ([one, other], True)):
        page = pages.page(reports, tmp_path)
        versions = f"by 2 versions of the source: !&lt;b&gt;0000, {one.settings['source_sha256'][:8]}"
        assert (f"2 results {versions}" in page) == said
        assert (f"ours<br><small>{versions}</small>" in page) == said


def test_what_needs_no_eyes_stands_in_every_table_of_results(results: Path) -> None:
    for table in (paper.SCENE_GRAPH, paper.VISUAL):
        html = paper_table(table, [], others=True)
        for name, (success, plw) in reference_scores("test-unseen", MAX_STEPS).items():
            if name in (*SHORTCUTS, "search"):
                row = html[html.index(f"<th>{name}<") :]
                assert f"<td>{100 * success:.2f}<" in row and f"<td>{100 * plw:.2f}<" in row
        assert "blind" in html and "built in" in html


def test_wide_tables_and_plots_scroll_in_boxes_of_their_own(page: str) -> None:
    assert re.search(r"\.wide \{[^}]*overflow-x: auto", page)
    rest = re.sub(
        r"""<div class=['"](?:wide|wide plot|scroll)['"]>.*?</(?:table|svg)>\s*</div>""", "", page, flags=re.S
    )
    assert "<table" not in rest and page.count("<table") > 5
    assert not re.search(r"<svg(?! class=.plan)", rest)


def test_each_replay_has_a_file_of_its_own(tmp_path: Path) -> None:
    reports = [evaluate("search", tasks=TASKS[:1], seeds=(0,), workers=1, messages=on) for on in (True, False)]
    html = replays(reports, tmp_path / "episodes")
    links = re.findall(r'href="([^"]+)"', html)
    assert len(links) == len(set(links)) == 2
    messages = {load_episode(tmp_path / link).options["messages"] for link in links}
    assert messages == {True, False}


def test_a_replay_stays_in_its_folder(tmp_path: Path) -> None:
    report = evaluate("search", tasks=[replace(TASKS[0], id="../../mine")], seeds=(0,), workers=1)
    (link,) = re.findall(r'href="([^"]+)"', replays([report], tmp_path / "sub" / "episodes"))
    assert [path.parent.name for path in tmp_path.rglob("*.json")] == ["episodes"] and "mine" in link


def test_scores_by_other_rules_have_no_line_of_the_papers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[Any] = []

    def bars(groups: Any, blind: Any) -> str:
        lines.append(list(blind))
        return ""

    monkeypatch.setattr(pages, "score_bars", bars)
    others: tuple[dict[str, Any], ...] = ({"pointing": True}, {"max_steps": 8})
    for number, options in enumerate(({}, *others)):
        evaluate("random", tasks=TASKS, seeds=[0], workers=1, out=tmp_path / str(number) / "r.json", **options)
        write_report([tmp_path / str(number)], tmp_path / "page.html")
    assert lines == [["test-unseen"], [], []]


def test_a_label_puts_a_result_beside_the_papers(results: Path) -> None:
    one = evaluate("planner", tasks=TASKS[:1], workers=1, label="qmix + messages")
    assert "1 chosen tasks" in title_of(one)
    report = whole(one)
    html = paper_table(paper.SCENE_GRAPH, [report], others=True)
    beside = html[html.index("QMIX + messages") :]
    assert "100.00" in beside[: beside.index("QTRAN")]
    assert "100.00" not in paper_table(paper.VISUAL, [report], others=True)


def test_results_in_other_homes_stand_in_no_table_of_the_paper(small_home: Path) -> None:
    report = evaluate("planner", tasks=draw_tasks(str(small_home), 2), workers=1)
    assert "in small" in title_of(report)
    for others in (True, False):
        assert "100.00" not in paper_table(paper.SCENE_GRAPH, [report], others)
    assert "<td>small</td>" in tables.result_table([report]) and "test-unseen" not in tables.result_table([report])


def test_a_result_in_a_home_that_is_gone_is_shown_without_its_replay(small_home: Path, tmp_path: Path) -> None:
    evaluate("planner", tasks=draw_tasks(str(small_home), 2), workers=1, out=tmp_path / "small.json")
    small_home.unlink()
    write_report([tmp_path / "small.json"], tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "small.urdf: no such home" in page and "small, scene graph" in page
    assert "test-unseen, scene graph" not in page


def test_what_is_no_result_of_the_benchmark_stands_beside_nothing(results: Path) -> None:
    reports = [load_result(results / f"{name}.json") for name in ("planner", "qmix")]
    html = paper_table(paper.SCENE_GRAPH, reports, others=True)
    assert re.search(r"planner \(2 chosen tasks: \w{4}, is told the truth\)", html)
    assert re.search(r"QMIX \+ messages \(2 chosen tasks: \w{4}, at most 8 steps\)", html)
    beside = html[html.index("QMIX + messages") :]
    assert "<td>100.00" not in beside[: beside.index("QTRAN")]
    assert "100.00" not in paper_table(paper.SCENE_GRAPH, reports, others=False)


@pytest.mark.parametrize("part", ["settings", "run", "episodes"])
def test_damaged_results_are_refused(results: Path, tmp_path: Path, part: str) -> None:
    data, path = json.loads((results / "planner.json").read_text()), tmp_path / "damaged.json"
    wrong: tuple[Any, ...] = (None, [], {}, "text", 3)
    damaged = [data | {part: content} for content in wrong]
    if part == "episodes":
        first, *others = data["episodes"]
        damaged += [
            data | {part: [first | change, *others]} for change in ({"steps": "5"}, {"task": 1}, {"actions": 7})
        ]
        damaged.append(data | {part: others})
    else:
        damaged += [data | {part: {key: value for key, value in data[part].items() if key != name}}
                    for name in data[part]
                    if name not in ("label", "policy_sha256", "deterministic")]  # fmt: skip
    if part == "settings":
        kinds: tuple[dict[str, Any], ...] = (
            {"observation": 3},
            {"source_sha256": []},
            {"homes_sha256": {"home_6": 1}},
        )
        own: list[dict[str, Any]] = [data[part] | other for other in kinds]
        own += [data[part] | {"options": data[part]["options"] | {name: 1}} for name in ("home", "wings")]
        damaged += [{key: value for key, value in data.items() if key != "sha256"} | {part: one} for one in own]
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
