"""Strong partitions, firing strengths and fuzzy compliance: what eqs 33 to 38 of seed 003 say."""

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from beamstiff import BeamstiffError, load_robot, read_measurements
from beamstiff.measure.table import make_measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance, inputs_of, rules_from_table
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition, equal_parts

# seed 003, table 4: modal values in deg, conclusions in mm
THETA2 = (-24.15, 1.37, 12.54, 36.83)
THETA8 = (33.04, 48.63, 62.90)
CONCLUSIONS = (
    (-0.639, -0.718, -0.910),
    (-0.730, -0.953, -1.040),
    (-0.711, -1.010, -1.218),
    (-0.769, -1.057, -1.156),
)


def table_4() -> FuzzyCompliance:
    path = Path(__file__).resolve().parents[2] / "examples/data/ir663_compliance_xx.csv"
    return rules_from_table(read_measurements(path, load_robot("ir663")), ["q2", "q8"])


def random_partition(random: np.random.Generator, inputs: int) -> Partition:
    modal = tuple(np.cumsum(random.uniform(0.1, 1.0, int(random.integers(1, 5)))) for _ in range(inputs))
    return Partition(tuple(f"q{at}" for at in range(inputs)), modal)


@given(st.integers(0, 10_000), st.integers(1, 4))
def test_degrees_and_firing_strengths_of_a_strong_partition_sum_to_one(seed: int, inputs: int) -> None:
    random = np.random.default_rng(seed)
    partition = random_partition(random, inputs)
    x = random.uniform(-1, 5, (20, inputs))
    for degrees in partition.memberships(x):
        assert (degrees >= 0).all()
        assert np.abs(degrees.sum(axis=1) - 1).max() < 1e-12
        assert ((degrees > 0).sum(axis=1) <= 2).all()
    firing = partition.firing(x)
    assert (firing >= 0).all()
    assert np.abs(firing.sum(axis=1) - 1).max() < 1e-12


def test_neighbouring_sets_cross_at_one_half() -> None:
    modal = np.array([0.0, 1.0, 4.0])
    [degrees] = Partition(("q",), (modal,)).memberships(0.5 * (modal[1:] + modal[:-1])[:, None])
    assert np.sort(degrees, axis=1)[:, 1:].tolist() == [[0.5, 0.5]] * 2


@given(st.integers(0, 10_000))
def test_a_fuzzy_system_is_the_multilinear_interpolation_of_its_conclusions(seed: int) -> None:
    random = np.random.default_rng(seed)
    modal = tuple(np.cumsum(random.uniform(0.1, 1.0, int(random.integers(2, 5)))) for _ in range(3))
    partition = Partition(("a", "b", "c"), modal)
    conclusions = random.normal(size=(partition.count, 2))
    x = np.stack([random.uniform(axis[0], axis[-1], 15) for axis in modal], axis=1)
    theirs = RegularGridInterpolator(modal, conclusions.reshape(*partition.sets, 2))(x)
    assert np.abs(FuzzySystem(partition, conclusions)(x) - theirs).max() < 1e-12


@given(st.integers(0, 10_000))
def test_each_rule_fires_alone_at_its_corner(seed: int) -> None:
    partition = random_partition(np.random.default_rng(seed), 3)
    assert np.abs(partition.firing(partition.corners()) - np.eye(partition.count)).max() < 1e-12


def test_differences_vanish_where_conclusions_are_a_plane_over_the_modal_values() -> None:
    partition = Partition(("a", "b"), (np.array([0.0, 1.0, 5.0, 6.0]), np.array([-1.0, 0.0, 3.0])))
    plane = 2.0 + partition.corners() @ [3.0, -1.0]
    assert np.abs(partition.differences() @ plane).max() < 1e-12
    assert np.abs(partition.differences() @ plane**2).max() > 0.1


def test_a_mean_of_positive_definite_conclusions_is_positive_definite() -> None:
    random = np.random.default_rng(1)
    partition = random_partition(random, 3)
    roots = random.normal(size=(partition.count, 6, 6))
    conclusions = roots @ roots.swapaxes(1, 2)
    least = np.linalg.eigvalsh(conclusions)[:, 0].min()
    everywhere = FuzzySystem(partition, conclusions)(random.uniform(-1, 5, (200, 3)), extrapolate=True)
    assert np.linalg.eigvalsh(everywhere)[:, 0].min() >= 0.999 * least > 0


