"""Mixers and losses: what each class can represent, and which steps count how much."""

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from chmarl_pb.learning.algorithms.losses import Returns, Unrolled, mean_square, td_loss
from chmarl_pb.learning.algorithms.mixers import DeepQMixer, Independent, QMixer, Sum
from chmarl_pb.learning.algorithms.qtran import QtranNetworks, qtran_loss
from chmarl_pb.learning.algorithms.registry import Algorithm, make_learner
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.components import best_action
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.spaces import LearnerInterface, learner_interface_of
from training.games import TwoStepGame
from training.theory import additive_fit, supermodular_fit

NUMBERS = st.floats(-20, 20, width=32)


@given(st.lists(NUMBERS, min_size=3, max_size=3), st.integers(0, 2), st.floats(0, 10, width=32), st.integers(0, 9))
def test_qmix_never_falls_when_an_agent_value_rises(values: list[float], agent: int, rise: float, seed: int) -> None:
    torch.manual_seed(seed)
    mixer, state = QMixer(3, 5, 8), torch.randn(1, 1, 5)
    low = torch.tensor([[values]])
    high = low.clone()
    high[..., agent] += rise
    assert (mixer(high, state) - mixer(low, state)).item() >= -1e-3


@given(st.lists(NUMBERS, min_size=2, max_size=5))
def test_vdn_adds_and_iql_leaves_alone(values: list[float]) -> None:
    tensor, state = torch.tensor([[values]]), torch.zeros(1, 1, 1)
    assert Sum()(tensor, state).shape == (1, 1, 1)
    assert float(Sum()(tensor, state)) == pytest.approx(sum(values), abs=1e-3)
    assert torch.equal(Independent()(tensor, state), tensor)


def test_qmix_equals_torchrl_with_equal_weights() -> None:
    modules = pytest.importorskip("torchrl.modules")
    torch.manual_seed(0)
    ours, theirs = QMixer(3, 6, 16), modules.QMixer((6,), 16, 3, "cpu")
    names = {
        "first_weight": "hyper_w_1",
        "first_bias": "hyper_b_1",
        "second_weight": "hyper_w_final",
        "second_bias": "V",
    }
    for own, other in names.items():
        getattr(ours, own).load_state_dict(getattr(theirs, other).state_dict())
    values, state = torch.randn(7, 5, 3), torch.randn(7, 5, 6)
    torch.testing.assert_close(ours(values, state), theirs(values.unsqueeze(-1), state))


def test_a_mixer_is_chosen_by_name() -> None:
    learner = make_learner("qmix", learner_interface_of(TwoStepGame()), Config(mixer="qmix-deep"))
    assert isinstance(learner, ValueLearner) and isinstance(learner.mixer, DeepQMixer)
    for wrong in ("magic", "tests.no_such_module:Mixer", "chmarl_pb.learning.algorithms.mixers:NoMixer"):
        with pytest.raises(ValueError, match=f"mixer='{wrong}'"):
            make_learner("qmix", learner_interface_of(TwoStepGame()), Config(mixer=wrong))


@pytest.mark.parametrize(
    ("option", "name", "words"),
    [
        ("mixer", "os:getcwd", "it is called with"), ("mixer", "os:sep", "is no function"),
        ("mixer", "builtins:print", "makes builtins.NoneType; derive what it makes from .*mixers.Mixer"),
        ("encoder", "os:getcwd", "it is called with"),
    ],
)  # fmt: skip
def test_what_makes_no_network_is_refused(option: str, name: str, words: str) -> None:
    given: dict[str, Any] = {option: name}
    with pytest.raises(ValueError, match=f"{option}='{name}'.*{words}"):
        make_learner("qmix", learner_interface_of(TwoStepGame()), Config(**given))


def test_settings_that_a_learner_would_not_use_are_refused() -> None:
    with pytest.raises(ValueError, match="qtran learns a joint value"):
        make_learner("qtran", learner_interface_of(TwoStepGame()), Config(mixer="vdn"))
    with pytest.raises(ValueError, match="at least 2"):
        make_learner("qmix", learner_interface_of(TwoStepGame()), Config(mixer="qmix-deep", embedding=1))


@pytest.mark.parametrize(
    ("algorithm", "mixer", "instead"),
    [
        ("iql", "qmix", "qmix"), ("iql", "vdn", "vdn"), ("vdn", "qmix-deep", "qmix"), ("qmix", "iql", "iql"),
        ("vdn", "examples.new_mixer:WeightedSum", "qmix"),
    ],
)  # fmt: skip
def test_nothing_else_is_trained_under_the_name_of_an_algorithm(algorithm: str, mixer: str, instead: str) -> None:
    with pytest.raises(ValueError, match=f"mixer='{mixer}': .* another algorithm of {algorithm}; use {instead}$"):
        make_learner(algorithm, learner_interface_of(TwoStepGame()), Config(mixer=mixer))


