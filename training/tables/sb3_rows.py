"""The rows of Stable-Baselines3, which stand below those of the paper."""

from training.tables.row import SEEDS, Row

_SB3 = {"PPO": "ppo", "A2C": "a2c", "DQN": "dqn", "QR-DQN": "qr-dqn", "Recurrent PPO": "recurrent-ppo"}


def _sb3(learner: str, words: str, observation: str, *options: str) -> Row:
    """Return the row of an algorithm of Stable-Baselines3."""
    given = ("--algo", _SB3[learner], *options, "--workers", "1")
    module, file, seeds = "training.sb3", "best.zip", SEEDS[observation]
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
