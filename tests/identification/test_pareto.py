"""The front of position against rotation (seed 003, eqs 31 and 32): its ends, its shape, and no other point.

For rigid links both errors are quadratic in the compliances, and every point of the front solves a weighted
normal equation: a second formulation of the whole front.
"""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.input_errors import InputErrors
from beamstiff.identification.minimise import minimise
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import state_parameters
from beamstiff.identification.pareto import Front, front_of, pareto_front
from beamstiff.identification.problem import state_problem
from beamstiff.identification.statement import state_identification
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from tests.identification.campaigns import POSITION, ROTATION, kr240, measured, rows, sensitivities, white
from tests.identification.test_problem import any_data

SPREAD = np.repeat([POSITION, ROTATION], 3)


def bent() -> tuple[Robot, Measurements]:
    """Return readings of a tool that turns more than its robot: positions and rotations disagree."""
    robot, table = kr240(), rows(kr240(), 15)
    data = measured(robot, table, white(table, 0))
    extra = np.zeros_like(data.displacement)
    extra[:, 3:] = 1e-6 * table.wrench[:, 3:]
    return robot, replace(data, displacement=data.displacement + extra)


@pytest.fixture(scope="module")
def front() -> Front:
    return pareto_front(*bent(), count=9)


def errors(compliance: np.ndarray) -> tuple[float, float]:
    """Return both root mean squares, in standard deviations, from the Jacobian of the paper."""
    robot, data = bent()
    gap = (data.displacement - sensitivities(robot, data) @ compliance) / SPREAD
    return float(np.sqrt((gap[:, :3] ** 2).mean())), float(np.sqrt((gap[:, 3:] ** 2).mean()))


def test_the_ends_are_the_best_positions_and_the_best_rotations(front: Front) -> None:
    robot, data = bent()
    a, d = sensitivities(robot, data) / SPREAD[:, None], data.displacement / SPREAD
    for end, some in ((0, slice(0, 3)), (-1, slice(3, 6))):
        of, target = a[:, some].reshape(-1, 6), d[:, some].ravel()
        best = np.sqrt(((target - of @ np.linalg.lstsq(of, target)[0]) ** 2).mean())
        found = (front.position, front.rotation)[end]
        assert found[end] == pytest.approx(best, rel=1e-6)
    rotations = identify(robot, data, components="rotation", folds=0).stiffness
    assert errors(1 / rotations)[1] == pytest.approx(front.rotation[-1], rel=1e-6)
    positions = identify(robot, data, components="position", folds=0).stiffness
    assert errors(1 / positions)[0] == pytest.approx(front.position[0], rel=1e-6)


def test_every_point_solves_the_weighted_normal_equations(front: Front) -> None:
    robot, data = bent()
    a, d = sensitivities(robot, data) / SPREAD[:, None], data.displacement / SPREAD
    for weight, stiffness in zip(front.weight, front.stiffness, strict=True):
        root = np.sqrt(np.repeat([1 - weight, weight], 3))
        of, target = (root[:, None] * a).reshape(-1, 6), (root * d).ravel()
        # at an end the other error decides, by a millionth, what its own does not tell
        loose = 1e-6 if 1e-3 < weight < 1 - 1e-3 else 1e-4
        assert 1 / stiffness == pytest.approx(np.linalg.lstsq(of, target, rcond=1e-15)[0], rel=loose)


def test_the_errors_stated_are_those_of_the_values(front: Front) -> None:
    robot, data = bent()
    for at in range(len(front)):
        position, rotation = errors(1 / front.stiffness[at])
        assert (front.position[at], front.rotation[at]) == pytest.approx((position, rotation), rel=1e-9)
        gap = data.displacement - predict_displacements(robot.with_parameters(front.values(at)), data)
        assert front.position_rms[at] == pytest.approx(
            np.sqrt((gap[:, :3] ** 2).sum(axis=1).mean()), rel=1e-9
        )
        assert front.rotation_rms[at] == pytest.approx(
            np.sqrt((gap[:, 3:] ** 2).sum(axis=1).mean()), rel=1e-9
        )


def dominated(front: Front) -> bool:
    p, r = front.position, front.rotation
    better = (p[:, None] <= p) & (r[:, None] <= r) & ((p[:, None] < p) | (r[:, None] < r))
    return bool(better.any())


def test_no_point_is_better_than_another_in_both(front: Front) -> None:
    assert len(front) == 9
    assert not dominated(front)
    assert (np.diff(front.position) > 0).all()
    assert (np.diff(front.rotation) < 0).all()


