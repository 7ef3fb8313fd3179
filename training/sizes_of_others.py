"""How many weights the networks that EPyMARL and PyMARL have by default would have on the benchmark, as Markdown.

Layers as of EPyMARL (src/modules/agents/rnn_agent.py, mixers/qmix.py, critics/centralV.py) and, for QTRAN, PyMARL
(src/modules/mixers/qtran.py), with the sizes in their src/config.
"""

from itertools import pairwise

from gymnasium.spaces.utils import flatdim

import chmarl_pb

_HEAD = ("", "observation, numbers", "weights: the agents' one network", "mixer, joint networks or critic")
_EMBEDDING, _HYPER, _CRITIC, _QTRAN = 32, 64, 128, 64


def table_of_others() -> str:
    """Return the table: observations are flattened, as EPyMARL's wrapper of Gymnasium does; the state is ours."""
    env = chmarl_pb.parallel_env("scene_graph")
    agents, states = len(env.possible_agents), flatdim(env.state_space)
    seen = max(flatdim(env.observation_space(name)) for name in env.possible_agents)
    actions = max(flatdim(env.action_space(name)) for name in env.possible_agents)
    env.close()
    numbers = seen + agents  # and which agent it is
    small, large = (_agent(numbers, units, actions, recurrent=units == _CRITIC) for units in (64, _CRITIC))
    with_action = numbers + actions  # PyMARL also tells the last action
    rows = {
        "IQL, EPyMARL": (numbers, large, 0),
        "VDN, EPyMARL": (numbers, small, 0),
        "QMIX, EPyMARL": (numbers, small, _mixer(states, agents)),
        "QTRAN, PyMARL": (with_action, _agent(with_action, 64, actions, recurrent=True), _qtran(states, actions)),
        "MAPPO, EPyMARL": (numbers, large, _layers(states + agents, _CRITIC, _CRITIC, 1)),
    }
    lines = [f"| {' | '.join(_HEAD)} |", "|---|" + "--:|" * (len(_HEAD) - 1)]
    lines += [
        f"| {name} | {told:,} | {own:,} | {f'{joint:,}' if joint else 'none'} |"
        for name, (told, own, joint) in rows.items()
    ]
    return "\n".join(lines)


def _layers(*sizes: int) -> int:
    """Return the weights of linear layers with biases."""
    return sum(inputs * outputs + outputs for inputs, outputs in pairwise(sizes))


def _agent(inputs: int, units: int, actions: int, recurrent: bool) -> int:
    memory = 3 * (2 * units * units + 2 * units) if recurrent else _layers(units, units)  # a GRU has three gates
    return _layers(inputs, units) + memory + _layers(units, actions)


def _mixer(states: int, agents: int) -> int:
    first, last = _layers(states, _HYPER, _EMBEDDING * agents), _layers(states, _HYPER, _EMBEDDING)
    return first + last + _layers(states, _EMBEDDING) + _layers(states, _EMBEDDING, 1)


def _qtran(states: int, actions: int) -> int:
    encoded = _QTRAN + actions
    joint, value = (_layers(inputs, _QTRAN, _QTRAN, 1) for inputs in (states + encoded, states))
    return joint + value + _layers(encoded, encoded, encoded)
