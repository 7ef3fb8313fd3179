"""The rows of the tables as data: what is trained, and which row of the paper it stands beside."""

from dataclasses import dataclass

from chmarl_pb.envs.tracks import GROUNDED, HEADLINE_SPLITS, PAPER, TRACKS
from chmarl_pb.evaluation import paper

#: Name of the table of clones that learn in limited layouts (chmarl_pb/tasks/own_places.py), their data set, and the
#: splits that they are scored on: homes seen with objects where they always lie, or elsewhere, then two unseen homes.
LIMITED, LIMITED_DATA = "limited", "train-limited"
LIMITED_SPLITS = ("test-limited", "test-seen", "val-unseen", "test-unseen")


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
            words = [_SEEN[self.observation], *words]
        elif not self.feedback:
            words = [*self.observation.split("_"), *words, "no", "feedback"]
        return "-".join(words)

    @property
    def setting(self) -> str:
        """The learner, and what robots observe and are told, e.g. "QMIX, graphs: messages + feedback"."""
        told = [word for word, on in (("messages", self.messages), ("feedback", self.feedback)) if on]
        return f"{self.name.removesuffix(' + messages')}, {_SEEN[self.observation]}: {' + '.join(told) or 'neither'}"

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
        return LIMITED_SPLITS
    return (HEADLINE_SPLITS[table],) if table in TRACKS else paper.SPLITS


def _switch(name: str, on: bool) -> str:
    return f"--{name}" if on else f"--no-{name}"


_SEEN = {"scene_graph": "graphs", "visual": "pictures"}

#: Trainings of a row: pictures take about three times as long as scene graphs.
_SEEDS = {"scene_graph": 3, "visual": 2}
#: Rows of the paper's ablation of feedback, which have three trainings on pictures, too.
_ABLATED = {row.name for row in paper.FEEDBACK.rows}


def _row(published: paper.Row) -> Row:
    """Return the row that stands beside one of the paper."""
    words = published.name.lower().split()
    options = ("--algo", words[0], *(["--centralized"] if "centralized" in words else []))
    return Row(
        published.name, published.observation, options, "messages" in words, published.feedback, published,
        seeds=3 if published.name in _ABLATED else _SEEDS[published.observation],
    )  # fmt: skip


def _isolated(observation: str) -> tuple[Row, ...]:
    """Return QMIX with and without messages and feedback, in all four combinations; the paper lacks the last."""
    main = paper.SCENE_GRAPH if observation == "scene_graph" else paper.VISUAL
    published = [row for row in paper.FEEDBACK.rows if row.observation == observation]
    published += [row for row in main.rows if row.name == "QMIX"]
    neither = Row(
        "QMIX",
        observation,
        ("--algo", "qmix"),
        messages=False,
        feedback=False,
        seeds=3 if observation == "scene_graph" else 1,
    )
    return (*map(_row, published), neither)


_SB3 = {"PPO": "ppo", "A2C": "a2c", "DQN": "dqn", "QR-DQN": "qr-dqn", "Recurrent PPO": "recurrent-ppo"}


def _sb3(learner: str, words: str, observation: str, *options: str) -> Row:
    """Return the row of an algorithm of Stable-Baselines3."""
    given = ("--algo", _SB3[learner], *options, "--workers", "1")
    module, file, seeds = "training.sb3", "best.zip", _SEEDS[observation]
    return Row(f"{learner}, {words}", observation, given, True, module=module, checkpoint=file, seeds=seeds)


def _encoded(learner: str, words: str, observation: str) -> Row:
    """Return a row that reads an encoder alone; the drone beside a lone humanoid is that of the older ids."""
    kind, steps = {"scene_graph": ("SceneGraph", "200000"), "visual": ("Visual", "100000")}[observation]
    env = ("--env", f"CHMARL/{kind}Humanoid-v0") if words == _ALONE else ()
    encoder = ("--image-encoder", "resnet18") if observation == "visual" else ()
    setting = ("--preset", "encoder", "--envs", "8", "--steps", steps)
    return _sb3(learner, words, observation, *env, *setting, *encoder)


def _goal(learner: str, words: str) -> Row:
    """Return a row that observes the goal, and nothing but numbers, which are the same with graphs and pictures."""
    alone = ("--humanoid-only",) if words == _ALONE else ()
    setting = ("--preset", "goal", "--envs", "16", "--steps", _STEPS[learner])
    return _sb3(learner, f"{words}, goal observed", "scene_graph", *alone, *setting)


