"""The result of an evaluation and its JSON file, which holds all that is needed to repeat it."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from chmarl_pb.envs.options import SYMBOLS, Options
from chmarl_pb.envs.tracks import PAPER, TRACKS
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.cooperation import Cooperation, cooperation
from chmarl_pb.evaluation.json_file import WRONG, plain, read_object
from chmarl_pb.evaluation.metrics import Played, Summary, of_tasks, summarize, summarize_by, summarize_by_wording
from chmarl_pb.evaluation.provenance import tasks_hash
from chmarl_pb.evaluation.recognition import Recognition, total
from chmarl_pb.files import write_atomically
from chmarl_pb.policies.registry import BUILT_IN, is_told_more
from chmarl_pb.tasks.advisers import STYLES
from chmarl_pb.tasks.splits import SPLITS
from chmarl_pb.tasks.task import Optimum
from chmarl_pb.tasks.tidy_task import AnyTask, task_of

FORMAT = "chmarl-pb result 1"
SUMMARY = "chmarl-pb summary 1"  # of a result without its episodes
#: In ``run``: in how many episodes seats acted alone as they did beside each other; not there where nobody looked.
SEATS_APART = "seats_apart"
_OPTIONS = {one.name for one in fields(Options)} - {"home", "split", "observation"}

#: Options that change no number: all renderers draw the same pictures.
_WITHOUT_EFFECT = {"renderer"}
#: Options that results note in words of their own: in tables, or among what is foreign.
_NOTED_ELSEWHERE = {"goal", "image_size", "max_steps", "task"}
#: Option -> its value in the paper's track; a team that is named at all is another one.
_USUAL: dict[str, Any] = {one.name: one.default for one in fields(Options)} | TRACKS[PAPER] | {"robots": None}
#: Options that a result of another track may lack if it is older than they.
_GIVEN = {name: _USUAL[name] for name in ("pointing", "lookalikes")}
#: Option -> what is said of a value that is not the track's, in this order; empty where it is said elsewhere.
_WORDS: dict[str, Callable[[Any], str]] = {
    "robots": lambda names: f"robots {', '.join(names)}",
    "catalog": lambda path: f"catalog {path}",
    "track": lambda name: f"{name} track",
    "pointing": lambda on: "pointing" if on else "no pointing",
    "lookalikes": lambda on: "lookalikes" if on else "no lookalikes",
    "messages": lambda kind: {True: "message board", SYMBOLS: "own words"}.get(kind, ""),
    "feedback": lambda style: {True: "feedback", STYLES[1]: "planner feedback"}.get(style, ""),
    "templates": lambda number: f"sentences {number}",
}


@dataclass(frozen=True)
class Report:
    """One evaluation of one policy.

    Attributes:
        settings: what fixes the numbers: policy, split, observation, options, seeds, hashes of tasks,
            homes, policy file and source code.
        run: how they came about: versions, machine, command, workers, date, seconds.
        episodes: seed by seed, in the order of the tasks.
    """

    settings: dict[str, Any]
    run: dict[str, Any]
    episodes: tuple[Played, ...]

    @cached_property
    def summary(self) -> Summary:
        """The metrics of all episodes."""
        return summarize(self.episodes)

    @cached_property
    def plw_of_tasks(self) -> dict[AnyTask, float]:
        """Task -> PLW, 0 to 1, the mean of the seeds."""
        return of_tasks(self.episodes, lambda episode: episode.score)

    @cached_property
    def per_home(self) -> dict[str, Summary]:
        """Home -> metrics."""
        return summarize_by(self.episodes, lambda task: task.home)

    @cached_property
    def per_class(self) -> dict[str, dict[str, Summary]]:
        """Role (graspable, target) -> class -> metrics."""
        return {
            "graspable": summarize_by(self.episodes, lambda task: task.graspable),
            "target": summarize_by(self.episodes, lambda task: task.target),
        }

    @cached_property
    def per_wording(self) -> dict[str, Summary]:
        """Wording of the instructions, "seen" in training or "held-out" of it, -> metrics."""
        return summarize_by_wording(self.episodes)

    @property
    def changed(self) -> str:
        """Names of environment, robots, objects and rules that are not the benchmark's own; empty if there are none."""
        given = _GIVEN | self.settings["options"]
        names = [*_WORDS, *sorted(given.keys() - _WORDS.keys() - _NOTED_ELSEWHERE - _WITHOUT_EFFECT)]
        usual = _USUAL | self.rules
        words = [_words(name, given[name]) for name in names if name in given and given[name] != usual[name]]
        return ", ".join(filter(None, [self.foreign, *words]))

    @property
    def track(self) -> str:
        """The track whose rules were played."""
        return str(self.settings["options"].get("track", PAPER))

    @property
    def rules(self) -> dict[str, Any]:
        """The options of the track; what was played may differ."""
        return TRACKS[self.track]

    @property
    def without(self) -> list[str]:
        """What of messages and feedback was switched off, against the rules of the track."""
        options, rules = self.settings["options"], self.rules
        return [name for name in ("messages", "feedback") if rules[name] and not options[name]]

    @property
    def privileged(self) -> bool:
        """Whether the policy is given more than its robots' observations.

        Of built-in ones the file is not asked, but for what sensors of one's own show.
        """
        policy, observation = (str(self.settings[name]) for name in ("policy", "observation"))
        if policy in BUILT_IN and (BUILT_IN[policy].privileged or ":" not in observation):
            return is_told_more(policy, observation)
        return bool(self.settings.get("privileged"))

    @property
    def declared(self) -> str:
        """What the policy was given beyond each robot's own observation; empty if nothing."""
        words = {"is told the truth": self.privileged, "one policy for all robots": self.settings.get("centralized")}
        return ", ".join(text for text, holds in words.items() if holds)

    @property
    def foreign(self) -> str:
        """Names of the environment and of the objects that the settings do not hold; empty if there are none."""
        options = (self.settings["observation"], *self.settings["options"].values())
        names = [self.settings["env"]["name"]] if "env" in self.settings else []
        names += [f"task {name}" for name in (self.settings["options"].get("task"),) if name]
        return ", ".join([*names, *(value for value in options if isinstance(value, str) and ":" in value)])

    @property
    def bounded(self) -> int:
        """Number of the solved episodes whose L* is an upper bound, so that their share of PLW is one, too."""
        return sum(episode.optimum is not None and not episode.optimum.proven for episode in self.episodes)

    @cached_property
    def cooperation(self) -> Cooperation | None:
        """What the policy gets of the possible gain from cooperation; None where there is no reference."""
        if self.changed:
            return None
        return cooperation(self.episodes, self.settings["split"], self.settings["options"]["max_steps"])

    @cached_property
    def recognition(self) -> Recognition:
        """How often robots act on what they see, over all episodes in which that was noted."""
        return total(one.recognition for one in self.episodes if one.recognition)

    @property
    def success_rate(self) -> float:
        """Share of the episodes with success, 0 to 1."""
        return self.summary.success_rate.mean or 0.0

    @property
    def plw(self) -> float:
        """Path-length-weighted score, 0 to 1."""
        return self.summary.plw.mean or 0.0

    @cached_property
    def sha256(self) -> str:
        """Of all that fixes the numbers: settings and episodes."""
        rows = [episode_row(episode) for episode in self.episodes]
        return hashlib.sha256(_json([self.settings, rows]).encode()).hexdigest()

    @property
    def facts(self) -> dict[str, Any]:
        """All of it but the episodes, as plain data."""
        groups = {kind: _plain(summaries) for kind, summaries in self.per_class.items()}
        return {
            "format": SUMMARY,
            "sha256": self.sha256,
            "settings": self.settings,
            "run": self.run,
            "summary": asdict(self.summary),
            "cooperation": asdict(self.cooperation) if self.cooperation else None,
            "recognition": self.recognition.figures(),
            "per_wording": _plain(self.per_wording),
            "per_home": _plain(self.per_home),
            "per_class": groups,
        }

    def save(self, path: Path) -> None:
        """Write the result as JSON, whole or not at all."""
        text = json.dumps({**self.facts, "format": FORMAT}, indent=1)[: -len("\n}")]
        rows = ",\n".join(_json(episode_row(episode)) for episode in self.episodes)
        write_atomically(path, f'{text},\n "episodes": [\n{rows}\n]}}\n')


