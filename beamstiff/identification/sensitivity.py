"""Monte Carlo sensitivity to the errors of tracker, loads and joint readings (seed 000, section 5.2).

The identified machine is measured again and again with errors drawn from each source by itself, and from all
together; what the identification then finds scatters. Readings, loads and joint values in the table stay the
same: it is the machine that was elsewhere.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import repeat

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.identification.bootstrap import sums_of, values_of
from beamstiff.identification.input_errors import InputErrors, rigid_motion
from beamstiff.identification.refit import refit
from beamstiff.identification.statement import Statement
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

READINGS, ALL = "readings", "all"

AT_ONCE = 2500  # rows that are condensed together


@dataclass(frozen=True)
class Sensitivity:
    """How far each source of errors moves the identified values."""

    names: tuple[str, ...]  # (m): parameters
    relations: tuple[str, ...]  # (s): sums that are known though their members are not
    # (S): "readings" (of the tracker), then those of `InputErrors` that are not zero, then "all"
    sources: tuple[str, ...]
    stiffness: Array  # (S, R, m): what was found in each repetition
    sums: Array  # (S, R, s)
    true: Array  # (m,): what there was to find

    @property
    def spread(self) -> Array:
        """Standard deviation of the compliances over the true ones, (S, m); to first order also of k."""
        return np.asarray((self.true / self.stiffness).std(axis=1, ddof=1))

    @property
    def bias(self) -> Array:
        """Mean error of the compliances over the true ones, (S, m)."""
        return np.asarray((self.true / self.stiffness).mean(axis=1) - 1.0)


def sensitivity(
    statement: Statement,
    measurements: Measurements,
    theta: Array,
    errors: InputErrors,
    repetitions: int = 500,
    seed: int = 0,
) -> Sensitivity:
    """Return how far errors of the readings, loads and joint values move what is identified.

    `measurements`: the table it states. `theta` (t,): its optimum: the machine that is measured again.
    `errors`: of the loads and joint values. Those of the readings are the table's. `repetitions`: for each
    source.
    """
    problem = statement.problem
    if problem.behind is not None:
        raise BeamstiffError(
            f"{problem.source}: found encoders behind the gears, whose errors are not drawn; leave them out"
        )
    if len(measurements) != len(problem.measured):
        raise BeamstiffError(
            f"{measurements.source}: found {len(measurements)} rows, expected the {len(problem.measured)} of "
            f"{problem.source}"
        )
    if not problem.sigma_known:
        raise BeamstiffError(
            f"{problem.source}: found no noise (sigma_position, sigma_rotation), expected it to draw from"
        )
    if repetitions < 2:
        raise BeamstiffError(f"sensitivity: found {repetitions} repetitions, expected two or more")
    true = statement.parameters.stiffness(theta)
    kinds = [field.name for field in fields(errors) if getattr(errors, field.name) > 0]
    drawn = {kind: InputErrors(**{kind: getattr(errors, kind)}) for kind in kinds}
    sources = {READINGS: InputErrors(), **drawn, **({ALL: errors} if kinds else {})}
    streams = np.random.default_rng(seed).spawn(len(sources))
    found = []
    for (source, of_source), random in zip(sources.items(), streams, strict=True):
        noise = problem.sigma if source in (READINGS, ALL) else np.zeros_like(problem.sigma)
        models: Iterator[PortModel] = repeat(problem.model, repetitions)
        if of_source:
            names = statement.parameters.names
            models = as_they_were(statement.robot, measurements, of_source, names, repetitions, random)
        thetas = []
        for model in models:
            seen = model.predict(true) + _noise(statement, noise, random)
            again = statement.measuring(np.where(problem.used, seen, 0.0))
            thetas.append(refit(again.objective, theta))
        found.append(np.array(thetas))
    return Sensitivity(
        names=statement.parameters.names,
        relations=tuple(sum_.text() for sum_ in statement.plan.sums),
        sources=tuple(sources),
        stiffness=np.array([values_of(statement, thetas) for thetas in found]),
        sums=np.array([sums_of(statement, thetas) for thetas in found]),
        true=true,
    )


def _noise(statement: Statement, sigma: Array, random: np.random.Generator) -> Array:
    """Return errors of the readings (N, 6): half of the variance of a shared unloaded reading is common."""
    problem = statement.problem
    own = random.standard_normal(sigma.shape)
    if not (problem.sharing >= 0).any():
        return sigma * own
    group = np.unique(problem.sharing, return_inverse=True)[1].reshape(-1)
    common = random.standard_normal((group.max() + 1, 6))[group]
    both = np.sqrt(0.5) * (own + common)
    return sigma * np.where(problem.sharing[:, None] >= 0, both, own)


def as_they_were(
    robot: Robot,
    rows: Measurements,
    errors: InputErrors,
    parameters: tuple[str, ...],
    count: int,
    random: np.random.Generator,
) -> Iterator[PortModel]:
    """Yield the model of N rows at loads and joint values drawn around those in the table, several times.

    Rows of a pose share the error of the joint values.
    """
    n = len(rows)
    pose = np.unique(rows.pose, return_inverse=True)[1].reshape(-1)
    spread, hold = errors.of_variables(robot), errors.of_hold(robot)
    motion = rigid_motion(robot, rows)
    some = max(1, AT_ONCE // n)
    for start in range(0, count, some):
        times = min(some, count - start)
        every = subset(rows, np.tile(np.arange(n), times))
        size = np.linalg.norm(every.wrench[:, :3], axis=1, keepdims=True)
        share = np.divide(errors.load, size, out=np.zeros_like(size), where=size > 0)
        wrench = every.wrench * (1 + share * random.standard_normal(size.shape))
        wrench = wrench + random.standard_normal(wrench.shape) * np.repeat([errors.force, errors.moment], 3)
        off = spread * random.standard_normal((times, pose.max() + 1, spread.size))
        shifted = replace(every, wrench=wrench, q=every.q + off[:, pose].reshape(len(every), -1))
        model = reduce_to_ports(robot, shifted, parameters, gravity=False).along(shifted)
        if hold.any():
            let_go = hold * random.standard_normal((len(every), hold.size))
            moved = np.einsum("nij,nj->ni", np.tile(motion, (times, 1, 1)), let_go)
            model = replace(model, clamped=model.clamped + moved)
        for at in range(times):
            yield model.rows(np.arange(at * n, (at + 1) * n))