def test_an_algorithm_may_name_its_own_mixer() -> None:
    for algorithm in ("iql", "vdn", "qmix"):
        make_learner(algorithm, learner_interface_of(TwoStepGame()), Config(mixer=algorithm))


OWN = Algorithm(ValueLearner, Config)


def test_an_algorithm_of_ones_own_without_a_mixer_says_so() -> None:
    name, interface = f"{__name__}:OWN", learner_interface_of(TwoStepGame())
    with pytest.raises(ValueError, match=f"^algorithm {name} names no mixer; give mixer=..., one of: iql, vdn, .*; or"):
        make_learner(name, interface, Config())
    assert isinstance(make_learner(name, interface, Config(mixer="qmix")), ValueLearner)


@given(st.lists(NUMBERS, min_size=9, max_size=9))
def test_fits_are_of_their_class_and_keep_the_mean(numbers: list[float]) -> None:
    table = np.array(numbers).reshape(3, 3)
    additive = additive_fit(table)
    assert np.allclose(additive + additive[0, 0], additive[:, :1] + additive[:1], atol=1e-4)
    assert additive.mean() == pytest.approx(table.mean(), abs=1e-4)
    order = np.add.outer([0.0, 1.0, 2.0], [0.0, 1.0, 2.0])
    supermodular = supermodular_fit(table, order)
    assert (np.diff(supermodular, axis=0) >= -1e-3).all() and (np.diff(supermodular, axis=1) >= -1e-3).all()
    assert (np.diff(np.diff(supermodular, axis=0), axis=1) >= -1e-3).all()
    assert ((supermodular - table) ** 2).sum() <= ((table.mean() - table) ** 2).sum() + 1e-2


@given(st.lists(NUMBERS, min_size=3, max_size=3), st.integers(0, 9), *[st.floats(0, 10, width=32)] * 2)
def test_qmix_is_supermodular(values: list[float], seed: int, one: float, other: float) -> None:
    """To raise two agents' values brings no less than to raise each alone."""
    torch.manual_seed(seed)
    mixer, state = QMixer(3, 5, 8), torch.randn(4, 5)
    table = torch.tensor([values] * 4)
    table[[1, 3], 0] += one
    table[[2, 3], 1] += other
    low, first, second, both = mixer(table.double().float(), state[:1].expand(4, 5)).flatten().tolist()
    assert both - first - second + low >= -1e-3


def test_an_or_is_monotonic_and_beyond_qmix() -> None:
    table = np.array([[0.0, 8.0], [8.0, 8.0]])
    np.testing.assert_allclose(supermodular_fit(table, table), [[-2, 6], [6, 6]] + 4 * np.eye(2), atol=1e-6)
    np.testing.assert_allclose(supermodular_fit(8 - table, 8 - table), 8 - table, atol=1e-6)  # an AND


# Two agents with two actions, one episode of two steps; the values are given, so the losses can be computed by hand.
VALUES = {"a": [[1.0, 0.0], [2.0, 3.0], [5.0, 4.0]], "b": [[0.0, 1.0], [1.0, 0.0], [0.0, 2.0]]}


def batch_of(terminated: bool, acted: list[list[bool]] | None = None) -> Batch:
    done = [[False, False], [terminated, terminated]]
    return Batch(
        {}, {"a": torch.tensor([[[0], [1]]]), "b": torch.tensor([[[1], [1]]])},
        {name: torch.ones(1, 3, 1, 2, dtype=torch.bool) for name in "ab"}, torch.zeros(1, 3, 1),
        torch.tensor([[[1.0, 3.0], [2.0, 2.0]]]), torch.tensor([acted or [[True, True]] * 2]), torch.tensor([done]),
    )  # fmt: skip


def values() -> Unrolled:
    return Unrolled({name: torch.tensor([rows]).unsqueeze(-2) for name, rows in VALUES.items()}, {})


@pytest.mark.parametrize(("terminated", "last_target"), [(True, 2.0), (False, 2.0 + 0.5 * (5 + 2))])
def test_vdn_loss_bootstraps_at_truncation_only(terminated: bool, last_target: float) -> None:
    loss = td_loss(values(), values(), Sum(), Sum(), batch_of(terminated), Returns(0.5))["loss"]
    first = (1 + 1) - (2.0 + 0.5 * (3 + 1))  # the team's reward is the mean of both
    assert float(loss) == pytest.approx((first**2 + (3 + 0 - last_target) ** 2) / 2)


def test_iql_learns_from_own_rewards() -> None:
    loss = td_loss(values(), values(), Independent(), Independent(), batch_of(True), Returns(0.5))["loss"]
    errors = [1 - (1 + 0.5 * 3), 3 - 2, 1 - (3 + 0.5 * 1), 0 - 2]
    assert float(loss) == pytest.approx(np.mean(np.square(errors)))


