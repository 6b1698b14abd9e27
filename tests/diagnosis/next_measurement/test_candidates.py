"""Loads that are proposed are loads that were applied, and states stand in the order of a short way."""

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.diagnosis.next_measurement.candidates import (
    ABSOLUTE,
    ONE_WAY,
    STEPS,
    _few_turns,
    _ways,
    load_cycles,
    short_way,
)
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from tests.diagnosis.machines import rows_of


def loaded(*forces: tuple[float, float, float]) -> Measurements:
    wrench = np.hstack([np.array(forces), np.zeros((len(forces), 3))])
    rows = {"wrench": wrench, "displacement": 0.0 * wrench, "source": "table"}
    return make_measurements(["q1"], 0.0 * wrench[:, :1], tcp="tool", **rows)


def test_weights_that_hang_down_are_proposed_as_such() -> None:
    ways = _ways(loaded((0, 0, 0), (0, 0, -150), (1, 0, -300)), absolute=True)
    assert len(ways) == 1
    np.testing.assert_allclose(ways[0][0], [0, 0, -1], atol=0.02)
    assert ways[0][1] == ONE_WAY[ABSOLUTE]
    assert min(ways[0][1]) == 0.0


def test_where_one_weight_hung_no_half_of_it_is_proposed() -> None:
    ((_, shares),) = _ways(loaded((0, 0, 0), (0, 0, -98.1), (0, 0, -98.0)), absolute=True)
    assert {*shares} == {0.0, 1.0}


def test_loads_are_proposed_where_loads_acted() -> None:
    robot = load_robot("kr240-2")
    q = np.radians([[0.0, 70, -90, 0, 0, -60], [20.0, 80, -110, 40, 0, 60], [-20.0, 75, -100, 10, 0, 0]])
    down = np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (3, 1))
    acts = [robot.tcp, *[robot.joints[-1].nodes[0]] * 2]
    rows = rows_of(robot, q, down, displacement=np.full((3, 6), 1e-4), source="table", load_point=acts)
    assert {*load_cycles(fit_baseline(robot, rows), seed=0)[0].load_point} == {acts[1]}
    assert {*load_cycles(fit_baseline(robot, subset(rows, [0])), seed=0)[0].load_point} == {robot.tcp}


def test_what_was_pulled_both_ways_is_reversed() -> None:
    ways = _ways(loaded((100, 0, 0), (-100, 0, 0), (0, 50, 0)), absolute=False)
    assert [(along.tolist(), shares) for along, shares in ways] == [
        ([1.0, 0.0, 0.0], STEPS),
        ([0.0, 1.0, 0.0], ONE_WAY[STEPS]),
    ]


@pytest.mark.parametrize("forces", [[(0.0, 0.0, 0.0)], np.random.default_rng(1).normal(size=(40, 3))])
def test_without_forces_or_under_any_base_axes_are_taken(forces: list[tuple[float, float, float]]) -> None:
    ways = _ways(loaded(*forces), absolute=False)
    np.testing.assert_array_equal([along for along, _ in ways], np.eye(3))
    assert {shares for _, shares in ways} == {STEPS}


def test_joints_are_turned_back_by_full_turns_to_where_they_were_measured() -> None:
    robot = load_robot("kr240-2")  # its sixth joint turns by 350 deg either way, its second from 0 to 146 deg
    known = np.radians([[0.0, 70, -90, 0, 0, -60], [0.0, 80, -90, 0, 0, 60]])
    drawn = np.radians([[0.0, 10, -240, 0, 0, 300], [0.0, 140, 20, 0, 0, -200]])
    found = np.degrees(_few_turns(robot, drawn, known))
    np.testing.assert_allclose(found, [[0, 10, -240, 0, 0, -60], [0, 140, 20, 0, 0, 160]], atol=1e-9)


def way(q: np.ndarray) -> float:
    return float(np.abs(np.diff(q, axis=0)).max(axis=1).sum())


def test_joints_without_limits_stay_where_they_were_measured() -> None:
    robot = load_robot("kr240-2")
    free = tuple(one.model_copy(update={"limits": None}) for one in robot.variables)
    q = np.radians([[0.0, 70, -90, 0, 0, -60], [20.0, 80, -110, 40, 0, 60], [-20.0, 75, -100, 10, 0, 0]])
    down = np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (3, 1))
    rows = rows_of(robot, q, down, displacement=np.full((3, 6), 1e-4), source="table")
    for machine, inside in ((robot, False), (robot.model_copy(update={"variables": free}), True)):
        proposed, _, _ = load_cycles(fit_baseline(machine, rows), seed=0)
        stays = (proposed.q >= q.min(axis=0) - 1e-9) & (proposed.q <= q.max(axis=0) + 1e-9)
        assert stays.all() == inside


def test_postures_along_a_line_are_driven_along_it() -> None:
    q = np.array([0.0, 3.0, 1.0, 4.0, 2.0])[:, None] * [1.0, -0.5]
    assert short_way(q).tolist() == [0, 2, 4, 1, 3]


def test_the_way_is_shorter_and_states_of_a_posture_stay_together_in_their_order() -> None:
    postures = np.random.default_rng(4).uniform(-2, 2, (30, 3))
    q = np.repeat(postures, 2, axis=0)
    order = short_way(q)
    assert sorted(order.tolist()) == list(range(60))
    assert order[0] == 0
    assert (order[1::2] == order[::2] + 1).all()
    assert way(q[order]) < 0.6 * way(q)
