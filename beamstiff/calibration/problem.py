"""The calibration problem: residuals of absolute readings, weighed by their noise, and their derivatives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.calibration.elastic import Elastic, build_elastic
from beamstiff.calibration.error_jacobian import Geometry, Indices, Placed
from beamstiff.calibration.instruments import gap_of_rows, linearised_rows
from beamstiff.calibration.parameters import Parameter
from beamstiff.calibration.wind_up import TOLD, beside_curve
from beamstiff.errors import BeamstiffError, suggest
from beamstiff.identification.input_errors import rigid_motion
from beamstiff.identification.wind_up import COMPONENT, WindUp, of_drives, wind_up
from beamstiff.measure.camera import SCALE, gap_of_camera, scale_column
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation

POSITION_NOISE, ROTATION_NOISE = 3e-5, 5e-5  # m, rad: where a table says none, to begin with


@dataclass(frozen=True, eq=False)
class Problem:
    """Absolute readings to be explained by t parameters: geometry first, compliances behind it; N rows."""

    geometry: Geometry
    elastic: Elastic
    parameters: tuple[Parameter, ...]
    used: NDArray[np.bool_]  # (N, 6) bool: which components were measured; n in all
    sigma: Array  # (N, 6), m and rad: their standard deviations
    claimed: bool  # whether the table states them
    expected: Array  # (t,): what is known of the parameters beforehand
    prior: Array  # (t,): with which standard deviation; inf nothing
    behind: WindUp | None = None  # e contrasts of encoders behind the gears

    @property
    def rows(self) -> Measurements:
        """The measured rows."""
        return self.geometry.rows

    @property
    def count(self) -> int:
        """Number n of measured components."""
        return int(self.used.sum())

    @property
    def size(self) -> Array:
        """Realistic deviations (t,): what columns of different units are scaled by."""
        return np.array([item.size for item in self.parameters])

    def split(self, theta: Array) -> tuple[Array, Array]:
        """Return geometry and compliances."""
        count = len(self.geometry.parameters)
        return theta[:count], theta[count:]

    def placed(self, theta: Array) -> Placed:
        """Return where the points are."""
        geometry, compliance = self.split(theta)
        return self.geometry.placed(geometry, self.elastic.displacement(compliance))

    def gap(self, theta: Array) -> Array:
        """Return measured less predicted, (N, 6), m and rad, measuring frame; 0 where not measured."""
        return self.gap_from(self.placed(theta), theta)

    def values(self, theta: Array) -> dict[str, float]:
        """Return the geometry's parameters by name."""
        return dict(zip((item.name for item in self.parameters), theta.tolist(), strict=True))

    def gap_from(self, placed: Placed, theta: Array) -> Array:
        """Return measured less predicted, (N, 6), where the points are predicted; 0 where not measured."""
        result = np.zeros(self.used.shape)
        position, rotation = self.used[:, :3], self.used[:, 3:].all(axis=1)
        result[:, :3] = np.where(position, self.rows.position - placed.position, 0.0)
        if rotation.any():
            seen = rotation_from_vector(self.rows.rotation[rotation])
            result[rotation, 3:] = vector_from_rotation(seen @ placed.rotation[rotation].swapaxes(-1, -2))
        if self.rows.camera:
            result[:, :3] = gap_of_camera(self.rows, self.values(theta), (placed.position, placed.rotation))
        return gap_of_rows(self.rows, self.values(theta), placed.position, result)

    def residuals(self, theta: Array) -> Array:
        """Return weighed residuals (n + e + p,): behind the readings' those of encoders and of priors."""
        return self._weighed(self.gap(theta), theta)

    def _weighed(self, gap: Array, theta: Array) -> Array:
        known = np.isfinite(self.prior)
        priors = (self.expected - theta)[known] / self.prior[known]
        return np.concatenate([(gap / self.sigma)[self.used], self._wound(theta)[0], priors])

    def _wound(self, theta: Array) -> tuple[Array, Array]:
        """Return the weighed residuals (e,) of encoders behind the gears, and their fall (e, t)."""
        if self.behind is None or self.elastic.model is None:
            return np.zeros(0), np.zeros((0, len(theta)))
        model, (geometry, compliance) = self.behind.alone(self.elastic.model), self.split(theta)
        wound, slopes = model.derivatives(self.elastic.stiffness(compliance), by="compliance")
        columns = np.zeros((len(wound), len(theta)))
        columns[:, len(geometry) :] = slopes[:, COMPONENT] / self.behind.sigma[:, None]
        return (self.behind.value - wound[:, COMPONENT]) / self.behind.sigma, columns

    def linearised(self, theta: Array, deformed: bool = True) -> tuple[Array, Array]:
        """Return weighed residuals (n + e + p,) and their fall for a unit of each parameter, (n + e + p, t).

        The elastic displacement carries the points a little off, so that parameters which look alike on the
        undeformed machine no longer do to rounding; without `deformed` they do.
        """
        geometry, compliance = self.split(theta)
        moved = self.elastic.displacement(compliance) if deformed else None
        placed, jacobian = self.geometry.jacobian(geometry, moved)
        if compliance.size:
            moved = _turned(self.elastic.columns(compliance), self.geometry.turn(geometry))
            jacobian = np.concatenate([jacobian, moved], axis=2)
        if self.rows.camera:
            for at in [at for at, item in enumerate(self.parameters) if item.name == SCALE]:
                jacobian[:, :, at] = scale_column(self.rows)
            jacobian = self.rows.along(jacobian)
        jacobian = linearised_rows(self.rows, self.parameters, self.values(theta), placed.position, jacobian)
        weighed = (jacobian / self.sigma[:, :, None])[self.used]
        known = np.flatnonzero(np.isfinite(self.prior))
        priors = np.zeros((known.size, len(self.parameters)))
        priors[np.arange(known.size), known] = 1.0 / self.prior[known]
        columns = np.concatenate([weighed, self._wound(theta)[1], priors])
        return self._weighed(self.gap_from(placed, theta), theta), columns

    def ahead(self, robot: Robot, rows: Measurements) -> Array:
        """Return what a unit of each parameter adds to other rows, measured or not, (R, 6, t).

        `robot`: that was linearised about; its elastic displacement there counts in no geometry. `rows`: read
        at points that the problem knows.
        """
        poses, pose = np.unique(rows.q, axis=0, return_inverse=True)
        there = replace(self.geometry, rows=rows, poses=poses, pose=pose.reshape(-1))
        geometry, compliance = self.split(self.expected)
        elastic = build_elastic(robot, rows, self.elastic.names, self.elastic.size)
        placed, columns = there.jacobian(geometry, elastic.displacement(compliance))
        if compliance.size:
            turned = _turned(elastic.columns(compliance), there.turn(geometry))
            columns = np.concatenate([columns, turned], axis=2)
        return linearised_rows(rows, self.parameters, self.values(self.expected), placed.position, columns)

    def some(self, chosen: ArrayLike) -> Self:
        """Return the problem of some rows: a mask, or indices."""
        at: Indices = np.arange(len(self.rows))[np.asarray(chosen)]
        rows = subset(self.rows, at)
        poses, pose = np.unique(rows.q, axis=0, return_inverse=True)
        elastic = replace(
            self.elastic,
            held=self.elastic.held[at],
            model=None if self.elastic.model is None else self.elastic.model.rows(at),
        )
        return replace(
            self,
            geometry=replace(self.geometry, rows=rows, poses=poses, pose=pose.reshape(-1)),
            elastic=elastic,
            used=self.used[at],
            sigma=self.sigma[at],
            behind=None if self.behind is None else of_drives(self.behind.drives, rows, beside_curve),
        )


