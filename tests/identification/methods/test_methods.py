"""Every method behind the one call: the same optimum where it is unique, its limits said, no raw errors.

The optimum is that of dense linear least squares in the compliances (seed 000, eqs 18 to 26), written here
with the Jacobian of the KR240-2; for the IR-663, whose beams and loops carry load past the springs, it is
where the derivative by complex step vanishes, and what all methods agree on.
"""

from dataclasses import replace
from functools import cache

import nlopt
import numpy as np
import pytest
from scipy.optimize import nnls

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.methods.linear import bounded_step
from beamstiff.identification.minimise import GLOBAL, METHODS, Effort, minimise
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import build_parameters
from beamstiff.identification.problem import build_problem
from benchmarks.identification_methods import SEVEN, SOFT, campaign
from tests.identification.campaigns import (
    POSITION,
    ROTATION,
    kr240,
    least_squares,
    measured,
    rows,
    sensitivities,
    white,
)

LOCAL = [name for name in METHODS if name not in GLOBAL]
FEW = Effort(evaluations=3000)


@cache
def kr240_objective(seed: int = 0, factor: float = 3.0) -> tuple[Objective, np.ndarray]:
    """Return an objective that starts off by a factor, and the optimal compliances by least squares."""
    robot, table = kr240(), rows(kr240(), 10, 2)
    data = measured(robot, table, white(table, seed))
    start = robot.with_parameters({name: factor * robot.parameter(name) for name in robot.identify})
    problem = build_problem(start, data)
    spread = np.tile(np.repeat([POSITION, ROTATION], 3), len(table))
    a = sensitivities(robot, table).reshape(-1, 6)
    best, *_ = least_squares(a, data.displacement.ravel(), np.diag(spread**2))
    return Objective(problem, build_parameters(robot.identify, problem.model.start)), best


@pytest.fixture(scope="module")
def ir663() -> tuple[Objective, np.ndarray]:
    """Return an objective that starts off by factors of up to three, and the optimum by the trust region."""
    truth = load_robot("ir663").with_parameters(SOFT)
    names = ["J12.torsional", "J18.torsional", "J1010.radial", *SOFT]
    factors = 10 ** np.random.default_rng(1).uniform(-0.5, 0.5, 7)
    off = zip(names, factors, strict=True)
    start = truth.with_parameters({name: truth.parameter(name) * factor for name, factor in off})
    problem = build_problem(start, campaign(truth, [[1, 1, 0], [0, 1, -1]]), names)
    objective = Objective(problem, build_parameters(names, problem.model.start))
    return objective, minimise(objective).theta


@pytest.mark.parametrize("method", LOCAL)
def test_local_methods_end_at_the_least_squares_solution(method: str) -> None:
    objective, best = kr240_objective()
    found = minimise(objective, method)
    assert np.exp(-found.theta) == pytest.approx(best, rel=1e-6)
    assert found.evaluations > 0
    assert found.message


@pytest.mark.parametrize("method", LOCAL)
def test_local_methods_agree_where_beams_and_loops_carry_load_past_the_springs(
    method: str, ir663: tuple[Objective, np.ndarray]
) -> None:
    objective, best = ir663
    found = minimise(objective, method)
    assert found.theta == pytest.approx(best, abs=1e-6)
    _, gradient = objective.gradient(found.theta)
    curvature = (objective.jacobian(found.theta)[1] ** 2).sum(axis=0)
    assert (np.abs(gradient) < 1e-4 * np.sqrt(curvature)).all()  # as many standard deviations from the bottom


@pytest.mark.parametrize("method", GLOBAL)
def test_global_methods_go_down_by_themselves_and_are_exact_when_polished(method: str) -> None:
    objective, best = kr240_objective()
    bare = minimise(objective, method, effort=FEW, polish=False)
    polished = minimise(objective, method, effort=FEW)
    assert 0 < bare.evaluations <= FEW.evaluations
    assert bare.cost < 0.5 * objective.cost(objective.parameters.begin)
    assert polished.cost <= bare.cost
    assert "polished" in polished.message
    assert np.exp(-polished.theta) == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize("method", GLOBAL)
def test_global_methods_repeat_themselves_by_their_seed(method: str) -> None:
    objective, _ = kr240_objective()
    once, again, other = (
        minimise(objective, method, effort=Effort(evaluations=400, seed=seed), polish=False)
        for seed in (3, 3, 4)
    )
    assert (once.theta == again.theta).all()
    if method != "mlsl":  # its points come from a sequence of low discrepancy, not from a seed
        assert (once.theta != other.theta).any()