_BOTH, _ALONE = "both robots", "humanoid only"
_STEPS = {"PPO": "1000000", "Recurrent PPO": "1000000", "A2C": "1000000", "DQN": "500000", "QR-DQN": "500000"}

#: Stable-Baselines3: one network for both robots, or for the humanoid alone; then the presets that observe the goal.
BASELINES = (
    *(
        _encoded(learner, words, observation)
        for observation in ("scene_graph", "visual")
        for words in (_BOTH, _ALONE)
        for learner in ("PPO", "A2C", "DQN", "Recurrent PPO")
    ),
    _goal("PPO", _BOTH),
    *(_goal(learner, _ALONE) for learner in _SB3),
)


#: What our learner reads with where nothing that it sees can be tied to words, as features of ResNet-18.
_READING = ("--word-vectors", "--numbers-past")


#: What it reads with elsewhere, of which none by itself ties words to things (docs/training_encoders.md).
_GROUNDED = ("--graph-pool", "grounded", "--word-vectors", "--grounding-coef", "1", "--numbers-past")


#: The same, but instructions are read by the rule that the belief search, too, reads them by.
_PARSED = ("--graph-pool", "parsed", "--word-vectors", "--numbers-past")


def _ours(expert: str, observation: str, *options: str) -> Row:
    """Return our learner, which sees pictures by the detector, after an expert."""
    given = ("--algo", "dagger-mappo", "--imitation.expert", expert, *options)
    name, seeds = f"Imitation of {expert}, then MAPPO", _SEEDS[observation]
    return Row(name, observation, given, True, seeds=seeds, image_encoder="detector")


def _imitator(
    observation: str,
    homes: str,
    *options: str,
    expert: str = "belief",
    feedback: bool = True,
    reading: tuple[str, ...] = _GROUNDED,
    eyes: str = "detector",
    seeds: int = 3,
) -> Row:
    """Return what imitation of an expert alone brings in some homes; ``eyes`` encode pictures, if there are any."""
    seeing = ("--image-encoder", eyes) if observation == "visual" else ()
    given = ("--algo", "imitation", "--expert", expert, *reading, *seeing, *options)
    return Row(f"Imitation of {expert}{homes}", observation, given, True, feedback, seeds=seeds, image_encoder=eyes)


def _in_generated_homes(observation: str, feedback: bool = True) -> Row:
    """Return our strongest learner, with or without feedback in its training and at test."""
    homes, seeds = ", generated homes", 3 if feedback else 1
    return _imitator(observation, homes, "--split", "generated", feedback=feedback, seeds=seeds)


def _told(observation: str) -> Row:
    """Return the same learner where it need not learn to read."""
    return _imitator(observation, ", generated homes, words parsed", "--split", "generated", reading=_PARSED)


#: What value factorisation learns by where episodes are few, and how many it gets in our longer rows of the paper's
#: learners, whose networks are the paper's; chosen on validation tasks (docs/training.md).
_LONGER = (
    "--episodes", "12000", "--envs", "16", "--gradient-steps", "16", "--td-lambda", "0.6", "--tau", "0.01",
    "--target-update-interval", "1",
)  # fmt: skip


def _longer(name: str) -> Row:
    """Return one of the paper's learners, with its encoder and messages, stronger settings and more episodes."""
    return Row(f"{name} + messages, longer", "scene_graph", ("--algo", name.lower(), *_LONGER), messages=True)


def _grounded_qmix(homes: str, *options: str) -> Row:
    """Return QMIX with the same settings, the encoder that ties words to things, and a nearer horizon."""
    given = ("--algo", "qmix", *_LONGER, "--gamma", "0.9", *_GROUNDED, *options)
    return Row(f"QMIX + messages, grounded{homes}", "scene_graph", given, messages=True)


def _grounded_clone(messages: bool, *options: str) -> Row:
    """Return decentralized clones of the planner, with the encoder that ties words to things."""
    name = f"BC decentralized{' + messages' * messages}, grounded"
    return Row(name, "scene_graph", ("--algo", "bc", *_GROUNDED, *options), messages)


#: Twice the episodes, three times the gradient steps after each, at a rate that falls.
_MORE = ("--episodes", "6000", "--gradient-steps", "12", "--anneal", "0.5")


def _from_scratch(name: str) -> Row:
    """Return a learner from scratch that the paper does not have, with the encoder that ties words to things."""
    given = ("--algo", name.lower(), "--episodes", "12000", *_GROUNDED)
    return Row(f"{name} + messages", "scene_graph", given, True)


