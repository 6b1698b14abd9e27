"""What a diagnosis changed in the geometry while it sought causes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.calibration.calibrate import calibrate
from beamstiff.calibration.corrected import nominal_value
from beamstiff.calibration.parameters import AXES, Parameter
from beamstiff.diagnosis.decomposition.causes import Decomposition
from beamstiff.diagnosis.decomposition.fit import SURELY, build_choice, fit_step
from beamstiff.diagnosis.decomposition.folds import folds_of
from beamstiff.diagnosis.decomposition.open_model import inverse_of, open_geometry
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.diagnosis.verify import verify
from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.registration import fit_rigid_motion
from beamstiff.measure.table import Measurements
from beamstiff.robot.coupling import frame_expressions
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture

# m that a length or an angle moves the points: beyond two standard deviations four public robots were off
# by at most 14 mm or mrad, 26 simulated ones by 2, a table read with another robot by 660. An angle counts
# by its lever, 1 m at most: a surgical wrist was 0.08 rad off its drawing, which moves its marker by 2 mm
UNLIKE = 0.05
OF_THE_ROBOT = {"target", "offset", "frame"}  # groups of parameters: beside the measuring frame and set-ups
SEED = 0  # of the folds
ALIKE = 0.2  # of how far reflectors moved, by which they moved otherwise: glued ones are off each by itself
UNSEEN = 1e-3  # of a realistic deviation (1 mm, 1 mrad): less is not told


@dataclass(frozen=True)
class Change:
    """By how much a zero, a frame or a reflector moved, and the standard deviation of that, SI."""

    parameter: Parameter
    by: float
    std: float


@dataclass(frozen=True)
class Recalibration:
    """The geometry beside the causes, against the one that the robot's file describes.

    `rigid`: m; RMS position gap of the geometry as described on rigid drives and links, as a controller
        computes; the measuring frame fitted alone. None where an instrument's set-ups are sought.
    `rigid_placed`: m; the same with the reflectors placed anew, as they are set up.
    `before`: m; `rigid` of the robot as described, which deforms.
    `placed`: m; the same with the reflectors placed anew: what is left is the geometry's.
    `after`: m; the same with geometry and drives fitted and no cause, on held-out postures.
    `stiff`: m; that with the drives as described; None where none are fitted.
    `changes`: encoders' zeros, frames and reflectors that moved; the largest first, by realistic deviations
        (1 mm, 1 mrad).
    `together`: reflectors of one link that moved alike, which their mounts hardly did: the link is off.
    """

    rigid: float | None
    rigid_placed: float | None
    before: float
    placed: float
    after: float
    stiff: float | None
    changes: tuple[Change, ...]
    together: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data: gaps in mm, changes in SI."""
        return {
            "rigid_mm": None if self.rigid is None else 1e3 * self.rigid,
            "rigid_reflectors_placed_mm": None if self.rigid_placed is None else 1e3 * self.rigid_placed,
            "before_mm": 1e3 * self.before,
            "reflectors_placed_mm": 1e3 * self.placed,
            "after_mm": 1e3 * self.after,
            "drives_as_described_mm": None if self.stiff is None else 1e3 * self.stiff,
            "changes": {
                one.parameter.name: {"change": one.by, "std": one.std, "unit": one.parameter.unit}
                for one in self.changes
            },
            "moved_together": list(self.together),
        }


def recalibration_of(found: Decomposition, robot: Robot) -> Recalibration | None:
    """Return what changed in the geometry of the `robot` that was found; None where it stays as described."""
    model = found.model
    if model.problem is None or not {item.group for item in model.problem.parameters} & OF_THE_ROBOT:
        return None
    before, changes, rigid = _described(found), tuple(_told(found, robot)), _rigid(found)
    return Recalibration(
        rigid=rigid,
        rigid_placed=None if rigid is None else min(_placed(found, rigid, rigid=True), rigid),
        before=before,
        placed=min(_placed(found, before), before),
        after=found.rms,
        stiff=_stiff(found) if model.present.size else None,
        changes=changes,
        together=_together(found, changes),
    )


def _together(found: Decomposition, changes: Sequence[Change]) -> tuple[str, ...]:
    """Return reflectors of one link that moved by the same vector, as its place differs from the file's."""
    rows, robot = found.model.baseline.rows, found.model.given
    placed = {one.parameter.name: one for one in changes if one.parameter.group == "target"}
    names = [
        name for name in np.unique(rows.point).tolist() if any(f"{name}.{axis}" in placed for axis in AXES)
    ]
    if len(names) < 2:
        return ()
    q = rows.q[[0, int(np.abs(rows.q - rows.q[0]).sum(axis=1).argmax())]]
    kinematics = compile_kinematics(robot)
    where = posture(kinematics, q)
    moved, std = [], []
    for name in names:
        own = [placed.get(f"{name}.{axis}") for axis in AXES]
        turned = pose_of(kinematics, where, name)[:, :3, :3]
        moved.append(turned @ [0.0 if one is None else one.by for one in own])
        std.append(max(0.0 if one is None else one.std for one in own))
    differ = max(float(np.linalg.norm(one - moved[0])) for one in moved)
    least = min(float(np.linalg.norm(one[0])) for one in moved)
    return tuple(names) if differ < ALIKE * least and least > SURELY * max(std) else ()


