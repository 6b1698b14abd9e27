"""Names of reflectors on one body. Truth: names exchanged by hand, of simulated and of real readings."""

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.errors import BeamstiffError
from beamstiff.measure.rows import subset
from beamstiff.measure.swapped_labels import label_doubts, mend_labels
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import Rigid
from beamstiff.robot.reader import load_robot

STATES = 12
TRIANGLE = np.array([[0.1, 0.0, 0.0], [0.0, 0.16, 0.0], [0.0, 0.0, 0.25]])
TABLES = 50


def robot(places: np.ndarray) -> Robot:
    """Return one axis with reflectors m1, m2 ..., (P, 3), m."""
    at = [{"name": f"m{k}", "at": place} for k, place in enumerate(places.tolist(), 1)]
    return Robot.model_validate(
        {
            "name": "axis",
            "variables": [{"name": "q1", "type": "revolute"}],
            "nodes": [{"name": "root"}, {"name": "tool"}, *at],
            "rigids": [{"name": n, "nodes": ["root", n]} for n in ("tool", *(one["name"] for one in at))],
            "fixed": ["root"],
            "tcp": "tool",
        }
    )


SOMEWHERE = robot(np.zeros((3, 3)))  # where the reflectors are, nobody has said


def read(at: np.ndarray) -> Measurements:
    """Return the readings (S, P, 3), m, of S states."""
    states, points = at.shape[:2]
    return make_measurements(
        ["q1"],
        np.repeat(np.linspace(-1, 1, states)[:, None], points, axis=0),
        tcp="tool",
        position=at.reshape(-1, 3),
        point=[f"m{k + 1}" for k in range(points)] * states,
        pose=np.repeat(np.arange(states), points),
        source="t.csv",
    )


def moved(places: np.ndarray, states: int, noise: float, rng: np.random.Generator) -> np.ndarray:
    turned = Rotation.random(states, random_state=rng).as_matrix()
    at = np.einsum("sij,pj->spi", turned, places) + rng.uniform(-1, 1, (states, 1, 3))
    return np.asarray(at + noise * rng.standard_normal(at.shape))


def table() -> Measurements:
    return read(moved(TRIANGLE, STATES, 2e-5, np.random.default_rng(0)))


def exchanged(right: Measurements, orders: dict[int, tuple[int, ...]], points: int = 3) -> Measurements:
    """Return a table in which names went another way in some states."""
    point = right.point.copy()
    for state, order in orders.items():
        own = np.arange(points * state, points * (state + 1))
        point[own] = right.point[own[list(order)]]
    return replace(right, point=point)


def test_right_names_raise_no_doubt() -> None:
    assert list(label_doubts(table(), SOMEWHERE)) == []


@pytest.mark.parametrize("states", [(2, 7), (0, 1, 2, 3, 4)])
def test_exchanged_names_are_found_by_the_distances(states: tuple[int, ...]) -> None:
    right = table()
    (said,) = label_doubts(exchanged(right, dict.fromkeys(states, (1, 0, 2))), SOMEWHERE)
    assert f"exchanged in {len(states)} of {STATES} states" in said
    assert "m2 is m1, m1 is m2" in said
    assert right.place(3 * states[0] + 1) in said


