"""The rows of the tables as data: what is trained, and which row of the paper it stands beside."""

from itertools import chain

from chmarl_pb.envs.tracks import GROUNDED
from chmarl_pb.evaluation import paper
from training.tables.grounded_rows import grounded_rows
from training.tables.row import GROUNDED_ENCODER, LIMITED, LIMITED_DATA, LONGER, MEMORY, PARSED_ENCODER, SEEDS, Row
from training.tables.sb3_rows import BASELINES

#: Rows of the paper's ablation of feedback, which have three trainings on pictures, too.
_ABLATED = {row.name for row in paper.FEEDBACK.rows}


def _row(published: paper.Row) -> Row:
    """Return the row that stands beside one of the paper."""
    words = published.name.lower().split()
    options = ("--algo", words[0], *(["--centralized"] if "centralized" in words else []))
    return Row(
        published.name, published.observation, options, "messages" in words, published.feedback, published,
        seeds=3 if published.name in _ABLATED else SEEDS[published.observation],
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


#: What our learner reads with where nothing that it sees can be tied to words, as features of ResNet-18.
_READING = ("--word-vectors", "--numbers-past")


def _ours(expert: str, observation: str, *options: str) -> Row:
    """Return our learner, which sees pictures by the detector, after an expert."""
    given = ("--algo", "dagger-mappo", "--imitation.expert", expert, *options)
    name, seeds = f"Imitation of {expert}, then MAPPO", 3 if expert == "belief" else SEEDS[observation]
    return Row(name, observation, given, True, seeds=seeds, image_encoder="detector")


def _imitator(
    observation: str,
    homes: str,
    *options: str,
    expert: str = "belief",
    feedback: bool = True,
    reading: tuple[str, ...] = GROUNDED_ENCODER,
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
    return _imitator(observation, ", generated homes, words parsed", "--split", "generated", reading=PARSED_ENCODER)


def _with_memory(observation: str, words: str = "", reading: tuple[str, ...] = GROUNDED_ENCODER) -> Row:
    """Return one of both, remembering more, and trained to play as it is evaluated."""
    homes, seeds = f", generated homes{words}, memory", SEEDS[observation]
    options = chain.from_iterable(MEMORY.values())
    return _imitator(observation, homes, "--split", "generated", *options, reading=reading, seeds=seeds)


def _with_part_of_memory(part: str) -> Row:
    """Return the same with one part of that, on graphs, where it need not learn to read."""
    homes = f", generated homes, words parsed, {part}"
    return _imitator("scene_graph", homes, "--split", "generated", *MEMORY[part], reading=PARSED_ENCODER)


def _longer(observation: str) -> tuple[Row, ...]:
    """Return the paper's learners, with its encoder and messages, stronger settings and more episodes."""
    return tuple(
        Row(
            f"{name} + messages, longer", observation, ("--algo", name.lower(), *LONGER), messages=True,
            seeds=SEEDS[observation],
        )
        for name in ("IQL", "VDN", "QMIX", "QTRAN")
    )  # fmt: skip


def _grounded_qmix(homes: str, *options: str) -> Row:
    """Return QMIX with the same settings, the encoder that ties words to things, and a nearer horizon."""
    given = ("--algo", "qmix", *LONGER, "--gamma", "0.9", *GROUNDED_ENCODER, *options)
    return Row(f"QMIX + messages, grounded{homes}", "scene_graph", given, messages=True)


def _grounded_clone(messages: bool, *options: str) -> Row:
    """Return decentralized clones of the planner, with the encoder that ties words to things."""
    name = f"BC decentralized{' + messages' * messages}, grounded"
    return Row(name, "scene_graph", ("--algo", "bc", *GROUNDED_ENCODER, *options), messages)


#: Twice the episodes, three times the gradient steps after each, at a rate that falls.
_MORE = ("--episodes", "6000", "--gradient-steps", "12", "--anneal", "0.5")


def _from_scratch(name: str) -> Row:
    """Return a learner from scratch that the paper does not have, with the encoder that ties words to things."""
    given = ("--algo", name.lower(), "--episodes", "12000", *GROUNDED_ENCODER)
    return Row(f"{name} + messages", "scene_graph", given, True)


#: Rows that the paper has no counterpart of, shown below its rows in the table of their observation.
OURS: tuple[Row, ...] = (
    *map(_grounded_clone, (False, True)),
    *(row for observation in SEEDS for row in _longer(observation)),
    _grounded_qmix(""),
    _grounded_qmix(", generated homes", "--split", "generated"),
    *map(_from_scratch, ("PQN", "MAPPO")),
    *(_ours("belief", observation, *GROUNDED_ENCODER) for observation in SEEDS),
    *(_ours("search", observation) for observation in SEEDS),
    *(_imitator("scene_graph", "", expert=expert) for expert in ("planner", "search", "belief")),
    *map(_in_generated_homes, SEEDS),
    _imitator(
        "visual", ", generated homes, ResNet-18", "--split", "generated", reading=_READING, eyes="resnet18", seeds=2
    ),
    *map(_told, SEEDS),
    *map(_with_memory, SEEDS),
    _with_memory("scene_graph", ", words parsed", PARSED_ENCODER),
    *map(_with_part_of_memory, MEMORY),
    _imitator("scene_graph", ", generated homes, longer", "--split", "generated", *_MORE),
    *BASELINES,
)


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
        *(_in_generated_homes(observation, feedback) for observation in SEEDS for feedback in (True, False)),
    ),
    GROUNDED: (*grounded_rows("scene_graph"), *grounded_rows("visual")),
}
