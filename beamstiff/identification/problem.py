"""The identification problem: whitened residuals of all measured components, with exact derivatives."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.identification.input_errors import rigid_motion
from beamstiff.identification.whitening import (
    Disturbance,
    Whitening,
    disturbed_covariance,
    inverse_root,
    of_blocks,
    whitening,
)
from beamstiff.identification.wind_up import COMPONENT, WindUp, between_loads, wind_up
from beamstiff.measure.arrays import Integers, equal_rows
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import Parametrisation, PortModel, reduce_to_ports
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.se3 import Array

Components = Literal["position", "rotation", "both"]

# where no noise is stated all components count alike; how much they scatter is then read from the residual
UNIT_NOISE = 1e-5
LEAST_LOAD = 1e-50  # N or N m; below, squares leave the range of numbers
AS_GOOD_AS = 1e6  # times the stiffness that explains all of the displacements: as good as rigid


@dataclass(frozen=True)
class Problem:
    """Residuals ``W (measured - predicted)`` over the measured components.

    Of N rows: those of the table, and behind them the contrasts of encoders behind the gears (`wind_up`).
    """

    model: PortModel  # m open stiffness values, N rows
    measured: Array  # (N, 6): displacement ``[d, r]``
    used: NDArray[np.bool_]  # (N, 6): which of them count; n in all
    sigma: Array  # (N, 6): standard deviation of each, m and rad
    sigma_known: bool  # whether the noise was stated; if not, it is estimated from the residual
    # (N,): rows that share one unloaded reading have one number; -1 where a row has its own
    sharing: Integers
    # pose, load, (N,): rows of one pose, and of one load whatever its pose, have one number
    pose: Integers
    load: Integers
    whitening: Whitening  # W, with ``W cov W^T = 1``, (n, n)
    source: str  # where the rows come from, for messages
    notes: tuple[str, ...] = ()  # what was left aside, in sentences
    # what errors of the loads and of the joint readings add to the noise
    disturbance: Disturbance | None = None
    behind: WindUp | None = None  # of the whole table: its last rows

    @property
    def readings(self) -> int:
        """Number of rows that are the table's."""
        return len(self.measured) - (0 if self.behind is None else len(self.behind.port))

    def without(self, out: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which rows (N,) have nothing of the table's rows `out`."""
        if self.behind is None:
            return ~out
        return ~np.concatenate([out, abs(self.behind.contrast) @ out > 0])

    @property
    def count(self) -> int:
        """Number n of measured components used."""
        return int(self.used.sum())

    def residuals(self, stiffness: Array) -> Array:
        """Return the whitened residuals, (..., n), for stiffness values (..., m)."""
        gap = (self.measured - self.model.predict(stiffness))[..., self.used]
        return (self.whitening @ gap.T).T

    def jacobian(self, stiffness: Array, by: Parametrisation = "log") -> tuple[Array, Array]:
        """Return whitened residuals (n,) and their derivatives (n, m) at stiffness values (m,).

        `by`: their logarithms, themselves, or their inverses.
        """
        predicted, slopes = self.model.derivatives(stiffness, by)
        residual = self.whitening @ (self.measured - predicted)[self.used]
        jacobian = self.whitening @ -slopes[self.used]
        return residual, jacobian

    def rows(self, chosen: ArrayLike) -> Self:
        """Return the problem of some rows: a mask (N,), or indices; a row may come several times."""
        at = np.arange(len(self.measured))[np.asarray(chosen)]
        used, sigma, sharing = self.used[at], self.sigma[at], self.sharing[at]
        undisturbed = replace(
            self,
            model=self.model.rows(at),
            measured=self.measured[at],
            used=used,
            sigma=sigma,
            sharing=sharing,
            pose=self.pose[at],
            load=self.load[at],
            whitening=whitening(sigma, used, sharing),
            disturbance=None,
            behind=None,
        )
        if self.disturbance is None:
            return undisturbed
        return undisturbed.disturbed(self.disturbance.rows(at))

    def disturbed(self, disturbance: Disturbance) -> Self:
        """Return the problem with errors of its inputs added to the noise."""
        blocks = disturbed_covariance(self.sigma, self.used, self.sharing, self.pose, disturbance)
        return replace(self, disturbance=disturbance, whitening=of_blocks(inverse_root(blocks)))


def build_problem(
    robot: Robot,
    data: Measurements | Sequence[Measurements],
    parameters: Sequence[str] | None = None,
    components: Components = "both",
) -> Problem:
    """Return the identification problem of a robot and its measured displacements.

    `data`: displacements, loaded minus unloaded. `parameters`: stiffness values to identify; default
    ``robot.identify``. `components`: which measured components count; each by its noise.
    """
    measurements = concatenate(data)
    source = measurements.source
    if robot.effects:
        names = listed(effect.effect for effect in robot.effects)
        raise BeamstiffError(
            f"robot {robot.name!r}: its effects ({names}) are not part of this fit; take them off the "
            "readings first: robot, rows = beamstiff.diagnosis.without_effects.without_effects(robot, rows)"
        )
    if measurements.kind != "displacement":
        raise BeamstiffError(
            f"{source}: holds absolute positions; identify needs displacements dx dy dz (loaded minus "
            "unloaded); `calibrate` and `diagnose` take positions"
        )
    if not measurements.wrench.any():
        raise BeamstiffError(f"{source}: all loads are zero; without load no stiffness can be identified")
    used = measurements.measured_mask.copy()
    used[:, 3:] &= components != "position"
    used[:, :3] &= components != "rotation"
    notes = []
    sigma = measurements.sigma
    stated = np.isfinite(sigma) & used
    if components == "both" and used[:, 3:].any() and not stated[:, 3:].any():
        used[:, 3:] = False  # metres and radians compare only by their noise
        notes.append("the rotations are not used: the table does not say their noise (sigma_rotation)")
    if not used.any():
        what = "measured displacements" if components == "both" else f"measured components of {components}"
        raise BeamstiffError(f"{source}: found no {what}")
    if not (np.abs(measurements.wrench[used.any(axis=1)]) > LEAST_LOAD).any():
        raise BeamstiffError(f"{source}: all measured rows are without load; no stiffness can be identified")
    stated &= used
    if stated.any() and (stated != used).any():
        row = int(np.argmax((stated != used).any(axis=1)))
        raise BeamstiffError(
            f"{measurements.place(row)}: the noise of this row is not stated (sigma_position, "
            "sigma_rotation), that of others is; expected it for all, or for none"
        )
    model = reduce_to_ports(robot, measurements, parameters).along(measurements)
    behind = None
    if np.isfinite(measurements.link).any():
        behind, note = _behind(robot, measurements, model, bool(stated.any()))
        notes += note
    if used.sum() + (0 if behind is None else len(behind.port)) < len(model.parameters) + (
        not stated.any()
    ):  # noise that is not stated is one more unknown
        count, rows, sought = int(used.sum()), int(used.any(axis=1).sum()), model.parameters
        noise = "" if stated.any() else " and the noise, which is not stated"
        advice = ["measure more", *([] if stated.any() else ["state the noise (# sigma_position: 0.03 mm)"])]
        advice += ["identify fewer"] if len(sought) > 1 else []
        raise BeamstiffError(
            f"{source}: {count} measured component{'s'[: count > 1]} in {rows} row{'s'[: rows > 1]} for "
            f"{len(sought)} parameter{'s'[: len(sought) > 1]} ({listed(sought)}){noise}; "
            f"{', or '.join(advice)}"
        )
    spread = np.where(used, sigma, 1.0) if stated.any() else np.full(used.shape, UNIT_NOISE)
    problem = Problem(
        model=model,
        measured=np.where(used, measurements.displacement, 0.0),
        used=used,
        sigma=spread,
        sigma_known=bool(stated.any()),
        sharing=measurements.sharing,
        pose=measurements.pose,
        load=equal_rows(measurements.wrench),
        whitening=whitening(spread, used, measurements.sharing),
        source=source,
        notes=tuple(notes),
    )
    return problem if behind is None else _with_wind_up(problem, behind)


def _behind(
    robot: Robot, measurements: Measurements, model: PortModel, stated: bool
) -> tuple[WindUp | None, tuple[str, ...]]:
    """Return what encoders behind the gears say, None where that is nothing; and sentences about it."""
    if not stated:
        return None, ("the encoders behind the gears are not used: the noise of the tool is not stated",)
    moved = rigid_motion(robot, measurements)
    found = wind_up(robot, measurements, model, moved, between_loads, "differences within postures")
    return found if len(found.port) else None, found.notes


def _with_wind_up(problem: Problem, behind: WindUp) -> Problem:
    """Return the problem with contrasts of encoders behind the gears as further rows."""
    more = len(behind.port)
    measured, used, sigma = np.zeros((more, 6)), np.zeros((more, 6), dtype=np.bool_), np.ones((more, 6))
    measured[:, COMPONENT], used[:, COMPONENT], sigma[:, COMPONENT] = behind.value, True, behind.sigma
    sigma, used = np.concatenate([problem.sigma, sigma]), np.concatenate([problem.used, used])
    sharing = np.concatenate([problem.sharing, np.full(more, -1)])
    return replace(
        problem,
        model=behind.added(problem.model),
        measured=np.concatenate([problem.measured, measured]),
        used=used,
        sigma=sigma,
        sharing=sharing,
        pose=np.concatenate([problem.pose, problem.pose[behind.first]]),
        load=np.concatenate([problem.load, np.full(more, -1)]),
        whitening=whitening(sigma, used, sharing),
        behind=behind,
    )


def start_values(robot: Robot, problem: Problem, held: Collection[str] = ()) -> Array:
    """Return the stiffness values (m,) to start from: the robot's; for what it calls rigid or free, a guess.

    With the guess the spring alone, carrying all of the load, would move the measured points as far as they
    were seen to move: what is measured is at least as stiff.

    `held`: parameters that will stay at their start: those stay as good as rigid, or free.
    """
    model = problem.model
    result = model.start.copy()
    unit = np.trace(model.springs, axis1=1, axis2=2)
    for number, name in enumerate(model.parameters):
        in_robot = robot.parameter(name)
        if in_robot not in (RIGID, FREE):
            continue
        spring = model.springs[number]
        alone = np.einsum("npa,pq,nq->na", model.motion, np.linalg.pinv(spring), model.force)
        seen = np.where(problem.used, problem.measured / problem.sigma, 0.0)
        moved = np.where(problem.used, alone / problem.sigma, 0.0)
        size, far = float(np.linalg.norm(seen)), float(np.linalg.norm(moved))
        guess = far / size if far > 0 and size > 0 else 1.0 / unit[number]
        if name in held:
            guess = guess * AS_GOOD_AS if in_robot == RIGID else guess / AS_GOOD_AS
        result[number] = guess
    return result


def balanced_stiffness(model: PortModel) -> Array:
    """Return values (m,) with which no spring hides another: neither as good as rigid nor as good as free.

    A spring beside elastic parts gets the stiffness that these have at its port; one that carries all of the
    load gets a stiffness in proportion to what it would move the measured points by.
    """
    lever = model.lever
    both = np.outer(lever, lever)
    own = np.diagonal(model.springs, axis1=1, axis2=2) > 0  # (m, p)
    unit = np.trace(model.springs / both, axis1=1, axis2=2)
    beside = np.diagonal(model.port_stiffness / both, axis1=1, axis2=2).mean(axis=0)
    rest = (own @ beside) / unit
    carried = ((model.force / lever) ** 2) @ own.T  # (N, m)
    moved = ((model.motion[:, :, :3] / lever[:, None]) ** 2).sum(axis=2) @ own.T
    turned = (
        ((model.motion[:, :, 3:] / lever[:, None]) ** 2).sum(axis=2) @ own.T * lever.max(initial=1.0) ** 2
    )
    effect = np.sqrt((carried * (moved + turned)).mean(axis=0)) / unit
    held, acts = rest > 0, effect > 0
    if not acts.any():
        return np.asarray(np.where(held, rest, 1.0 / unit))
    ratio = float(np.median(rest[held & acts] / effect[held & acts])) if (held & acts).any() else 1.0
    effect = np.where(acts, effect, float(np.median(effect[acts] * unit[acts])) / unit)
    return np.asarray(np.where(held, rest, effect * ratio))
