"""The front of position against rotation (seed 003, eqs 31 and 32): its ends, its shape, and no other point.

For rigid links both errors are quadratic in the compliances, and every point of the front solves a weighted
normal equation: a second formulation of the whole front.
"""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Robot, identify
from beamstiff.errors import BeamstiffError
from beamstiff.identification.pareto import Front
from beamstiff.identification.problem import build_problem
from beamstiff.measure.table import Measurements
from tests.identification.campaigns import POSITION, ROTATION, kr240, measured, rows, sensitivities, white

SIGMA = np.repeat([POSITION, ROTATION], 3)


def bent() -> tuple[Robot, Measurements]:
    """Return readings of a tool that turns more than its robot: positions and rotations disagree."""
    robot, table = kr240(), rows(kr240(), 15)
    data = measured(robot, table, white(table, 0))
    extra = np.zeros_like(data.displacement)
    extra[:, 3:] = 1e-6 * table.wrench[:, 3:]
    return robot, replace(data, displacement=data.displacement + extra)


@pytest.fixture(scope="module")
def front() -> Front:
    found = identify(*bent(), folds=0, pareto=9).front
    assert found is not None
    return found


def test_every_point_solves_the_weighted_normal_equations(front: Front) -> None:
    robot, data = bent()
    a, d = sensitivities(robot, data) / SIGMA[:, None], data.displacement / SIGMA
    assert len(front.weight) == 9
    for weight, stiffness in zip(front.weight, front.stiffness, strict=True):
        root = np.sqrt(np.repeat([1 - weight, weight], 3))
        of, target = (root[:, None] * a).reshape(-1, 6), (root * d).ravel()
        # at an end the other error decides, by a millionth, what its own does not tell
        loose = 1e-6 if 1e-3 < weight < 1 - 1e-3 else 1e-4
        assert 1 / stiffness == pytest.approx(np.linalg.lstsq(of, target, rcond=1e-15)[0], rel=loose)


def test_the_ends_are_what_positions_and_rotations_alone_say(front: Front) -> None:
    robot, data = bent()
    for end, components, part in ((0, "position", slice(0, 3)), (-1, "rotation", slice(3, 6))):
        alone = identify(robot, data, components=components, folds=0)
        left = (alone.predicted - data.displacement)[:, part]
        assert front.rms[end][end] == pytest.approx(np.sqrt((left**2).sum(axis=1).mean()), rel=1e-6)


def test_no_values_at_all_are_better_in_both(front: Front) -> None:
    """Twenty thousand draws around and between its points; and none of its own points is."""
    robot, data = bent()
    assert (np.diff(front.relative[:, 0]) > 0).all()
    assert (np.diff(front.relative[:, 1]) < 0).all()
    random = np.random.default_rng(0)
    between = random.dirichlet(np.full(9, 0.3), 20_000) @ np.log(front.stiffness)
    size = 10 ** random.uniform(-6, -1, (20_000, 1))
    draws = np.exp(between + size * random.normal(size=between.shape))
    left = build_problem(robot, data).residuals(draws).reshape(-1, len(data), 2, 3)
    drawn = np.sqrt((left**2).mean(axis=(1, 3)))
    for point in front.relative:
        assert not (drawn < point * (1 - 1e-9)).all(axis=1).any()


def test_where_the_model_holds_for_both_the_front_is_a_point() -> None:
    robot, table = kr240(), rows(kr240(), 15)
    found = identify(robot, measured(robot, table), folds=0, pareto=5)
    assert found.front is not None
    assert len(found.front.weight) == 1
    assert found.front.stiffness[0] == pytest.approx(found.stiffness, rel=1e-6)


def test_what_has_no_front_is_refused() -> None:
    robot, data = bent()
    for given in ({"loss": "huber"}, {"components": "position"}, {"priors": {robot.identify[0]: (1e6, 2.0)}}):
        with pytest.raises(BeamstiffError, match="pareto: is of squared errors of both"):
            identify(robot, data, folds=0, pareto=3, **given)
    with pytest.raises(BeamstiffError, match="pareto: found 1, expected 2 points or more"):
        identify(robot, data, folds=0, pareto=1)
    turned = data.displacement.copy()
    turned[:, 3:] = np.nan
    with pytest.raises(BeamstiffError, match="pareto: found no rotations with their noise"):
        identify(robot, replace(data, displacement=turned), folds=0, pareto=3)