def is_summary(found: Any) -> bool:
    """Return whether what a JSON file holds is a summary, as ``Report.facts`` is, also of when it had no own format."""
    return isinstance(found, dict) and found.get("format") in (SUMMARY, FORMAT) and "episodes" not in found


def load_result(path: Path | str) -> Report:
    """Read a result; its metrics are computed anew from its episodes.

    Raises:
        ResultError: the file is missing, damaged, or of another kind.
    """
    try:
        data = read_object(path)
        if other := _other_kind(data):
            raise ResultError(f"{path}: is {other}; name one that `chmarl-pb evaluate --out` has written")
        if data["format"] != FORMAT:
            raise ValueError(f"its format is {data['format']!r}, not {FORMAT!r}")
        report = Report(data["settings"], data["run"], tuple(episode_of(row) for row in data["episodes"]))
        _check(report)
        _check_episodes(report)
        if data.get("sha256", report.sha256) != report.sha256:  # the first results had none
            raise ValueError("its checksum is wrong: it was changed or damaged")
        json.dumps(
            report.facts, allow_nan=False, ensure_ascii=False
        ).encode()  # here, where what cannot be counted or shown is still refused
        return report
    except FileNotFoundError as error:
        raise ResultError(f"{path}: no such file; `chmarl-pb evaluate --out` writes results") from error
    except WRONG as error:
        raise ResultError(
            f"{path}: not a whole result of an evaluation: {repr(error)[:300]}; remove it and evaluate again"
        ) from error