#: Rows that the paper has no counterpart of, shown below its rows in the table of their observation.
OURS: tuple[Row, ...] = (
    *map(_grounded_clone, (False, True)),
    *map(_longer, ("IQL", "VDN", "QMIX", "QTRAN")),
    _grounded_qmix(""),
    _grounded_qmix(", generated homes", "--split", "generated"),
    *map(_from_scratch, ("PQN", "MAPPO")),
    *(_ours("belief", observation, *_GROUNDED) for observation in _SEEDS),
    *(_ours("search", observation) for observation in _SEEDS),
    *(_imitator("scene_graph", "", expert=expert) for expert in ("planner", "search", "belief")),
    *map(_in_generated_homes, _SEEDS),
    _imitator(
        "visual", ", generated homes, ResNet-18", "--split", "generated", reading=_READING, eyes="resnet18", seeds=2
    ),
    *map(_told, _SEEDS),
    _imitator("scene_graph", ", generated homes, longer", "--split", "generated", *_MORE),
    *BASELINES,
)


#: Published weights of the imitators of the grounded track.
_IMITATORS = {"scene_graph": "ours-grounded", "visual": "ours-grounded-pictures"}


def _grounded(observation: str) -> tuple[Row, ...]:
    """Return the rows of the grounded track: nothing is told but what robots see, read and hear.

    Budgets are what fits: a core plays some 60 joint steps a second with an expert and 150 without, and an episode has
    up to 28; so 12,000 episodes are some 40 minutes of playing alone. On pictures, which all rows see by the same
    detector, each has 4,000 episodes, or as many steps. MAPPO goes on from the published weights of the imitator, those
    of the row above with seed 0.
    """
    graphs = observation == "scene_graph"

    def episodes(of_graphs: int) -> tuple[str, str]:
        return "--episodes", str(of_graphs if graphs else 4000)

    seeing = () if graphs else ("--image-encoder", "detector")
    pointing = ("--cells-past", "--history-past", *_GROUNDED, *seeing)
    env = f"CHMARL/Grounded{'SceneGraph' if graphs else 'Visual'}Humanoid-v0"
    ppo = ("--algo", "ppo", "--env", env, "--preset", "encoder", "--workers", "1")
    ppo += ("--steps", "150000" if graphs else "100000", *seeing)
    start = f"results/weights/{_IMITATORS[observation]}.pt"
    rows = {
        "QMIX": ("--algo", "qmix", *episodes(12000), *seeing),
        "MAPPO": ("--algo", "mappo", *episodes(6000), *_GROUNDED, *seeing),
        "Imitation of belief": (
            "--algo", "imitation", "--expert", "belief", *episodes(6000), "--gradient-steps", "12",
            "--anneal", "0.5", *pointing
        ),
        "Imitation of belief, then MAPPO": (
            "--algo", "mappo", "--start", start, *episodes(8000), "--envs", "16", "--buffer-size", "256",
            "--learning-rate", "3e-4", "--ent-coef", "0.003", *pointing,
        ),
    }  # fmt: skip
    seeds = {"Imitation of belief": 2} if graphs else {}
    learners = tuple(
        Row(
            name, observation, options, messages=True, feedback=False, seeds=seeds.get(name, 1), track=GROUNDED,
            image_encoder="detector",
        )
        for name, options in rows.items()
    )  # fmt: skip
    alone = Row(
        "PPO, humanoid only", observation, ppo, messages=True, feedback=False, module="training.sb3",
        checkpoint="best.zip", seeds=1, image_encoder="detector", track=GROUNDED,
    )  # fmt: skip
    return (*learners[:2], alone, *learners[2:])


def _with_ours(table: paper.PaperTable) -> tuple[Row, ...]:
    own = tuple(row for row in OURS if row.observation == table.rows[0].observation)
    return (*map(_row, table.rows), *own)


#: Table -> its rows. Some rows stand in two tables; they are trained once.
TABLES: dict[str, tuple[Row, ...]] = {
    "scene-graph": _with_ours(paper.SCENE_GRAPH),
    "visual": _with_ours(paper.VISUAL),
    LIMITED: (_grounded_clone(True, "--split", LIMITED_DATA),),
    "feedback": (
        *_isolated("scene_graph"),
        *_isolated("visual"),
        *(_in_generated_homes(observation, feedback) for observation in _SEEDS for feedback in (True, False)),
    ),
    GROUNDED: (*_grounded("scene_graph"), *_grounded("visual")),
}