@pytest.mark.parametrize("states", [(), (2, 7, 11), tuple(range(STATES))])
def test_two_names_are_found_by_their_places(states: tuple[int, ...]) -> None:
    """Two of a six-axis robot, some millimetres from where its file has them, in a tracker's frame."""
    arm, rng = load_robot("kr240-2"), np.random.default_rng(3)
    (tool,) = (node for node in arm.nodes if node.name == arm.tcp)
    places = {"m1": np.array([0.1, 0.0, 0.2]), "m2": np.array([0.04, 0.05, 0.15])}
    more = tuple(tool.model_copy(update={"name": name, "at": tuple(at)}) for name, at in places.items())
    rigids = tuple(Rigid(name=name, nodes=(arm.tcp, name)) for name in places)
    arm = arm.model_copy(update={"nodes": (*arm.nodes, *more), "rigids": (*arm.rigids, *rigids)})
    q = rng.uniform(-0.4, 0.4, (STATES, 6))
    link = pose_of(compile_kinematics(arm), posture(compile_kinematics(arm), q), "m1")
    local = np.array([*places.values()]) - places["m1"] + 3e-3 * rng.standard_normal((2, 3))
    at = link[:, None, :3, 3] + np.einsum("sij,pj->spi", link[:, :3, :3], local)
    frame = Rotation.random(random_state=rng).as_matrix()
    right = read(at @ frame + rng.uniform(-1, 1, 3))
    names = tuple(variable.name for variable in arm.actuated)
    right = replace(right, variables=names, q=np.repeat(q, 2, axis=0))
    said = list(label_doubts(exchanged(right, dict.fromkeys(states, (1, 0)), 2), arm))
    assert len(said) == bool(states)
    assert all(f"m1, m2 seem to be exchanged in {len(states)} of {STATES} states" in note for note in said)
    guessed = tuple(tool.model_copy(update={"name": name}) for name in places)
    unplaced = arm.model_copy(update={"nodes": (*arm.nodes[: -len(places)], *guessed)})
    loaded = subset(right, np.tile(np.arange(4), 4))  # two postures, whose points are on one line
    loaded = replace(loaded, pose=np.repeat(np.arange(8), 2))
    assert not list(label_doubts(loaded, unplaced))


def test_three_names_that_went_round_are_found() -> None:
    (said,) = label_doubts(exchanged(table(), {0: (1, 2, 0)}), SOMEWHERE)
    assert "m2 is m1, m3 is m2, m1 is m3" in said


def test_every_reading_of_a_state_counts_by_itself() -> None:
    twice = table()
    pose, q = twice.pose // 2, twice.q[6 * (np.arange(3 * STATES) // 6)]
    found = replace(exchanged(twice, {5: (1, 0, 2)}), pose=pose, q=q)
    mended, said = mend_labels(found, SOMEWHERE)
    assert mended.point.tolist() == twice.point.tolist()
    assert said[0] == "t.csv:16, t.csv:17: m2 is m1, m1 is m2"


def test_a_reflector_that_slipped_is_named_and_left_out() -> None:
    right = table()
    position = right.position.copy()
    position[3 * 8 + 1 :: 3] += [0.0, 0.02, 0.01]
    slipped = replace(right, position=position)
    (said,) = label_doubts(slipped, SOMEWHERE)
    assert said.startswith(f"reflector m2 seems to have slipped in {STATES - 8} of {STATES} states")
    mended, done = mend_labels(slipped, SOMEWHERE)
    assert sorted(set(right.rows.tolist()) - set(mended.rows.tolist())) == [26, 29, 32, 35]
    assert done[0].startswith("t.csv:26: left out: m2 slipped, off by ")


def test_reflectors_on_several_bodies_raise_no_doubt_and_are_not_mended() -> None:
    right = table()
    rng = np.random.default_rng(1)
    apart = replace(right, position=rng.uniform(-1, 1, right.position.shape))
    assert list(label_doubts(apart, SOMEWHERE)) == []
    with pytest.raises(BeamstiffError, match="found no reflectors that keep their distances"):
        mend_labels(apart, SOMEWHERE)


def test_thirteen_of_twenty_one_are_mended_where_the_robot_file_says_which_are_right() -> None:
    right = read(moved(TRIANGLE, 21, 2e-5, np.random.default_rng(3)))
    wrong = exchanged(right, dict.fromkeys(range(4, 17), (1, 0, 2)))
    mended, said = mend_labels(wrong, robot(TRIANGLE + 0.2))
    assert mended.point.tolist() == right.point.tolist()
    assert said[-1] == (
        "the names of 8 of 21 states of m1, m2, m3 count as right, by their places in the robot file"
    )
    assert len(said) == 14
    otherwise, said = mend_labels(wrong, SOMEWHERE)  # the most are wrong: one naming, but not theirs
    assert otherwise.point.tolist() == exchanged(right, dict.fromkeys(range(21), (1, 0, 2))).point.tolist()
    assert "13 of 21 states of m1, m2, m3 count as right, for they are the most that agree" in said[-1]