@pytest.mark.parametrize("method", [*LOCAL, "genetic", "mlsl"])
def test_methods_that_know_bounds_keep_them(method: str) -> None:
    """With J2's compliance bounded away from its optimum the others take theirs given that one."""
    objective, best = kr240_objective()
    names = objective.parameters.names
    bound = 1.3 / best[1]
    limited = replace(
        objective,
        parameters=build_parameters(names, objective.problem.model.start, bounds={names[1]: (bound, None)}),
    )
    if method == "levenberg-marquardt":
        with pytest.raises(BeamstiffError, match="met bounds, which it does not know; use trust-region"):
            minimise(limited, method)
        return
    found = np.exp(minimise(limited, method, effort=FEW if method in GLOBAL else None).theta)
    residual, by_log = objective.problem.jacobian(found)
    slopes = -by_log * found  # by the compliances
    others = [0, 2, 3, 4, 5]
    target = slopes @ (1 / found) - residual - slopes[:, 1] / bound
    expected = np.linalg.lstsq(slopes[:, others], target)[0]
    assert found[1] == pytest.approx(bound, rel=1e-7)
    assert 1 / found[others] == pytest.approx(expected, rel=1e-6)


def test_the_linear_method_is_nonnegative_least_squares() -> None:
    """Where noise asks for a negative compliance, Lawson and Hanson's algorithm says what is best."""
    robot, table = kr240(), rows(kr240(), 2)
    truth = robot.with_parameters({"J4.torsional": 1e12})
    a = sensitivities(robot, table).reshape(-1, 6) / np.tile(np.repeat([POSITION, ROTATION], 3), 2)[:, None]
    for seed in range(20):
        data = measured(truth, table, white(table, seed))
        expected, _ = nnls(
            a * 1e-6, data.displacement.ravel() / np.tile(np.repeat([POSITION, ROTATION], 3), 2)
        )
        problem = build_problem(robot, data)
        found = minimise(Objective(problem, build_parameters(robot.identify, problem.model.start)), "linear")
        assert 1e6 * np.exp(-found.theta) == pytest.approx(expected, rel=1e-6, abs=1e-6 * expected.max())
        if expected[3] == 0:
            return
    pytest.fail("no noise asked for a negative compliance: choose another robot")


def test_one_linear_step_is_exact_where_statics_gives_the_forces() -> None:
    objective, best = kr240_objective(factor=100.0)
    found = minimise(objective, "linear")
    assert found.message == "converged in 1 step"
    assert np.exp(-found.theta) == pytest.approx(best, rel=1e-9)


def test_a_step_within_bounds_is_that_of_bounded_least_squares() -> None:
    """One free column: the clipped quotient."""
    column = np.array([[1.0], [2.0]])
    for target, expected in ((3.0, 3.0), (-1.0, 0.5), (9.0, 4.0)):
        residuals = column[:, 0] * (1.0 - target)
        found = bounded_step(np.ones(1), residuals, column, np.array([0.5]), np.array([4.0]))
        assert found == pytest.approx([expected], rel=1e-12)


@pytest.mark.parametrize("method", ["linear", "levenberg-marquardt"])
def test_methods_of_plain_least_squares_refuse_a_robust_loss(method: str) -> None:
    objective, _ = kr240_objective()
    with pytest.raises(BeamstiffError, match=f"{method}: knows no robust loss; use trust-region"):
        minimise(replace(objective, loss="huber"), method)


def test_levenberg_marquardt_turns_back_at_its_bounds() -> None:
    """Springs in series: the flat valley sends its steps beyond all numbers."""
    robot = load_robot("ir663")
    problem = build_problem(robot, campaign(robot, [[1, 0, 0], [0, 0, -1]]), SEVEN)
    best = minimise(Objective(problem, build_parameters(SEVEN, problem.model.start))).cost
    for seed in range(8):
        start = problem.model.start * 10 ** np.random.default_rng(seed).uniform(-0.5, 0.5, 7)
        found = minimise(Objective(problem, build_parameters(SEVEN, start)), "levenberg-marquardt")
        assert found.cost == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("method", [name for name in METHODS if METHODS[name] == "nlopt_methods"])
def test_errors_inside_nlopt_come_out_as_they_are(method: str) -> None:
    """NLopt would swallow them, or turn them into its own."""
    objective, _ = kr240_objective()

    class StopError(Exception):
        pass

    def progress(count: int, cost: float) -> None:
        if count == 5:
            raise StopError

    with pytest.raises(StopError):
        minimise(objective, method, progress=progress)


def test_what_nlopt_itself_raises_keeps_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    objective, _ = kr240_objective()
    optimize = nlopt.opt.optimize

    def failing(self: nlopt.opt, x: np.ndarray) -> None:
        optimize(self, x)
        raise nlopt.nlopt.runtime_error("nlopt failure")

    monkeypatch.setattr(nlopt.opt, "optimize", failing)
    found = minimise(objective, "slsqp")
    assert found.message.startswith("stopped by NLopt")
    assert found.cost < objective.cost(objective.parameters.begin)