def test_table_4_is_reproduced_exactly_at_its_modal_values() -> None:
    q = np.deg2rad(list(product(THETA2, THETA8)))
    push = np.tile([-900.0, 0, 0, 0, 0, 0], (12, 1))
    displacement = 1e3 * table_4().predict(q, push)[:, 0]
    assert np.abs(displacement - np.ravel(CONCLUSIONS)).max() < 1e-12


def test_table_4_is_bilinear_between_its_modal_values() -> None:
    middle = np.deg2rad([[0.5 * (1.37 + 12.54), 0.5 * (48.63 + 62.90)]])
    push = np.array([[-450.0, 0, 0, 0, 0, 0]])
    mean = np.mean([CONCLUSIONS[1][1], CONCLUSIONS[1][2], CONCLUSIONS[2][1], CONCLUSIONS[2][2]])
    assert np.isclose(1e3 * table_4().predict(middle, push)[0, 0], 0.5 * mean, rtol=1e-12)


def test_table_4_says_nothing_of_what_was_not_measured() -> None:
    q = np.deg2rad([[1.37, 48.63]])
    displacement = table_4().predict(q, np.array([[-900.0, 0, 0, 0, 0, 0]]))[0]
    assert np.isfinite(displacement).tolist() == [True] + [False] * 5
    with pytest.raises(BeamstiffError, match=r"row 0: found a load fz, in which direction .* trained: fx"):
        table_4().predict(q, np.array([[0, 0, -900.0, 0, 0, 0]]))


def test_outside_the_trained_range_is_refused_or_flagged() -> None:
    q = np.deg2rad([[1.37, 48.63], [40.0, 48.63]])
    push = np.tile([-900.0, 0, 0, 0, 0, 0], (2, 1))
    model = table_4()
    with pytest.raises(BeamstiffError, match=r"row 1: found q2 = 0.69\d+, outside the trained range"):
        model.predict(q, push)
    assert model.outside(q).tolist() == [False, True]
    assert np.isclose(1e3 * model.extrapolating().predict(q, push)[1, 0], CONCLUSIONS[3][1])


def test_rules_that_hardly_fired_in_training_do_not_answer() -> None:
    partition = equal_parts(["a", "b"], np.array([[0.0, 1.0], [0.0, 1.0]]), [2, 2])
    system = FuzzySystem(partition, np.arange(4.0), support=np.array([1.0, 1.0, 1.0, 0.0]))
    assert system.outside([[0.1, 0.9], [0.9, 0.9]]).tolist() == [False, True]
    with pytest.raises(BeamstiffError, match=r"row 1: found a = 0.9, b = 0.9, where no rule .* was trained"):
        system([[0.1, 0.9], [0.9, 0.9]])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: Partition(("q",), (np.array([1.0, 1.0]),)), r"modal values \[1.0, 1.0\] of q, expected"),
        (lambda: Partition(("q",), (np.array([0.0, np.nan]),)), r"modal values of q: found nan"),
        (lambda: Partition(("a", "b"), (np.array([0.0]),)), r"found 1 sequences of modal values for 2"),
        (lambda: FuzzySystem(Partition(("q",), (np.arange(3.0),)), np.zeros(2)), r"found 2 conclusions, exp"),
        (lambda: inputs_of([], ["q2", "q8"], [[0.0, 1.0]]), r"found no inputs for fuzzy rules"),
        (lambda: inputs_of(["qq2"], ["q2", "q8"], [[0.0, 1.0]]), r"no input 'qq2' \(did you mean 'q2'"),
        (lambda: table_4().system([[np.nan, 0.0]]), r"inputs of the fuzzy system: found nan"),
    ],
)
def test_what_is_no_system_is_refused(wrong: Callable[[], object], message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        wrong()


def test_a_table_without_all_combinations_is_refused() -> None:
    q, push = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]], [[900.0, 0, 0, 0, 0, 0]] * 3
    rows = make_measurements(["q2", "q8"], q, tcp="n7", wrench=push, displacement=np.ones((3, 6)))
    with pytest.raises(BeamstiffError, match=r"found 3 rows for 4 combinations"):
        rules_from_table(rows, ["q2", "q8"])
