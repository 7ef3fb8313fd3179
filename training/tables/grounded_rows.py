"""The rows of the grounded track."""

from chmarl_pb.envs.tracks import GROUNDED
from training.tables.row import GROUNDED_ENCODER, LONGER, PARSED_ENCODER, SEEDS, Row

#: Published weights of the imitators of the grounded track.
_IMITATORS = {"scene_graph": "ours-grounded", "visual": "ours-grounded-pictures"}


def _imitation(*episodes: str) -> tuple[str, ...]:
    return ("--algo", "imitation", "--expert", "belief", *episodes, "--gradient-steps", "12", "--anneal", "0.5")


def grounded_rows(observation: str) -> tuple[Row, ...]:
    """Return the rows of the grounded track: nothing is told but what robots see, read and hear.

    Budgets are what fits: a core plays some 60 joint steps a second with an expert and 150 without, and an episode has
    up to 28; so 12,000 episodes are some 40 minutes of playing alone. On pictures, which all rows see by the same
    detector, each has 4,000 episodes, or as many steps; where words are parsed, all have 6,000. *QMIX, grounded* has
    the imitators' encoder and the settings by which value factorisation learns where episodes are few. MAPPO goes on
    from the published weights of the imitator that learns to read, those of its row with seed 0.
    """
    graphs = observation == "scene_graph"

    def episodes(of_graphs: int) -> tuple[str, str]:
        return "--episodes", str(of_graphs if graphs else 4000)

    seeing = () if graphs else ("--image-encoder", "detector")
    past = ("--cells-past", "--history-past")
    pointing = (*past, *GROUNDED_ENCODER, *seeing)
    env = f"CHMARL/Grounded{'SceneGraph' if graphs else 'Visual'}Humanoid-v0"
    ppo = ("--algo", "ppo", "--env", env, "--preset", "encoder", "--workers", "1")
    ppo += ("--steps", "150000" if graphs else "100000", *seeing)
    start = f"results/weights/{_IMITATORS[observation]}.pt"
    factorised = ("--algo", "qmix", *LONGER, "--gamma", "0.9", "--validation-interval", "500", *pointing)
    rows = {
        "QMIX": ("--algo", "qmix", *episodes(12000), *seeing),
        **({"QMIX, grounded": factorised} if graphs else {}),
        "MAPPO": ("--algo", "mappo", *episodes(6000), *GROUNDED_ENCODER, *seeing),
        "Imitation of belief": (*_imitation(*episodes(6000)), *pointing),
        "Imitation of belief, words parsed": (*_imitation("--episodes", "6000"), *past, *PARSED_ENCODER, *seeing),
        "Imitation of belief, then MAPPO": (
            "--algo", "mappo", "--start", start, *episodes(8000), "--envs", "16", "--buffer-size", "512",
            "--learning-rate", "1e-4", "--ent-coef", "0.001", "--home-rollouts", "20",
            "--validation-interval", "1000", *pointing,
        ),
    }  # fmt: skip
    headline = ("Imitation of belief", "Imitation of belief, words parsed")
    learners = tuple(
        Row(
            name, observation, options, messages=True, feedback=False, track=GROUNDED, image_encoder="detector",
            seeds=3 if name in headline else SEEDS[observation],
        )
        for name, options in rows.items()
    )  # fmt: skip
    alone = Row(
        "PPO, humanoid only", observation, ppo, messages=True, feedback=False, module="training.sb3",
        checkpoint="best.zip", seeds=SEEDS[observation], image_encoder="detector", track=GROUNDED,
    )  # fmt: skip
    before = 1 + [row.name for row in learners].index("MAPPO")
    return (*learners[:before], alone, *learners[before:])
