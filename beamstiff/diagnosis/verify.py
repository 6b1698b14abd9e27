"""A robot with its effects on fresh rows: the gap without them and with them, promised against true."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.diagnosis.absorbed import calibrated_without
from beamstiff.diagnosis.effects.approach_direction import without_unknown
from beamstiff.diagnosis.inference.library import REVERSED
from beamstiff.diagnosis.residual.baseline import deviation, nominal_pose, predict
from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.outlier_gap import far_rows
from beamstiff.measure.registration import RigidMotion, check_spread, fit_rigid_motion
from beamstiff.measure.rows import row_digests
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array, skew, vector_from_rotation
from beamstiff.shown import Shown

MODEL = "model:"  # before its kind, among the causes
FRAME = 6  # parameters of a measuring frame
MOST = 0.75  # share of the gap's square that a rigid motion closes where the measuring frame is another one,
# or that other places of the points close where these are not where the robot file says


@dataclass(frozen=True, repr=False)
class Verification(Shown):
    """Position errors of a robot on rows, RMS of the norm, m.

    Attributes
    ----------
    before, after : float, m
        Without the robot's model and effects, calibrated without them, and with them.
    noise : float, m
        What the stated noise alone makes; 0 where none is stated.
    promised : float or None
        Share of the gap that the effects closed on held-out postures when they were found, at most 1: the sum
        of `closes` in the robot file, of which noise makes a little more than all.
    true : float
        Share of the explainable gap that they close here, at most 1; negative where they make it worse.
    rows : int
    causes : tuple of (str, float, float)
        Effect and component (first the model, ``model:grid``), the error with all up to this one, m, and the
        share that it closes.
    notes : tuple of str
        What in the robot and the rows is hardly meant.
    other_frame : float or None, m
        What would be left were the measuring frame fitted, where that closes most of the gap: the readings
        hardly are in the robot's base frame.
    absolute : bool
        Whether the rows are absolute positions.
    fitted : int
        How many of the rows the robot file was fitted to: of these `true` tells nothing.
    nominal : float or None, m
        The error of the robot before it was calibrated, where it was given.
    base : tuple of float (6,), m and rad, or None
        Position and rotation vector of the robot's base in the measuring frame, where that was fitted.
    unexplained : str
        What the error looks like that the robot's fit left, where its file says so.
    moved_points : tuple of (str, tuple of float (3,)), m
        Measured points that hardly sit where the robot file says: placed anew they close most of the error.
        And by how much each is off, along the axes of its frame.
    placed : float or None, m
        What is left with these points placed anew.
    """

    before: float
    after: float
    noise: float
    promised: float | None
    true: float
    rows: int
    causes: tuple[tuple[str, float, float], ...]
    notes: tuple[str, ...] = ()
    other_frame: float | None = None
    absolute: bool = False
    fitted: int = 0
    nominal: float | None = None
    base: tuple[float, ...] | None = None
    unexplained: str = ""
    moved_points: tuple[tuple[str, tuple[float, float, float]], ...] = ()
    placed: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data, lengths in mm."""
        return {
            "nominal_mm": None if self.nominal is None else 1e3 * self.nominal,
            "before_mm": 1e3 * self.before,
            "after_mm": 1e3 * self.after,
            "noise_mm": 1e3 * self.noise,
            "promised": self.promised,
            "true": None if self.other_frame is not None else self.true,  # of another frame it says nothing
            "rows": self.rows,
            "base_in_measuring_frame": None if self.base is None else list(self.base),
            "fitted_rows": self.fitted,
            "other_frame_mm": None if self.other_frame is None else 1e3 * self.other_frame,
            "moved_points_mm": {name: [1e3 * by for by in moved] for name, moved in self.moved_points},
            "points_placed_mm": None if self.placed is None else 1e3 * self.placed,
            "causes": [
                {"cause": name, "rms_after_mm": 1e3 * after, "closes": closes}
                for name, after, closes in self.causes
            ],
            "notes": list(self.notes),
        }