def both_slipped(right: Measurements) -> Measurements:
    position = right.position.copy()
    position[:2] += [[0.2, 0.0, 0.0], [0.0, 0.2, 0.1]]
    return replace(right, position=position)


def alike() -> Measurements:
    """Return nine states of an isosceles triangle, m1 and m2 at the same distance from m3."""
    places = np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 0.25]])
    return read(moved(places, 9, 1e-5, np.random.default_rng(2)))


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (exchanged(table(), dict.fromkeys(range(6), (1, 0, 2))), "one way in 6 states and otherwise in 6:"),
        (exchanged(alike(), {4: (2, 1, 0)}), "t.csv:15: several exchanges explain the distances"),
        (both_slipped(table()), "t.csv:1: distances are off by .*, and no single reflector may have slipped"),
    ],
)  # fmt: skip
def test_what_distances_leave_open_is_refused(found: Measurements, said: str) -> None:
    with pytest.raises(BeamstiffError, match=said):
        mend_labels(found, SOMEWHERE)


def test_an_exchange_that_no_distance_shows_is_said() -> None:
    assert "exchanges among m1, m2 cannot be seen" in mend_labels(alike(), SOMEWHERE)[1][-1]


def planted(rng: np.random.Generator, states: int, points: int, share: float) -> dict[int, tuple[int, ...]]:
    wrong = rng.choice(states, round(share * states), replace=False)
    orders = list(permutations(range(points)))[1:]
    return {int(state): orders[rng.integers(len(orders))] for state in wrong}


def test_planted_exchanges_are_mended_and_none_is_made_in_random_tables() -> None:
    """Random bodies, noise and shares of wrong states; of some the robot file guesses the places."""
    count = mended_right = false = refused = 0
    for seed in range(TABLES):
        rng = np.random.default_rng(seed)
        points, states, noise = int(rng.integers(3, 6)), int(rng.integers(8, 40)), rng.uniform(5e-6, 5e-5)
        places = rng.uniform(-0.15, 0.15, (points, 3))
        right = read(moved(places, states, noise, rng))
        known = robot(
            places + 2e-3 * rng.standard_normal(places.shape) if seed % 2 else np.zeros_like(places)
        )
        orders = planted(rng, states, points, rng.uniform(0.1, 0.6 if seed % 2 else 0.45))
        try:
            found = mend_labels(exchanged(right, orders, points), known)[0].point.reshape(states, points)
        except BeamstiffError:
            refused += 1
        else:
            count += len(orders)
            mended_right += sum(found[state].tolist() == right.point[:points].tolist() for state in orders)
        untouched = mend_labels(right, known)[0]
        false += int((untouched.point != right.point).sum()) + len(right) - len(untouched)
    assert (mended_right, false) == (count, 0)
    assert refused <= 2


def _fanuc(path: Path) -> np.ndarray:
    return np.loadtxt(path / "fanuc_r2000/N1N2N3Jval.csv")[:, :9].reshape(-1, 3, 3) * 1e-3


def _irb120(path: Path) -> np.ndarray:
    files = [np.loadtxt(path / f"irb120_faro/measured_SMR_{k}.txt") for k in (1, 2, 3)]
    at = np.stack(files, axis=1) * 1e-3
    return np.asarray(at[(at != 0).any(axis=(1, 2))][:200])


@pytest.mark.parametrize("readings", [_fanuc, _irb120])
def test_exchanges_planted_in_real_readings_are_mended(
    readings: Callable[[Path], np.ndarray], shared_path: Callable[[str], Path]
) -> None:
    """A Fanuc with a tracker, and an IRB 120 whose reflectors stand 150.2, 150.3 and 150.6 mm apart."""
    right = read(readings(shared_path("real/README.md").parent))
    states = len(right) // 3
    assert list(label_doubts(right, SOMEWHERE)) == []
    assert mend_labels(right, SOMEWHERE)[0].point.tolist() == right.point.tolist()
    for seed in range(10):  # 13 of 21 states, as in a public set
        orders = planted(np.random.default_rng(seed), states, 3, 13 / 21)
        point = mend_labels(exchanged(right, orders), SOMEWHERE)[0].point.reshape(-1, 3)
        assert (point == right.point[:3]).all(), seed
