"""An identification stated in full before it is minimised: what is sought, and what cannot be known."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self, TypedDict

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.identification.degeneracy import Degeneracy, Mixed, find_degeneracy
from beamstiff.identification.input_errors import InputErrors, Response, build_response
from beamstiff.identification.objective import LOSSES, Loss, Objective
from beamstiff.identification.parameters import Parameters, build_parameters
from beamstiff.identification.problem import Components, Problem, build_problem, start_values
from beamstiff.identification.series_parallel import Joined
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


class Options(TypedDict, total=False):
    """What else may be said of an identification; see `build_identification`."""

    fixed: Sequence[str]
    ties: Sequence[Sequence[str]]
    bounds: Mapping[str, tuple[float | None, float | None]] | None
    priors: Mapping[str, tuple[float, float]] | None
    loss: Loss
    components: Components
    errors: InputErrors | None


@dataclass(frozen=True)
class Plan:
    """What is fitted: by name, which parameters stay, which move together, which only groups are known of."""

    silent: dict[str, str]  # parameters that the rows do not feel, each with the reason
    groups: tuple[Joined | Mixed, ...]  # parameters identifiable only in combination
    # parameters that keep the ratio of their starts: the user's, and those of a group
    ties: tuple[Sequence[str], ...]
    held: frozenset[str]  # parameters that stay at their start

    @property
    def grouped(self) -> frozenset[str]:
        """Names of all that are identifiable only in combination."""
        return frozenset(name for group in self.groups for name in group.members)

    @property
    def sums(self) -> tuple[Joined, ...]:
        """The sums that are known of the groups."""
        return tuple(sum_ for group in self.groups for sum_ in group.sums)


@dataclass(frozen=True)
class Statement:
    """An identification, ready to be minimised, and to be minimised again with other readings."""

    robot: Robot
    problem: Problem
    parameters: Parameters
    plan: Plan
    loss: Loss = "linear"
    response: Response | None = None  # what errors of the inputs do; None where there are none

    @property
    def objective(self) -> Objective:
        """What is minimised, as stated."""
        return Objective(self.problem, self.parameters, self.loss)

    def theta(self, stiffness: Array) -> Array:
        """Return the free values theta (t,) of stiffness values (m,), as in `Identification.stiffness`."""
        return np.log(stiffness)[self.parameters.first]

    def weighed(self, stiffness: Array) -> Self:
        """Return the statement with the errors of its inputs as they are at stiffness values (m,)."""
        if self.response is None:
            return self
        return replace(self, problem=self.problem.disturbed(self.response.disturbance(stiffness)))

    def holding(self, stiffness: Array) -> Self:
        """Return the statement with what is held, at stiffness values (m,)."""
        start = np.where(self.parameters.tied < 0, stiffness, self.parameters.start)
        return replace(self, parameters=replace(self.parameters, start=start))

    def measuring(self, measured: Array) -> Self:
        """Return the statement with other readings (N, 6) at the same rows."""
        return replace(self, problem=replace(self.problem, measured=measured))


def build_identification(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    ties: Sequence[Sequence[str]] = (),
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: Loss = "linear",
    components: Components = "both",
    errors: InputErrors | None = None,
) -> Statement:
    """State an identification, arguments as of `beamstiff.identify`: reduce the model, find dependences."""
    if loss not in LOSSES:
        raise BeamstiffError(f"there is no loss {loss!r}; known: {listed(LOSSES)}")
    problem = build_problem(robot, measurements, _free_names(robot, parameters, fixed), components)
    names = problem.model.parameters
    plan = _plan(find_degeneracy(problem), ties, priors or {})
    if len(plan.silent) == len(names):
        raise BeamstiffError(f"{problem.source}: {'; '.join(plan.silent.values())}")
    start = start_values(robot, problem, plan.held)
    stated = build_parameters(names, start, plan.ties, bounds, priors, plan.held)
    statement = Statement(robot, problem, stated, plan, loss)
    if not errors:
        return statement
    if not problem.sigma_known:
        raise BeamstiffError(
            f"{problem.source}: found no noise (sigma_position, sigma_rotation), expected it beside the "
            "errors of loads and joint values"
        )
    response = build_response(robot, concatenate(measurements), errors, names, problem.behind)
    statement = replace(statement, response=response)
    return statement.weighed(start)


def _plan(found: Degeneracy, ties: Sequence[Sequence[str]], priors: Collection[str]) -> Plan:
    silent = {item.name: item.reason for item in found.silent if item.name not in priors}

    def apart(group: Joined | Mixed) -> bool:
        """Whether what the user knows tells the members of a group apart."""
        one = any(set(group.members) <= set(tie) for tie in ties)
        return one or sum(name in priors for name in group.members) >= len(group.members) - 1

    every: list[Joined | Mixed] = [*found.joined, *found.mixed]
    groups = tuple(group for group in every if not apart(group))
    tied = {name for tie in ties for name in tie}
    own = [group.members for group in groups if isinstance(group, Joined) and not tied & set(group.members)]
    held = {name for group in groups if isinstance(group, Mixed) for name in group.held}
    return Plan(silent, groups, (*ties, *own), frozenset((held | set(silent)) - set(priors)))


def _free_names(robot: Robot, parameters: Sequence[str] | None, fixed: Sequence[str]) -> list[str] | None:
    if not fixed:
        return None if parameters is None else list(parameters)
    names = list(robot.identify if parameters is None else parameters)
    for name in fixed:
        if name not in names:
            raise BeamstiffError(f"fixed: {name!r} is not among the parameters{suggest(name, names)}")
    left = [name for name in names if name not in fixed]
    if not left:
        raise BeamstiffError(f"all parameters ({listed(names)}) are fixed: nothing is left to identify")
    return left