def verify(robot: Robot, measurements: Measurements, *, refit_frame: bool = False) -> Verification:
    """Verify a robot and its effects on rows that were not fitted.

    `measurements`: displacements or absolute positions, in the robot's base frame. With approach-direction
        rows before a joint moved do not count: from which side it came is unknown.
    `refit_frame`: lay the predicted positions over the measured ones as a rigid body first, with and without
        effects: the measuring frame is not the base frame. Changes nothing of displacements.
    Raises BeamstiffError when no position is measured, or the rows cannot be predicted.

    >>> from beamstiff.measure.table import make_measurements
    >>> from beamstiff.robot.reader import load_robot
    >>> robot, wrench = load_robot("cantilever"), [[0.0, 0.0, -100.0, 0.0, 0.0, 0.0]]
    >>> seen = {"tcp": robot.tcp, "wrench": wrench, "displacement": np.zeros((1, 6))}
    >>> found = verify(robot, make_measurements([], np.zeros((1, 0)), **seen))
    >>> found.before == found.after > 0.0, found.promised
    (True, None)
    """
    used = measurements.measured_mask[:, :3]
    absolute = measurements.kind == "absolute"
    short = {one.component for one in robot.effects if one.effect == REVERSED}
    notes: tuple[str, ...] = ()
    if absolute and short:
        read, unknown = without_unknown(measurements, short)
        lost = np.flatnonzero(unknown & used.any(axis=1))
        if lost.size and used[~unknown].any():
            places = listed([measurements.place(row) for row in lost.tolist()], 6)
            notes = (f"left out: {places}: the rows do not say from which side the joints came",)
            measurements, used = read, used & ~unknown[:, None]
    if not used.any():
        raise BeamstiffError(f"{measurements.source}: no row has a measured position (dx dy dz or x y z)")
    refit_frame = refit_frame and absolute  # a difference of two readings has no origin
    keys = [f"{effect.effect}:{effect.component or 'null'}" for effect in robot.effects]
    causes = list(dict.fromkeys(keys))
    stages = [robot.model_copy(update={"effects": ()})]
    for key in causes:  # all shapes of a cause at once: only their sum is meant
        own = [effect for effect, of in zip(robot.effects, keys, strict=True) if of == key]
        stages.append(robot.model_copy(update={"effects": (*stages[-1].effects, *own)}))
    if robot.model is not None:
        causes.insert(0, f"{MODEL}{robot.model.kind}")
        stages.insert(0, stages[0].model_copy(update={"model": None}))
    ahead = [[one.absorbed for one in robot.effects if one not in stage.effects] for stage in stages]
    calibrated = [calibrated_without(*one, measurements) for one in zip(stages, ahead, strict=True)]
    gaps = [_errors(stage, rows, refit_frame) for stage, rows in calibrated]
    errors, base = [_rms(gap, used) for gap, _ in gaps], gaps[-1][1]
    sigma = np.nan_to_num(measurements.sigma[:, :3])
    noise = float(np.sqrt((sigma[used] ** 2).sum() / used.any(axis=1).sum()))
    explainable = errors[0] ** 2 - noise**2

    def share(before: float, after: float) -> float:
        return float((before**2 - after**2) / explainable) if explainable > 0 else 0.0

    other_frame = None
    if absolute and not refit_frame and errors[-1] > noise:
        other_frame = _in_another_frame(robot, measurements, errors[-1])
    placed, moved_points = None, tuple[tuple[str, tuple[float, float, float]], ...]()
    mounted = absolute and not (measurements.targets or measurements.camera)
    if mounted and other_frame is None and errors[-1] > noise:
        placed, moved_points = _placed_anew(robot, measurements, *gaps[-1])
    if other_frame is None and not moved_points:
        notes += tuple(far_rows(measurements, gaps[-1][0], sigma, used))
    stated = [effect.closes for effect in robot.effects if effect.closes is not None]
    return Verification(
        before=errors[0],
        after=errors[-1],
        noise=noise,
        promised=min(float(sum(stated)), 1.0) if stated else None,
        true=min(share(errors[0], errors[-1]), 1.0),
        rows=int(used.any(axis=1).sum()),
        causes=tuple(
            (key, after, share(before, after))
            for key, before, after in zip(causes, errors[:-1], errors[1:], strict=True)
        ),
        other_frame=other_frame,
        absolute=absolute,
        notes=notes,
        base=None
        if base is None
        else (*base.translation.tolist(), *vector_from_rotation(base.rotation).tolist()),
        unexplained=robot.unexplained,
        moved_points=moved_points,
        placed=placed,
        fitted=int((used.any(axis=1) & np.isin(row_digests(measurements), robot.fitted_rows.split())).sum()),
    )


