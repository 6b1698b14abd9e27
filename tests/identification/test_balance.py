"""Balanced values: at them every spring shows, whatever the robot's own values are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff import load_robot
from beamstiff.identification.problem import balanced_stiffness, build_problem
from beamstiff.measure.table import make_measurements
from beamstiff.model.ports import reduce_to_ports
from benchmarks.identification_methods import SEVEN, campaign
from tests.fem.builders import RIGID, frame
from tests.identification.campaigns import compliances, kr240, measured, rows, sensitivities


def test_joints_of_a_serial_robot_all_move_the_tool_by_as_much() -> None:
    """Root mean square over the rows of what each alone moves, turns counted at the machine's size."""
    robot, table = kr240(), rows(kr240(), 50)
    model = reduce_to_ports(robot, table)
    each = sensitivities(robot, table) / balanced_stiffness(model)
    each[:, 3:] *= model.lever.max()
    moved = np.sqrt((each**2).sum(axis=1).mean(axis=0))
    assert moved == pytest.approx(moved[0], rel=1e-9)


@given(factors=st.lists(st.floats(1e-6, 1e6), min_size=6, max_size=6))
def test_the_robots_own_values_do_not_matter(factors: list[float]) -> None:
    robot, table = kr240(), rows(kr240(), 6)
    own = 1 / compliances(robot)
    other = robot.with_parameters(dict(zip(robot.identify, (own * factors).tolist(), strict=True)))
    assert balanced_stiffness(reduce_to_ports(other, table)) == pytest.approx(
        balanced_stiffness(reduce_to_ports(robot, table)), rel=1e-9
    )


def test_a_spring_beside_elastic_parts_is_as_stiff_as_they_are() -> None:
    """A strut along a cantilever: the bar's E A / L."""
    bar = frame([(0, 0, 0), (2, 0, 0)], beams=[(0, 1)], struts=[(0, 1, 1.0)])
    table = make_measurements(
        [], np.zeros((1, 0)), tcp="n1", wrench=[[1e3, 0, 0, 0, 0, 0]], displacement=[[0.0] * 6]
    )
    found = balanced_stiffness(reduce_to_ports(bar, table, ["t0"]))
    assert found == pytest.approx([210e9 * 2.1e-3 / 2], rel=1e-9)


def test_without_load_values_are_those_of_the_neighbours() -> None:
    """Nothing acts: no number may come out that is none."""
    spring = (RIGID, RIGID, 1e5, RIGID)
    twins = frame(
        [(0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0)],
        rigids=[(1, 2)],
        joints=[(0, 1, (0, 0, 1), spring), (2, 3, (0, 0, 1), spring)],
    )
    for wrench in ([0.0] * 6, [0, 1e3, 0, 0, 0, 0]):
        table = make_measurements([], np.zeros((1, 0)), tcp="n3", wrench=[wrench], displacement=[[0.0] * 6])
        found = balanced_stiffness(reduce_to_ports(twins, table, ["j0.torsional", "j1.torsional"]))
        assert (np.isfinite(found) & (found > 0)).all()


def test_at_balanced_values_no_parameter_that_acts_is_hidden() -> None:
    """The paper's bearings are stiff beyond what readings show; balanced, all columns are of one length."""
    robot = load_robot("ir663")
    problem = build_problem(robot, campaign(robot, [[1, 0, 0], [0, 0, -1]]), SEVEN)

    def lengths(stiffness: np.ndarray) -> np.ndarray:
        return np.linalg.norm(problem.jacobian(stiffness)[1], axis=0)

    own, balanced = lengths(problem.model.start), lengths(balanced_stiffness(problem.model))
    assert own.max() / own.min() > 1e5
    assert balanced.max() / balanced.min() < 10


def test_balanced_values_are_positive_for_every_robot() -> None:
    for name in ("kr240-2", "kr500"):
        robot = load_robot(name)
        table = measured(robot, rows(robot, 4))
        assert (balanced_stiffness(reduce_to_ports(robot, table)) > 0).all()