def test_double_q_takes_the_online_argmax_and_the_target_value() -> None:
    target = Unrolled({name: tensor.flip(-1) * 10 for name, tensor in values().values.items()}, {})
    loss = td_loss(values(), target, Sum(), Sum(), batch_of(True), Returns(1.0))["loss"]
    assert float(loss) == pytest.approx(((2 - (2 + 20 + 0)) ** 2 + (3 + 0 - 2) ** 2) / 2)


def test_padding_and_absent_agents_do_not_count() -> None:
    padded = batch_of(True, [[True, True], [False, False]])
    loss = td_loss(values(), values(), Sum(), Sum(), padded, Returns(0.5))["loss"]
    assert float(loss) == pytest.approx((2 - (2.0 + 0.5 * 4)) ** 2)
    alone = td_loss(values(), values(), Sum(), Sum(), batch_of(True, [[True, False], [True, False]]), Returns(0.0))[
        "loss"
    ]
    assert float(alone) == pytest.approx(((1 - 1) ** 2 + (3 - 2) ** 2) / 2)


def test_an_agent_that_is_cut_off_before_the_others_has_no_next_value() -> None:
    cut = batch_of(False, [[True, True], [True, False]])
    loss = td_loss(values(), values(), Sum(), Sum(), cut, Returns(0.5))["loss"]
    first, last = 2 - (2 + 0.5 * 3), 3 - (2 + 0.5 * 5)  # b is not there in the second step
    assert float(loss) == pytest.approx((first**2 + last**2) / 2)


@pytest.mark.parametrize("algorithm", ["vdn", "qmix", "qtran"])
@pytest.mark.parametrize("cut", [True, False])
def test_what_a_gone_agent_would_do_changes_nothing(algorithm: str, cut: bool) -> None:
    batch = batch_of(True, [[True, True], [True, False]])
    if not cut:
        batch.terminated[:, 0, 1] = True
    torch.manual_seed(0)
    learner = make_learner(
        algorithm,
        LearnerInterface(dict.fromkeys("ab", spaces.Discrete(2)), {"a": 2, "b": 2}, 1, True),
        Config(hidden=3, gamma=0.9),
    )
    assert isinstance(learner, ValueLearner)
    histories = {name: torch.randn(1, 3, 3) for name in "ab"}

    def loss_with(b_when_gone: list[float]) -> float:
        seen = values().values | {"b": torch.tensor([[VALUES["b"][0], b_when_gone, b_when_gone]]).unsqueeze(-2)}
        unrolled = Unrolled(seen, histories)
        return float(learner.td_loss(unrolled, unrolled, learner.mixer, learner.mixer, batch)["loss"].detach())

    assert loss_with([0.0, 1.0]) == pytest.approx(loss_with([50.0, -9.0]))


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="differ in shape"):
        mean_square(torch.zeros(2, 3, 2), torch.zeros(2, 3, 1))


def test_illegal_actions_are_never_best() -> None:
    action_mask = torch.tensor([[True, False, True]])
    assert best_action(torch.tensor([[0.0, 9.0, 1.0]]), action_mask).tolist() == [2]


class Fixed(QtranNetworks):
    """QTRAN networks that return given numbers."""

    def __init__(self, q: float, v: float):
        nn.Module.__init__(self)
        self.q, self.v = nn.Parameter(torch.tensor(q)), nn.Parameter(torch.tensor(v))

    def q_joint(self, histories: list[torch.Tensor], actions: list[torch.Tensor], state: torch.Tensor) -> torch.Tensor:
        return self.q.expand(*state.shape[:-1], 1)

    def v_joint(self, histories: list[torch.Tensor], state: torch.Tensor) -> torch.Tensor:
        return self.v.expand(*state.shape[:-1], 1)


def test_qtran_losses_by_hand() -> None:
    networks = Fixed(2.0, -1.0)
    parts = qtran_loss(values(), values(), networks, Fixed(4.0, 0.0), batch_of(True), Returns(0.5))
    assert float(parts["td"]) == pytest.approx(((2 - (2 + 0.5 * 4)) ** 2 + (2 - 2) ** 2) / 2)
    best, taken = np.array([1 + 1, 3 + 1]), np.array([1 + 1, 3 + 0])
    assert float(parts["opt"]) == pytest.approx(np.mean((best - 2 - 1) ** 2))
    assert float(parts["nopt"]) == pytest.approx(np.mean(np.minimum(taken - 2 - 1, 0) ** 2))
    parts["loss"].backward()
    td_gradient = np.mean([2 * (2 - 4), 2 * (2 - 2)])
    assert networks.q.grad is not None
    assert float(networks.q.grad) == pytest.approx(td_gradient)  # opt and nopt hold Q_jt fixed
