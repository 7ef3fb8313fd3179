"""What makes a data set: everything that its contents depend on, and its name."""

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from chmarl_pb.envs.options import OBSERVATIONS, Options
from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.drawn import draw_tasks, stream_tasks
from chmarl_pb.evaluation.provenance import home_hashes, source_hash, tasks_hash
from chmarl_pb.homes.generate.names import seed_of
from chmarl_pb.homes.home import home_names, home_path
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.tasks.splits import SPLITS, STREAM, load_tasks
from chmarl_pb.tasks.task import Task

NAMESPACE = "chmarl"
_DRAWN = 100  # tasks for a home of the user's, and of the endless split
FORMAT = 0  # of the contents; the version at the end of every data set's id

ENV_IDS = {"scene_graph": "CHMARL/SceneGraph-v0", "visual": "CHMARL/Visual-v0"}


@dataclass(frozen=True)
class Recipe:
    """How a data set is made; two data sets of one recipe are equal, byte by byte.

    Attributes:
        split: the split whose tasks are played, each once, in the order of its file; of "generated", which is endless,
            ``limit`` or 100 tasks are drawn, ten in each home.
        observation: "scene_graph" or "visual".
        noise: probability of a random action, for each robot and step: 0, 0.01, ... 1.
        seed: of the random actions, and of what tasks are drawn.
        limit: number of tasks, from the first; None plays all.
        robots: see :class:`chmarl_pb.envs.options.Options`, but no objects; files are kept by their whole paths.
        home: name of a home, or path of one, which is kept whole, for which tasks are drawn in place of the split's,
            ``limit`` or 100 of them.
        catalog: catalogue file of own things; None: the one that ``CHMARL_CATALOG`` names, if any.
    """

    split: str = "train"
    observation: str = "scene_graph"
    noise: float = 0.0
    seed: int = 0
    limit: int | None = None
    robots: tuple[str, ...] = TEAM
    home: str | None = None
    catalog: str | None = None

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            OptionError: an option has a value that it does not know.
            AssetError: there is no such robot.
            HomeError: there is no such home.
        """
        team_of(self.robots)
        catalog = Options(catalog=self.catalog).catalog
        object.__setattr__(self, "catalog", None if catalog is None else str(Path(catalog).resolve()))
        robots = (str(Path(robot).resolve()) if Path(robot).suffix else robot for robot in self.robots)  # else a name
        object.__setattr__(self, "robots", tuple(robots))
        if self.home is not None and self.home not in home_names() and seed_of(self.home) is None:
            object.__setattr__(self, "home", str(home_path(self.home)))
        for name, value, known in (
            ("split", self.split, SPLITS),
            ("observation", self.observation, OBSERVATIONS),
        ):
            if value not in known:
                raise OptionError(f"{name} {value!r} is not known; use one of: {', '.join(known)}")
        if not 0 <= self.noise <= 1 or round(100 * self.noise) != round(100 * self.noise, 9):
            raise OptionError(f"noise {self.noise}: use whole per cents from 0 to 1, like 0.2")
        if self.seed < 0:
            raise OptionError(f"seed {self.seed}: use 0 or more")
        if self.limit is not None and self.limit < 1:
            raise OptionError(f"limit {self.limit}: use at least 1")

    @property
    def dataset_id(self) -> str:
        """Minari's name, e.g. ``chmarl/scene-graph-train-v0`` or ``chmarl/visual-train-noise20-v0``.

        Other robots than the benchmark's are named, too: ``chmarl/visual-train-humanoid-drone-drone-v0``.
        """
        robots = "" if self.robots == TEAM else "".join(map(_word, self.robots))
        noise = f"-noise{round(100 * self.noise)}" if self.noise else ""
        own = "".join(_word(file) for file in (self.home, self.catalog) if file)
        return f"{NAMESPACE}/{self.observation.replace('_', '-')}-{self.split}{noise}{robots}{own}-v{FORMAT}"

    @property
    def env_id(self) -> str:
        """The joint Gymnasium environment that the data set is recorded in."""
        return ENV_IDS[self.observation]

    @property
    def tasks(self) -> list[Task]:
        """The tasks, one for each episode, in order."""
        return self._all_tasks[: self.limit]

    @property
    def _all_tasks(self) -> list[Task]:
        count = self.limit or _DRAWN
        if self.home is not None:
            return [*draw_tasks(self.home, count, self.seed, catalog=self.catalog, robots=self.robots)]
        if self.split == STREAM:
            return [*stream_tasks(count, self.seed, catalog=self.catalog, robots=self.robots)]
        return load_tasks(self.split)

    def facts(self) -> dict[str, Any]:
        """Return everything that the contents depend on, but the code.

        The version of the package is left out: whatever changes the contents raises ``FORMAT``.
        """
        options = asdict(self) | {"robots": list(self.robots)}
        if self.robots == TEAM:  # as in data sets from before there was a choice
            del options["robots"]
        for name in ("home", "catalog"):
            if options[name] is None:
                del options[name]
        if self.catalog is not None:
            options["catalog_sha256"] = Options(catalog=self.catalog).things.content
        return {
            **options,
            "noise": float(self.noise),
            "format": FORMAT,
            "max_steps": MAX_STEPS,
            "tasks_sha256": tasks_hash(self.tasks),
            "homes_sha256": home_hashes(self.tasks),
        }

    def differing(self, stored: dict[str, Any]) -> list[str]:
        """Return the names of the facts in which another recipe, as a data set keeps it, differs from this one."""
        facts = self.facts()
        names = sorted((facts.keys() | stored.keys()) - {"version"})  # which 0.1.0 kept among them
        return [name for name in names if facts.get(name) != stored.get(name)]

    def key(self) -> str:
        """Return a short text that another recipe or another code would not have."""
        tasks = tasks_hash(self._all_tasks)  # of all, so that episodes serve a higher limit as well
        facts = {**self.facts(), "limit": None, "tasks_sha256": tasks, "source": source_hash()}
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


def _word(file: str) -> str:
    """Return a file's name as part of a data set's: Minari takes letters, digits and underscores there."""
    return "-" + re.sub(r"\W", "_", Path(file).stem, flags=re.ASCII)


def is_dataset_name(name: str) -> bool:
    """Return whether a folder's name is one that :attr:`Recipe.dataset_id` gives."""
    modes, splits = ("|".join(names).replace("_", "-") for names in (OBSERVATIONS, SPLITS))
    return re.fullmatch(rf"({modes})-({splits})(-noise\d+)?(-\w+)*-v{FORMAT}", name, re.ASCII) is not None
