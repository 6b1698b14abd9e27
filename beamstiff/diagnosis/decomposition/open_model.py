"""The model with all that was fitted left open: geometry, frames, reflectors and drives beside the causes.

A rigid calibration takes up part of every cause (the sag of a machine stands in its base frame then). So the
causes are not sought in what a calibration leaves, but beside it: residual and tangent are those of one least
squares problem, linear about the calibrated robot, and a cause counts by what the tangent cannot take up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from beamstiff.calibration.calibrate import calibrate, calibrated
from beamstiff.calibration.parameters import STANDS
from beamstiff.calibration.problem import Problem
from beamstiff.calibration.result import Calibration
from beamstiff.calibration.statement import state_problem, with_set_ups
from beamstiff.calibration.validation import in_base_frame
from beamstiff.diagnosis.decomposition.known import FACTOR, known_beforehand
from beamstiff.diagnosis.residual.baseline import KNOWN_FACTOR, Baseline, fit_baseline
from beamstiff.diagnosis.residual.repeats import independent, repeated
from beamstiff.errors import BeamstiffError
from beamstiff.identification.whitening import Whitening, whitening
from beamstiff.measure.arrays import Integers
from beamstiff.measure.camera import without_motion
from beamstiff.measure.table import Measurements
from beamstiff.non_negative import non_negative
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

VALUES_A_PARAMETER = 2  # measured values that a geometry needs at least, to leave anything to causes
INDEPENDENT = 1e-7  # singular value of unit columns, of the largest, below which a direction is rounding


@dataclass(frozen=True, eq=False)
class OpenModel:
    """A least squares problem in units of the stated noise; n measured values, t open parameters.

    Attributes
    ----------
    given : Robot
        As it was described.
    baseline : Baseline
        About which effects are linear: calibrated where the geometry is open, nothing fitted to the rows.
    residual : (n + p,) array
        Behind the measured values what is known of p open parameters beforehand.
    tangent : (n + p, t) array
    pose : (n,) int array
        Posture of every value.
    weigh : Whitening
        Turns measured values into these units.
    present : (d,) array
        Compliances of the drives that are open, the last d of the open parameters: their sum with what they
        change by cannot be negative.
    realistic : (d,) array
        Compliances of these drives that move a point by about 1 mm where they move it most.
    problem : Problem or None
        The calibration, where the geometry is open.
    held : frozenset of str
        Open parameters that a calibration holds, as the readings do not tell them from others.
    carried : (N, 6, d) array or None
        What of the columns of the drives errors of loads are, see `beside_loads`.
    parameters : tuple of str, or None
        Groups of the calibration that are open; None: all.
    under : frozenset of str
        Causes under whose errors of loads what is compliant deforms, see `under_loads`.
    stated : Baseline or None
        The baseline of loads as stated, where `baseline` is under these with such errors.
    near : mapping of str to float, or None
        Parameters of the calibration, by name, in the base frame that it found, which the rows are in.
    """

    given: Robot
    baseline: Baseline
    residual: Array
    tangent: Array
    pose: Integers
    weigh: Whitening
    present: Array
    realistic: Array
    problem: Problem | None = None
    held: frozenset[str] = frozenset()
    carried: Array | None = None
    parameters: tuple[str, ...] | None = None
    under: frozenset[str] = frozenset()
    stated: Baseline | None = None
    near: Mapping[str, float] | None = None

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which components count, (N, 6)."""
        return self.baseline.used

    @property
    def told_apart(self) -> tuple[list[str], Array]:
        """Names and columns (n + p, k) of the open parameters that the readings tell apart."""
        names = (
            self.baseline.fitted if self.problem is None else [*self.problem.values(self.problem.expected)]
        )
        at = [number for number, name in enumerate(names) if name not in self.held]
        return [names[number] for number in at], self.tangent[:, at]

    @property
    def of_told_apart(self) -> OpenModel:
        """The same with the geometry that the readings do not tell apart as it is."""
        known = [] if self.problem is None else [item.name in self.held for item in self.problem.parameters]
        tangent = self.tangent.copy()
        tangent[:, np.flatnonzero(known[: self.geometry.shape[1]])] = 0.0
        return replace(self, tangent=tangent)

    @property
    def geometry(self) -> Array:
        """Columns (n + p, t - d) of the open parameters but the drives."""
        return self.tangent[:, : self.tangent.shape[1] - self.present.size]

    @cached_property
    def open_basis(self) -> Array:
        """Orthonormal basis (n + p, k) of the geometry."""
        return orthonormal(self.geometry)

    @property
    def drives(self) -> Array:
        """Columns (n + p, d) of the drives."""
        return self.tangent[:, self.tangent.shape[1] - self.present.size :]

    @property
    def count(self) -> int:
        """Number n of measured values."""
        return len(self.pose)

    @cached_property
    def independent(self) -> float:
        """As how many the measured values count beside what is systematic in them."""
        if not repeated(self.baseline):
            return float(self.count)
        basis = orthonormal(self.tangent)
        left = self.residual - basis @ (basis.T @ self.residual)
        return independent(self.baseline, left[: self.count])

    @property
    def determined(self) -> float:
        """How many directions of the open parameters the measured values determine, and no prior."""
        return float((self.open_basis[: self.count] ** 2).sum()) + self.present.size

    def with_known(self, values: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return some of the measured values (n,), and all that is known beforehand, (n + p,)."""
        return np.concatenate([values, np.ones(len(self.residual) - self.count, dtype=bool)])

    def part(self, values: NDArray[np.bool_]) -> OpenModel:
        """Return the same with some of the measured values (n,)."""
        used = self.used.copy()
        used[used] = values
        every, baseline = self.with_known(values), replace(self.baseline, used=used)
        return replace(
            self,
            baseline=baseline,
            residual=self.residual[every],
            tangent=self.tangent[every],
            pose=self.pose[values],
            weigh=whitening(baseline.sigma, used, baseline.sharing),
        )

    def weighed(self, columns: Array) -> Array:
        """Return columns (N, 6, c) of the rows in units of the noise, (n + p, c)."""
        seen: Array = self.weigh @ columns[self.used]
        return np.concatenate([seen, np.zeros((len(self.residual) - self.count, columns.shape[-1]))])

    def beside_geometry(self, moved: Array) -> Array:
        """Return displacements (N, 6, c), base frame, as they show beside the open geometry, (n + p, c)."""
        if self.problem is None:
            return _left_of(self.open_basis, self.weighed(moved))
        turn = self.problem.geometry.turn(self.problem.split(self.problem.expected)[0])
        read = np.concatenate([turn @ moved[:, :3], turn @ moved[:, 3:]], axis=1)
        return _left_of(self.open_basis, self.weighed(read))

    def left_by_drives(self, columns: Array, target: Array) -> float:
        """Return what the best compliances, none negative, leave of a target (m,), RMS over the noise.

        `columns` (m, d): what a unit of each moves, see `beside_geometry`.
        """
        unit = np.linalg.norm(columns, axis=0)
        unit = np.where(unit > 0, unit, 1.0)
        return float(non_negative(columns / unit, target)[1] / np.sqrt(max(self.count, 1)))

    def robot(self, change: Array) -> Robot:
        """Return the robot with the open parameters changed by (t,), in the frame of the rows."""
        if self.problem is None:
            names, values = self.baseline.fitted, self.stiffness(change)
            result = self.baseline.robot.with_parameters(dict(zip(names, values.tolist(), strict=True)))
        else:
            about = calibrated(self.baseline.nominal, self.problem, self.problem.expected + change)
            result = about.model_copy(update={"identify": ()})
        finite = [name for name in self.given.identify if 0.0 < result.parameter(name) < np.inf]
        return result.model_copy(update={"identify": tuple(finite)})

    def stiffness(self, change: Array) -> Array:
        """Return the stiffness of the drives (d,) of displacements, open parameters changed by (t,)."""
        given = np.array([self.given.parameter(name) for name in self.baseline.fitted])
        return np.asarray(1.0 / np.maximum(self.present + change, 1.0 / (KNOWN_FACTOR * given)))


def open_geometry(
    robot: Robot,
    rows: Measurements,
    moved: Array | None = None,
    *,
    parameters: Sequence[str] | None = None,
    stations: bool = False,
    settled: bool = False,
    drives: Mapping[str, float] | None = None,
    balance: bool = True,
    near: Mapping[str, float] | None = None,
) -> OpenModel:
    """Return the open model of absolute readings: geometry, base frame, reflectors and drives are free.

    Parameters
    ----------
    robot : Robot
        Where the calibration starts.
    rows : Measurements
        In any measuring frame.
    moved : (N, 6) array, optional
        What causes move the points, in the frame of the rows: the model is linear about the calibration
        beside them.
    parameters : sequence of str, optional
        Groups of the calibration that are free; default all.
    stations : bool
        Whether every table has a base frame of its own.
    settled : bool
        Whether no cause is sought any more: what the calibration leaves is noise then, beside which counts
        what is known beforehand.
    drives : mapping of str to float, optional
        Stiffness that the model is linear about, default what a calibration beside `moved` finds.
    balance : bool
        Whether rotations count for no more than positions by what both scatter; before causes are beside
        them, what of these shows in rotations alone counts as scatter.
    near : mapping of str to float, optional
        Parameters of the calibration of another open model of these rows, see `OpenModel.near`.

    Raises
    ------
    BeamstiffError
        As of `calibrate`: too few readings, a pose that does not close its loops.
    """
    bare = robot.with_parameters(drives or {}).model_copy(update={"identify": ()})
    sound = rows if moved is None else without_motion(rows, moved)
    free = () if drives else robot.identify
    found = calibrate(
        bare,
        sound,
        parameters,
        compliances=free,
        folds=0,
        stations=stations,
        shrink=settled,
        balance=balance,
        near=near,
        spread=np.inf if settled else FACTOR,
    )
    there = in_base_frame(found, rows)
    # a drive that the fit made rigid is open all the same, about the value that it was given
    given = {
        name: robot.parameter(name) for name in robot.identify if not found.robot.parameter(name) < np.inf
    }
    about = found.robot.with_parameters(given).model_copy(update={"identify": ()})
    problem, _ = state_problem(about, there, parameters, compliances=robot.identify, stations=stations)
    problem = replace(with_set_ups(problem, problem.expected), sigma=found.sigma)
    residual, tangent = problem.linearised(problem.expected)
    changes = dict.fromkeys(robot.identify, 0.0) | {one.name: one.change for one in found.parameters}
    changes |= dict.fromkeys(given, 0.0)
    # sockets and planes do not tell the robot's scale, and one that is smaller as a whole leaves less of a
    # gap: where it scatters far beside the stated noise, it would shrink to a point
    noise = max(found.noise, 1.0) if settled or rows.targets else 1.0
    beside = (found.spread or FACTOR, True) if settled else ()
    known = known_beforehand(robot, problem, changes, noise, *beside)
    baseline = replace(
        fit_baseline(about, there, keep=()), used=problem.used, sigma=problem.sigma, given=robot
    )
    if rows.targets:  # what an instrument should read follows from where it stands, which the problem knows
        gap = problem.gap(problem.expected)
        baseline = replace(baseline, measured=np.where(problem.used, gap + baseline.predicted, 0.0))
    return OpenModel(
        robot,
        baseline,
        np.concatenate([residual, known[0]]),
        np.concatenate([tangent, known[1]]),
        there.pose[np.nonzero(problem.used)[0]],
        whitening(problem.sigma, problem.used, baseline.sharing),
        problem.split(problem.expected)[1],
        problem.elastic.size,
        problem,
        frozenset(one.name for one in found.parameters if not one.identified),
        parameters=None if parameters is None else tuple(parameters),
        near=_near(found),
    )


def _near(found: Calibration) -> dict[str, float]:
    """Return the parameters of a calibration in the base frame that it found, of the TCP's frame itself."""
    return {
        one.name: value + one.change
        for one, value in zip(found.parameters, found.statement.problem.expected.tolist(), strict=True)
        if one.parameter.group not in STANDS or (one.parameter.group, one.parameter.unit) == ("target", "m")
    }


def open_as_determined(
    robot: Robot,
    rows: Measurements,
    stations: bool,
    opened: Sequence[tuple[str, ...] | None],
    balance: bool,
) -> tuple[OpenModel, tuple[str, ...] | None]:
    """Return the open model with as much of the geometry free as the readings determine, and what that is."""
    for parameters in opened:
        try:
            model = open_geometry(robot, rows, parameters=parameters, stations=stations, balance=balance)
        except BeamstiffError:  # beside a cause a geometry that is free altogether may let the machine buckle
            if parameters == opened[-1]:
                raise
            continue
        if model.count >= VALUES_A_PARAMETER * model.determined:
            return model, parameters
    raise BeamstiffError(
        f"{rows.source}: found {model.count} measured values, expected at least "
        f"{np.ceil(VALUES_A_PARAMETER * model.determined):.0f} to fit the measuring frame, the reflectors "
        "and the drives: measure more postures"
    )


def open_stiffness(baseline: Baseline) -> OpenModel:
    """Return the open model of a fitted baseline: its stiffness values are free, the geometry is not."""
    weigh = whitening(baseline.sigma, baseline.used, baseline.sharing)
    pose = baseline.rows.pose[np.nonzero(baseline.used)[0]]
    residual, tangent = weigh @ baseline.gap[baseline.used], weigh @ baseline.tangent[baseline.used]
    present = np.array([1.0 / baseline.robot.parameter(name) for name in baseline.fitted])
    return OpenModel(baseline.nominal, baseline, residual, tangent, pose, weigh, present, baseline.realistic)


def _left_of(basis: Array, columns: Array) -> Array:
    return np.asarray(columns - basis @ (basis.T @ columns))


def orthonormal(columns: Array, beside: Array | None = None, least: float = INDEPENDENT) -> Array:
    """Return an orthonormal basis (n, k) of columns (n, c), of what another basis (n, b) leaves of them."""
    if not columns.shape[1]:
        return columns
    size = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(size > 0, size, 1.0)
    if beside is not None:
        unit = unit - beside @ (beside.T @ unit)
    left, values, _ = np.linalg.svd(unit, full_matrices=False)
    return np.asarray(left[:, values > least])


def inverse_of(columns: Array) -> Array:
    """Return the inverse (c, n) of columns (n, c), of what of them is independent."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.asarray(np.linalg.pinv(columns / size, rcond=INDEPENDENT) / size[:, None])