def _in_another_frame(robot: Robot, rows: Measurements, after: float) -> float | None:
    """Return what a fitted frame would leave of `after` where it closes most of it, m; else None."""
    used = rows.measured_mask[:, :3]
    whole = rows.position[used.all(axis=1)]
    try:
        check_spread(whole, rows.source)
    except BeamstiffError:
        return None
    left = _rms(_errors(robot, rows, refit=True)[0], used)
    free = int(used.sum()) - FRAME  # values of which six are taken up by any frame
    return left if free > 0 and left**2 * used.sum() / free < (1.0 - MOST) * after**2 else None


def _placed_anew(
    robot: Robot, rows: Measurements, gap: Array, motion: RigidMotion | None
) -> tuple[float | None, tuple[tuple[str, tuple[float, float, float]], ...]]:
    """Return what places of the points that fit these rows leave of a gap (N, 3), and by how much they move.

    Where that closes most of it; else None, and none. `motion`: of a measuring frame that was fitted, and is
    fitted anew.
    """
    names, used = np.unique(rows.point).tolist(), rows.measured_mask[:, :3] & ~np.isnan(gap)
    columns = [nominal_pose(robot, rows, name)[1] * (rows.point == name)[:, None, None] for name in names]
    if motion is not None:
        shift = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
        turn = -skew(np.nan_to_num(rows.position - gap))
        columns = [*(motion.rotation @ one for one in columns), shift, turn]
    matrix, right = np.concatenate(columns, axis=2)[used], gap[used]
    free = len(right) - matrix.shape[1]
    if free <= 0:
        return None, ()
    moved, *_ = np.linalg.lstsq(matrix, right, rcond=None)
    left2, before2 = float(np.square(right - matrix @ moved).sum()), float(right @ right)
    if left2 * len(right) / free >= (1.0 - MOST) * before2:
        return None, ()
    by = moved.reshape(-1, 3).tolist()
    placed = float(np.sqrt(left2 / used.any(axis=1).sum()))
    return placed, tuple((name, (x, y, z)) for name, (x, y, z) in zip(names, by, strict=False))


def _errors(robot: Robot, rows: Measurements, refit: bool) -> tuple[Array, RigidMotion | None]:
    """Return measured less predicted positions (N, 3), m; NaN where not measured.

    And where the robot's base stands in the measuring frame, if that is to be fitted.
    """
    bare = robot.model_copy(update={"effects": (), "model": None})
    shift = predict(robot, rows)
    gap = (deviation(bare, rows) - shift)[:, :3]
    if not refit:
        return gap, None
    measured = rows.position
    known = ~np.isnan(gap).any(axis=1)
    predicted = measured - gap
    if not known.all():  # an axis that was read turns with one that was not
        predicted[~known] = (nominal_pose(bare, rows)[0] + shift[:, :3])[~known]
    motion = fit_rigid_motion(predicted[known], measured[known])
    return measured - (predicted @ motion.rotation.T + motion.translation), motion


def _rms(error: Array, used: NDArray[np.bool_]) -> float:
    return float(np.sqrt((error[used] ** 2).sum() / used.any(axis=1).sum()))
