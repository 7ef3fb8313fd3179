"""A row of the tables: what is trained, and where its results belong."""

from dataclasses import dataclass

from chmarl_pb.envs.tracks import HEADLINE_SPLITS, PAPER, TRACKS
from chmarl_pb.evaluation import paper

#: Name of the table of clones that learn in limited layouts (chmarl_pb/tasks/own_places.py), their data set, and the
#: splits that they are scored on: homes seen with objects where they always lie, or elsewhere, then two unseen homes.
LIMITED, LIMITED_DATA = "limited", "train-limited"
LIMITED_SCORED = ("test-limited", "test-seen", "val-unseen", "test-unseen")


@dataclass(frozen=True)
class Row:
    """One row: a learner in one setting, to be trained with several seeds.

    Attributes:
        name: as in the paper's tables.
        observation: "scene_graph" or "visual".
        options: of the training command that tell it from other learners.
        messages: whether the robots hear each other.
        feedback: whether they get language feedback.
        published: the paper's numbers; None: the paper has no such row.
        module: that trains; it takes ``--observation``, ``--messages``, ``--feedback``, ``--seed`` and ``--out`` beside
            the options, and goes on with an interrupted run.
        checkpoint: file of the run's folder with the weights that were best on the validation tasks.
        seeds: trainings that the table wants of it.
        image_encoder: the frozen network that encodes pictures, if there are any.
        track: rules of the environment; in the grounded track messages are own words, and there is no feedback.
    """

    name: str
    observation: str
    options: tuple[str, ...]
    messages: bool
    feedback: bool = True
    published: paper.Row | None = None
    module: str = "training.train"
    checkpoint: str = "best.pt"
    seeds: int = 3
    image_encoder: str = "resnet18"
    track: str = PAPER

    @property
    def table(self) -> str:
        """Name of the table that the row is at home in, and of its folders."""
        if self.track != PAPER:
            return self.track
        if self.data == LIMITED_DATA:
            return LIMITED
        return self.observation.replace("_", "-") if self.feedback else "feedback"

    @property
    def slug(self) -> str:
        """Short name, unique in its table, e.g. ``qmix-messages`` or ``visual-qmix-no-feedback``."""
        words = self.name.lower().replace("+ ", "").replace(",", "").split()
        if self.track != PAPER:
            words = [SEEN[self.observation], *words]
        elif not self.feedback:
            words = [*self.observation.split("_"), *words, "no", "feedback"]
        return "-".join(words)

    @property
    def setting(self) -> str:
        """The learner, and what robots observe and are told, e.g. "QMIX, graphs: messages + feedback"."""
        told = [word for word, on in (("messages", self.messages), ("feedback", self.feedback)) if on]
        return f"{self.name.removesuffix(' + messages')}, {SEEN[self.observation]}: {' + '.join(told) or 'neither'}"

    @property
    def splits(self) -> tuple[str, ...]:
        """The splits that it is evaluated on."""
        return splits_of(self.table)

    @property
    def rules(self) -> tuple[str, ...]:
        """Options of the training command that name the rules; ids of Gymnasium have their track."""
        if self.track != PAPER and self.module == "training.train":
            return "--track", self.track
        return _switch("messages", self.messages), _switch("feedback", self.feedback)

    @property
    def robots(self) -> str:
        """The team, with commas between; "" if it is the usual one."""
        return self.options[self.options.index("--robots") + 1] if "--robots" in self.options else ""

    @property
    def clones(self) -> bool:
        """Whether it learns from stored episodes."""
        return self.options[:2] == ("--algo", "bc")

    @property
    def data(self) -> str:
        """The split whose stored episodes it learns from, if it does; "" if not."""
        if not self.clones:
            return ""
        return self.options[self.options.index("--split") + 1] if "--split" in self.options else "train"


def splits_of(table: str) -> tuple[str, ...]:
    """Return the splits that the rows of a table are evaluated on."""
    if table == LIMITED:
        return LIMITED_SCORED
    return (HEADLINE_SPLITS[table],) if table in TRACKS else paper.SPLITS


def _switch(name: str, on: bool) -> str:
    return f"--{name}" if on else f"--no-{name}"


#: Observation -> what it is called in names.
SEEN = {"scene_graph": "graphs", "visual": "pictures"}

#: Trainings of a row: pictures take about three times as long as scene graphs.
SEEDS = {"scene_graph": 3, "visual": 2}

#: Options of the encoder that ties words to things; none does by itself (docs/training_encoders.md).
GROUNDED_ENCODER = ("--graph-pool", "grounded", "--word-vectors", "--grounding-coef", "1", "--numbers-past")
#: The same, but instructions are read by the rule that the belief search, too, reads them by.
PARSED_ENCODER = ("--graph-pool", "parsed", "--word-vectors", "--numbers-past")

#: What the imitator remembers beside its GRU, and that it learns in every second rollout from how it plays in
#: evaluation (docs/training_findings.md#why-it-stops-short): part -> its options.
MEMORY = {"looks": ("--looks-past",), "history": ("--history-past",), "greedy rollouts": ("--greedy-share", "0.5")}

#: What value factorisation learns by where episodes are few, and how many it gets in our longer rows of the paper's
#: learners, whose networks are the paper's; chosen on validation tasks (docs/training_findings.md).
LONGER = (
    "--episodes", "12000", "--envs", "16", "--gradient-steps", "16", "--td-lambda", "0.6", "--tau", "0.01",
    "--target-update-interval", "1",
)  # fmt: skip
