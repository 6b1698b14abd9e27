"""The one call: limits, Ctrl-C, progress, the span that is searched, a second try, and what it refuses."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.identification.minimise import FACTOR, GLOBAL, METHODS, Effort, minimise, searched
from beamstiff.identification.objective import Objective
from beamstiff.identification.parameters import build_parameters
from beamstiff.identification.problem import build_problem
from benchmarks.identification_methods import SOFT, TOLD, campaign
from tests.identification.campaigns import kr240, measured, rows, white


@cache
def objective() -> Objective:
    robot, table = kr240(), rows(kr240(), 10)
    data = measured(robot, table, white(table, 0))
    start = robot.with_parameters({name: 3 * robot.parameter(name) for name in robot.identify})
    problem = build_problem(start, data)
    return Objective(problem, build_parameters(robot.identify, problem.model.start))


def stopping(at: int) -> Callable[[int, float], None]:
    def progress(count: int, cost: float) -> None:
        if count >= at:
            raise KeyboardInterrupt

    return progress


# Ctrl-C


@pytest.mark.parametrize("method", METHODS)
def test_ctrl_c_returns_the_best_so_far(method: str) -> None:
    """Stopped at an evaluation, each method returns the least cost of all it had seen."""
    tried = objective()
    costs: list[float] = []
    # an evaluation of a population counts once for all of it, and `linear` needs two evaluations
    last = {"linear": 2, "genetic": 130}.get(method, 4)

    def progress(count: int, cost: float) -> None:
        costs.append(cost)
        if count >= last:
            raise KeyboardInterrupt

    found = minimise(tried, method, progress=progress)
    assert found.interrupted
    assert found.message == "stopped by hand: the best so far"
    assert found.cost == min(costs)
    assert found.cost == pytest.approx(tried.cost(found.theta), rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_ctrl_c_before_the_first_evaluation_ends_it(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(*_: object) -> None:
        raise KeyboardInterrupt

    for name in ("cost", "costs", "gradient", "jacobian"):
        monkeypatch.setattr(Objective, name, pressed)
    with pytest.raises(KeyboardInterrupt):
        minimise(objective(), method)


def test_an_interrupted_identification_says_so_and_carries_the_best() -> None:
    robot, table = kr240(), rows(kr240(), 10)
    data = measured(robot, table, white(table, 0))
    start = robot.with_parameters({name: 3 * robot.parameter(name) for name in robot.identify})
    found = identify(start, data, method="genetic", progress=stopping(600))
    assert found.interrupted
    assert found.evaluations >= 600
    assert (found.stiffness != [start.parameter(name) for name in robot.identify]).any()
    assert found.rms_held_out is None


def test_ctrl_c_while_polishing_keeps_what_was_found() -> None:
    tried = objective()
    effort = Effort(evaluations=600)
    bare = minimise(tried, "genetic", effort=effort, polish=False)
    found = minimise(tried, "genetic", effort=effort, progress=stopping(bare.evaluations + 2))
    assert found.interrupted
    assert found.cost <= bare.cost


# progress and effort


@pytest.mark.parametrize("method", METHODS)
def test_progress_counts_up_and_its_cost_goes_down(method: str) -> None:
    seen: list[tuple[int, float]] = []
    effort = Effort(evaluations=300)
    found = minimise(objective(), method, effort=effort, progress=lambda n, cost: seen.append((n, cost)))
    counts, costs = np.array(seen).T
    assert (np.diff(counts) > 0).all()
    assert (np.diff(costs) <= 0).all()
    assert counts[-1] == found.evaluations
    assert costs[-1] == found.cost


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ("linear", "genetic")])
def test_a_limit_of_evaluations_is_kept(method: str) -> None:
    found = minimise(objective(), method, effort=Effort(evaluations=7), polish=False)
    assert found.evaluations <= 7 + (method == "levenberg-marquardt")


def test_a_population_is_not_cut_in_two_by_the_limit() -> None:
    found = minimise(objective(), "genetic", effort=Effort(evaluations=100, population=30), polish=False)
    assert found.evaluations in (60, 90)


@pytest.mark.parametrize(
    "wrong", [{"evaluations": 0}, {"evaluations": 1.5}, {"seed": -1}, {"population": 2}, {"population": 0}]
)
def test_an_effort_that_makes_no_sense_is_refused(wrong: dict) -> None:
    [(name, value)] = wrong.items()
    with pytest.raises(BeamstiffError, match=f"effort: found {name} = {value}, expected a whole number"):
        Effort(**wrong)


# what is refused


def test_an_unknown_method_is_named() -> None:
    with pytest.raises(BeamstiffError, match=r"no method 'slqsp' \(did you mean 'slsqp'\?\); known: "):
        minimise(objective(), "slqsp")


@pytest.mark.parametrize("begin", [np.zeros(5), np.full(6, np.nan)])
def test_a_start_that_is_none_is_refused(begin: np.ndarray) -> None:
    with pytest.raises(BeamstiffError, match=r"begin: found .* expected 6 finite logarithms"):
        minimise(objective(), begin=begin)


def test_with_everything_held_the_start_is_the_answer() -> None:
    tried = objective()
    names = tried.parameters.names
    held = replace(tried, parameters=build_parameters(names, tried.problem.model.start, held=set(names)))
    for method in METHODS:
        found = minimise(held, method)
        assert found.message == "nothing to seek"
        assert found.theta.size == 0
        assert found.evaluations == 1


# what global methods search


def test_global_methods_search_the_bounds_where_given_and_a_factor_elsewhere() -> None:
    stated = build_parameters(["a", "b"], np.array([1e5, 1e6]), bounds={"a": (2e4, 3e5)})
    low, high = searched(stated, stated.begin)
    assert np.exp(low) == pytest.approx([2e4, 1e6 / FACTOR])
    assert np.exp(high) == pytest.approx([3e5, 1e6 * FACTOR])


@pytest.mark.parametrize("method", GLOBAL)
def test_global_methods_stay_in_what_they_search_and_say_when_they_end_at_its_edge(method: str) -> None:
    """The start is off by 1e5: the optimum lies outside, and polish gets there."""
    tried = objective()
    names, start = tried.parameters.names, tried.problem.model.start
    off = start * np.array([1e5, 1, 1, 1, 1, 1])
    stated = replace(tried, parameters=build_parameters(names, off))
    effort = Effort(evaluations=3000)
    bare = minimise(stated, method, effort=effort, polish=False)
    low, high = searched(stated.parameters, stated.parameters.begin)
    assert ((bare.theta >= low) & (bare.theta <= high)).all()
    found = minimise(stated, method, effort=effort)
    assert np.exp(found.theta) == pytest.approx(np.exp(minimise(tried).theta), rel=1e-6)
    if method == "genetic":
        assert bare.message.endswith("at the edge of the values searched: J1.torsional")


# several searches


@pytest.mark.parametrize("method", GLOBAL)
def test_of_several_searches_the_best_counts_and_it_is_said_how_many_ended_there(method: str) -> None:
    tried, effort = objective(), Effort(evaluations=300, seed=4)
    alone = [minimise(tried, method, effort=replace(effort, seed=4 + k), polish=False) for k in range(3)]
    best = min(alone, key=lambda found: found.cost)
    told: list[int] = []
    found = minimise(
        tried,
        method,
        effort=replace(effort, searches=3),
        polish=False,
        progress=lambda count, _: told.append(count),
    )
    assert found.theta.tobytes() == best.theta.tobytes()
    assert found.evaluations == sum(one.evaluations for one in alone) == told[-1]
    assert len(told) == 3
    ended = sum(one.cost <= best.cost * (1 + 1e-6) for one in alone)
    assert found.message == f"{best.message}; {ended} of 3 searches ended there"


def test_ctrl_c_keeps_the_best_of_the_searches_that_have_ended() -> None:
    tried, effort = objective(), Effort(evaluations=300)
    first = minimise(tried, "genetic", effort=effort)
    found = minimise(tried, "genetic", effort=replace(effort, searches=3), progress=stopping(1))
    assert found.interrupted
    assert found.theta.tobytes() == first.theta.tobytes()


# a second try


def test_a_minimum_with_a_free_and_a_rigid_spring_is_left_for_a_better_one() -> None:
    """Of the IR-663 with tilting bearings there is another minimum, with one free and the arm rigid."""
    truth = load_robot("ir663").with_parameters(SOFT)
    problem = build_problem(truth, campaign(truth, [[1, 1, 0], [0, 1, -1]]), TOLD)
    best = minimise(Objective(problem, build_parameters(TOLD, problem.model.start)))
    again = 0
    for seed in range(25):
        off = problem.model.start * 10 ** np.random.default_rng(seed).uniform(-2, 2, len(TOLD))
        tried = Objective(problem, build_parameters(TOLD, off))
        found = minimise(tried)
        assert found.cost == pytest.approx(best.cost, rel=1e-9)
        if found.message.endswith("; better from balanced values"):
            again += 1
            # where the start is given it is the only one
            assert minimise(tried, begin=tried.parameters.begin).cost > 1.1 * best.cost
    assert again >= 1