def test_no_values_at_all_are_better_than_the_front_in_both(front: Front) -> None:
    """Twenty thousand draws around and between its points."""
    robot, data = bent()
    random = np.random.default_rng(0)
    problem = state_problem(robot, data)
    ends = np.log(front.stiffness)
    between = random.dirichlet(np.full(len(front), 0.3), 20_000) @ ends
    size = 10 ** random.uniform(-6, -1, (20_000, 1))
    draws = np.exp(between + size * random.normal(size=between.shape))
    residuals = problem.residuals(draws).reshape(-1, len(data), 6)
    p = np.sqrt((residuals[..., :3] ** 2).mean(axis=(1, 2)))
    r = np.sqrt((residuals[..., 3:] ** 2).mean(axis=(1, 2)))
    for position, rotation in zip(front.position, front.rotation, strict=True):
        assert not ((p < position * (1 - 1e-9)) & (r < rotation * (1 - 1e-9))).any()


def test_the_front_is_convex_and_evenly_covered(front: Front) -> None:
    p, r = front.position**2, front.rotation**2
    slopes = np.diff(r) / np.diff(p)
    assert (np.diff(slopes) > 0).all()
    gaps = np.diff(p) / np.ptp(p) - np.diff(r) / np.ptp(r)
    assert gaps.max() < 0.6  # of two: eight gaps


def test_where_the_model_holds_for_both_the_front_is_a_point() -> None:
    robot, table = kr240(), rows(kr240(), 15)
    assert len(pareto_front(robot, measured(robot, table))) == 1


def test_beams_and_loops_have_a_front_too() -> None:
    robot, data = any_data("ir663-screws-beams")
    extra = np.zeros_like(data.displacement)
    extra[:, 4] = 2e-7 * data.wrench[:, 4]
    data = replace(data, displacement=data.displacement + extra)
    front = pareto_front(robot, data, count=5)
    assert not dominated(front)
    names = robot.identify
    for components, own, end in (("position", front.position, 0), ("rotation", front.rotation, -1)):
        problem = state_problem(robot, data, names, components)  # type: ignore[arg-type]
        best = minimise(Objective(problem, state_parameters(names, problem.model.start)))
        assert own[end] == pytest.approx(np.sqrt(2 * best.cost / problem.count), rel=1e-5)


def test_ties_bounds_and_fixed_values_hold_all_along() -> None:
    robot, data = bent()
    names = robot.identify
    bound = 1.2 * robot.parameter(names[1])
    front = pareto_front(
        robot, data, count=5, fixed=[names[0]], ties=[names[3:5]], bounds={names[1]: (bound, None)}
    )
    assert names[0] not in front.parameters
    ratio = (
        front.stiffness[:, front.parameters.index(names[3])]
        / front.stiffness[:, front.parameters.index(names[4])]
    )
    assert ratio == pytest.approx(robot.parameter(names[3]) / robot.parameter(names[4]), rel=1e-9)
    assert (front.stiffness[:, front.parameters.index(names[1])] >= bound * (1 - 1e-9)).all()


def test_other_methods_find_the_same_front(front: Front) -> None:
    found = pareto_front(*bent(), count=9, method="slsqp")
    assert found.position == pytest.approx(front.position, rel=1e-6)
    assert found.rotation == pytest.approx(front.rotation, rel=1e-6)


def test_ctrl_c_returns_the_points_so_far(front: Front) -> None:
    last = front.evaluations // 2
    calls = 0

    def progress(count: int, cost: float) -> None:  # noqa: ARG001
        nonlocal calls
        calls += 1
        if calls >= last:
            raise KeyboardInterrupt

    found = pareto_front(*bent(), count=9, progress=progress)
    assert found.interrupted
    assert 2 <= len(found) < len(front)
    assert not dominated(found)


def test_a_front_as_plain_data_is_the_front(front: Front) -> None:
    data = front.to_dict()
    assert [point["position_rms"] for point in data["points"]] == front.position_rms.tolist()
    assert data["points"][3]["values"] == dict(zip(front.parameters, front.stiffness[3], strict=True))
    assert not data["interrupted"]


def test_what_a_front_does_not_know_is_refused() -> None:
    robot, data = bent()
    names = robot.identify
    problem = state_problem(robot, data)
    plain = Objective(problem, state_parameters(names, problem.model.start))
    with pytest.raises(BeamstiffError, match="no robust loss and no priors"):
        front_of(replace(plain, loss="huber"))
    prior = state_parameters(names, problem.model.start, priors={names[0]: (1e6, 2.0)})
    with pytest.raises(BeamstiffError, match="no robust loss and no priors"):
        front_of(replace(plain, parameters=prior))
    with pytest.raises(BeamstiffError, match="knows no errors of the inputs"):
        front_of(state_identification(robot, data, errors=InputErrors(force=1.0)).objective)
    with pytest.raises(BeamstiffError, match="front: found count = 1, expected 2 or more"):
        pareto_front(robot, data, count=1)


def test_a_front_without_rotations_or_without_positions_is_refused() -> None:
    robot, data = bent()
    for some, missing in ((slice(3, 6), "rotations with their noise"), (slice(0, 3), "positions")):
        displacement = data.displacement.copy()
        displacement[:, some] = np.nan
        with pytest.raises(BeamstiffError, match=f"needs positions and rotations; found no {missing}"):
            pareto_front(robot, replace(data, displacement=displacement))