def _turned(columns: Array, turn: Array) -> Array:
    """Return columns (N, 6, c) in the measuring frame."""
    return np.concatenate([turn @ columns[:, :3], turn @ columns[:, 3:]], axis=1)


def build_problem(
    geometry: Geometry,
    elastic: Elastic,
    parameters: Sequence[Parameter],
    start: Array,
    priors: Mapping[str, float] | None = None,
) -> Problem:
    """Return the calibration problem.

    `parameters`: geometry first, compliances behind it. `start` (t,): what the robot says. `priors`: standard
    deviations about what the robot says, by parameter, SI.
    """
    rows = geometry.rows
    used = rows.measured_mask
    names = [item.name for item in parameters]
    prior = np.full(len(names), np.inf)
    for name, std in (priors or {}).items():
        if name not in names:
            raise BeamstiffError(f"prior: {name!r} is not among the parameters{suggest(name, names)}")
        if not (np.isfinite(std) and std > 0):
            raise BeamstiffError(f"prior: {name}: found {std}, expected a positive standard deviation")
        prior[names.index(name)] = std
    stated = np.isfinite(rows.sigma) & used
    usual = np.repeat([POSITION_NOISE, ROTATION_NOISE], 3)
    return Problem(
        geometry=geometry,
        elastic=elastic,
        parameters=tuple(parameters),
        used=used,
        sigma=np.where(stated, rows.sigma, usual),
        claimed=bool(stated[used].all()),
        expected=start,
        prior=prior,
    )


def with_encoders(problem: Problem, robot: Robot) -> tuple[Problem, tuple[str, ...]]:
    """Return the problem with what encoders behind the gears say of its compliances, and notes of it."""
    rows, model = problem.rows, problem.elastic.model
    if model is None or not np.isfinite(rows.link).any():
        return problem, ()
    if not problem.claimed:
        return problem, (
            "the encoders behind the gears are not used: the noise of the positions is not stated",
        )
    found = wind_up(robot, rows, model, rigid_motion(robot, rows), beside_curve, TOLD)
    return replace(problem, behind=found if len(found.port) else None), found.notes