def unlike(found: Decomposition) -> str:
    """Return, in words, that the readings hardly are of the robot that is described; mostly empty."""
    problem = found.model.problem
    if problem is None:
        return ""
    columns = problem.geometry.jacobian(problem.split(problem.expected)[0])[1][:, :3]
    levers = np.minimum(np.sqrt((columns**2).sum(axis=1).mean(axis=0)), 1.0)
    lever = dict(zip((item.name for item in problem.geometry.parameters), levers.tolist(), strict=True))
    far = [
        f"{one.parameter.name} by {1e3 * one.by:.3g} m{one.parameter.unit}"
        for one in _told(found, found.model.baseline.nominal)
        if one.parameter.group == "frame" and lever[one.parameter.name] * (abs(one.by) - 2 * one.std) > UNLIKE
    ]
    if not far:
        return ""
    return (
        f"the calibration moved {listed(far, 3)}: no machine is built so far from its drawing. Is the robot "
        "file that of the table, and each joint column that of its joint? Nothing else here holds before that"
    )


def _told(found: Decomposition, robot: Robot) -> list[Change]:
    """Return what changed in the geometry of the `robot` that was found, the largest first."""
    problem, std = found.model.problem, _std(found)
    assert problem is not None
    moved = _changes(found.model.given, robot, problem.parameters)
    changes = [Change(item, by, std.get(item.name, 0.0)) for item, by in moved]
    return sorted(changes, key=lambda one: -abs(one.by) / one.parameter.size)


def _rigid(found: Decomposition) -> float | None:
    """Return the gap of the geometry as described, nothing deformed, laid over the readings, m."""
    model, rows = found.model, found.model.baseline.rows
    assert model.problem is not None
    if rows.targets or rows.camera:
        return None
    return gap_of_rigid(model.given, rows, model.problem.geometry.stations > 1)


def gap_of_rigid(robot: Robot, rows: Measurements, stations: bool = False) -> float:
    """Return the gap of a robot's geometry, nothing deformed, laid over absolute readings (N rows), m.

    `stations`: the readings of each table by themselves.
    """
    whole = rows.measured_mask[:, :3].all(axis=1)
    places, _ = nominal_pose(robot, rows)
    frame = rows.run if stations else np.zeros(len(rows))
    squares = 0.0
    for own in (whole & (frame == one) for one in np.unique(frame[whole])):
        squares += float((fit_rigid_motion(places[own], rows.position[own]).residuals ** 2).sum())
    return float(np.sqrt(squares / whole.sum()))


def _described(found: Decomposition) -> float:
    """Return the gap of the robot as described, the measuring frame or an instrument's set-ups fitted, m."""
    rows = found.model.baseline.rows
    if not (rows.targets or rows.camera):
        return verify(found.model.given, rows, refit_frame=True).after
    return _fitted(found, _groups(found, "base")) or found.rms


def _placed(found: Decomposition, before: float, rigid: bool = False) -> float:
    """Return the gap with the reflectors placed anew, m; `before` where an instrument knows their places.

    `rigid`: where nothing deforms.
    """
    rows, groups = found.model.baseline.rows, _groups(found, "base", "target")
    if rows.targets or rows.camera or not groups:
        return before
    return _fitted(found, groups, rigid) or before


def _groups(found: Decomposition, *wanted: str) -> list[str]:
    """Return which of these groups of parameters are open, in this order."""
    assert found.model.problem is not None
    there = {item.group for item in found.model.problem.parameters}
    return [group for group in wanted if group in there]


def _fitted(found: Decomposition, groups: list[str], rigid: bool = False) -> float | None:
    """Return the gap of the robot as described with these groups of parameters fitted, m.

    `rigid`: where nothing deforms, as there is no load.
    """
    bare, rows = found.model.given.model_copy(update={"identify": ()}), found.model.baseline.rows
    if rigid:
        bare = bare.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
        rows = replace(rows, wrench=np.zeros_like(rows.wrench))
    return calibrate(bare, rows, groups, folds=0).after.position_rms


def _stiff(found: Decomposition) -> float | None:
    """Return the gap on held-out postures with the geometry fitted about the drives as described, m."""
    model, problem = found.model, found.model.problem
    assert problem is not None
    bare = model.given.model_copy(update={"identify": ()})
    several = problem.geometry.stations > 1
    try:
        opened = open_geometry(bare, model.baseline.rows, parameters=model.parameters, stations=several)
    except BeamstiffError:  # on these drives the machine may buckle
        return None
    choice = build_choice(opened, ())
    folds = folds_of(opened, choice, SEED)
    return float(np.sqrt(folds.squared_errors(fit_step(choice, ())).sum() / folds.rows))


def _std(found: Decomposition) -> dict[str, float]:
    """Return the standard deviation of the parameters that the rows determine beside the causes, SI."""
    names, columns = found.model.told_apart
    forms = [form.columns for cause in found.every for form in cause.forms]
    inverse = inverse_of(np.concatenate([columns, *forms], axis=1))
    std = max(found.scatter, 1.0) * np.linalg.norm(inverse, axis=1)
    return dict(zip(names, std.tolist(), strict=False))  # behind them those of the causes


def _changes(
    given: Robot, found: Robot, parameters: tuple[Parameter, ...]
) -> Iterator[tuple[Parameter, float]]:
    for item in parameters:
        if item.group == "offset":
            by = _zero(found, item.name) - _zero(given, item.name)
        elif item.group == "frame" or (item.group == "target" and not item.name.startswith("target.")):
            by = nominal_value(found, item) - nominal_value(given, item)
        else:  # the measuring frame and the target's turn are no part of the robot; drives are told elsewhere
            continue
        if abs(by) > UNSEEN * item.size:
            yield item, by


def _zero(robot: Robot, name: str) -> float:
    """Return by how much a joint's zero is off in the first frame that the joint moves alone, SI."""
    for of_frame in frame_expressions(robot).values():
        for expression in of_frame.values():
            if set(expression.coefficients) == {name}:
                return float(expression.constant / expression.coefficients[name])
    return 0.0