def _other_kind(data: dict[str, Any]) -> str:
    """Return what a JSON file is if not a result; "" if it is one, or a damaged one."""
    if is_summary(data):
        return "a summary without episodes, as --json writes it"
    if "format" not in data:
        return "no result of an evaluation"
    kind = str(data["format"])
    return f"of another kind ({kind})" if kind.startswith("chmarl-pb") and kind != FORMAT else ""


def _check(report: Report) -> None:
    """Raise an error if parts that reports show are missing or of another kind."""
    for name in ("policy", "split", "observation", "tasks_sha256", "source_sha256"):
        if not isinstance(report.settings[name], str):
            raise TypeError(f"its {name} is no text")
    if not all(isinstance(text, str) for pair in report.settings["homes_sha256"].items() for text in pair):
        raise TypeError("its homes_sha256 are no texts")
    if others := report.settings["options"].keys() - _OPTIONS:
        raise ValueError(f"it has options that no environment takes: {', '.join(sorted(others))}")
    for name in ("seeds", "tasks"):
        report.settings[name]
    for name in ("messages", "feedback", "max_steps"):
        report.settings["options"][name]
    for name in ("command", "date", "seconds", "workers"):
        report.run[name]
    report.run["versions"].items()
    report.run["machine"]["processor"]
    if report.settings["split"] not in SPLITS:
        raise ValueError(f"unknown split {report.settings['split']!r}")


def _check_episodes(report: Report) -> None:
    """Raise an error unless there is exactly one episode for each task and seed, in their order."""
    jobs = [episode.job for episode in report.episodes]
    tasks, seeds = list(dict.fromkeys(task for task, _ in jobs)), sorted(report.settings["seeds"])
    if not jobs or len(tasks) != report.settings["tasks"] or jobs != [(task, seed) for seed in seeds for task in tasks]:
        raise ValueError(f"it holds {len(jobs)} episodes, not one for each task and seed")
    if tasks_hash(tasks) != report.settings["tasks_sha256"]:
        raise ValueError("its tasks are not those that its settings name")
    options = report.settings["options"]
    usual = not report.foreign and not any(options.get(name) for name in ("robots", "pointing", "lookalikes"))
    if usual and any(episode.optimum and episode.task.optimal_steps for episode in report.episodes):
        raise ValueError("it gives tasks another L* than they have themselves")


def _words(option: str, value: Any) -> str:
    """Return what is said of an option whose value is not the track's."""
    return _WORDS[option](value) if option in _WORDS else f"{option} {value}"


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def episode_row(episode: Played) -> dict[str, Any]:
    """Return an episode as plain data for JSON; L* only where the task does not have it, nothing that is unknown."""
    unknown = {name for name in ("optimum", "instruction", "recognition") if not getattr(episode, name)}
    return {name: value for name, value in asdict(episode).items() if name not in unknown}


def episode_of(row: dict[str, Any]) -> Played:
    """Return the episode of a row that ``episode_row`` made."""
    actions = tuple(tuple(pair) for pair in row["actions"])
    optimum = plain(Optimum(**row["optimum"]), steps=int, proven=bool) if "optimum" in row else None
    counts = Recognition(**row["recognition"]) if "recognition" in row else None
    noted = plain(counts, **dict.fromkeys(asdict(counts), int)) if counts else None
    if not all(type(number) is int for pair in actions for number in (*pair,)):
        raise ValueError("an action is no whole number")
    played = plain(Played(**row), seed=int, steps=int, success=bool, potential=(int, float), instruction=str)
    return replace(played, task=task_of(row["task"]), actions=actions, optimum=optimum, recognition=noted)


def _plain(summaries: dict[str, Summary]) -> dict[str, dict[str, Any]]:
    """Return name -> mean of each metric."""
    return {name: _means(summary) for name, summary in summaries.items()}


def _means(summary: Summary) -> dict[str, Any]:
    figures = asdict(summary)
    return {"episodes": figures.pop("episodes")} | {name: figure["mean"] for name, figure in figures.items()}


def in_order(episodes: Sequence[Played], tasks: Sequence[AnyTask]) -> tuple[Played, ...]:
    """Return episodes seed by seed, in the order of the tasks."""
    place = {task: number for number, task in enumerate(tasks)}
    return tuple(sorted(episodes, key=lambda episode: (episode.seed, place[episode.task])))
