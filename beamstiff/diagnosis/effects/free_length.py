"""Screws that are compliant by their free length: a form of `actuator-lever`.

A ball screw that a bearing holds at one end is a rod up to its nut: ``c(L) = c0 + (L - L0) / EA`` along it
(see `Strut`). A strut carries its own force, so that the lever by which it acts about an axis is in its
response already: ``c(L) / l^2`` about that axis. Its component is the prismatic variable that drives it.
"""

from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.effects.drive_stiffness import Following, scaled_torque
from beamstiff.diagnosis.effects.effect import Quantity, Shape
from beamstiff.diagnosis.effects.geometry_error import STEP
from beamstiff.diagnosis.effects.torque_laws import Axis, drive_compliance
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.model.ports import reduce_to_ports
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array

NAME = "free length"
LOOKED_AT = 5  # postures at which a strut is seen to follow one variable
ALONE = 1e-6  # change of a strut's length per change of a variable, below which it is rounding


@dataclass(frozen=True)
class Screw:
    """The struts that one prismatic variable drives.

    `grows`: change of their length per change of the variable, the same in all postures.
    `length`: m; their length, a mean.
    `compliance`: m/N; as the robot was given, a mean.
    """

    struts: tuple[str, ...]
    grows: float
    length: float
    compliance: float


def screws(baseline: Baseline) -> dict[str, Screw]:
    """Return the elastic struts whose length follows one prismatic variable, by that variable."""
    robot = baseline.nominal
    some = [one for one in robot.struts if FREE < one.stiffness < RIGID and one.EA is None]
    sliding = [at for at, one in enumerate(robot.actuated) if one.kind == "length"]
    if not some or not sliding:
        return {}
    kinematics = compile_kinematics(robot)
    ends = np.array([[kinematics.node_index[name] for name in one.nodes] for one in some])

    def lengths(q: Array) -> Array:
        at = posture(kinematics, q).node_positions
        return np.asarray(np.linalg.norm(at[:, ends[:, 1]] - at[:, ends[:, 0]], axis=-1))

    poses = np.unique(baseline.fit.rows.q, axis=0)
    poses = poses[np.linspace(0, len(poses) - 1, min(LOOKED_AT, len(poses))).astype(int)]
    steps = STEP * np.eye(poses.shape[1])
    slopes = np.stack([(lengths(poses + by) - lengths(poses - by)) / (2 * STEP) for by in steps])
    mean = lengths(poses).mean(axis=0)
    found: dict[str, Screw] = {}
    for at, strut in enumerate(some):
        follows = np.flatnonzero(np.abs(slopes[:, :, at]).max(axis=1) > ALONE)
        if len(follows) != 1 or follows[0] not in sliding:
            continue
        slope = slopes[follows[0], :, at]
        if np.ptp(slope) > ALONE:  # it slides aside too
            continue
        own = Screw((strut.name,), float(slope.mean()), float(mean[at]), 1.0 / strut.stiffness)
        name = robot.actuated[follows[0]].name
        before = found.get(name)
        if before is None or np.sign(before.grows) != np.sign(own.grows):
            found[name] = own
        else:
            found[name] = replace(before, struts=(*before.struts, strut.name))
    return found


def of_struts(baseline: Baseline, variable: str, screw: Screw) -> Shape:
    """Return the shape of screws that are struts."""
    rows = baseline.rows
    model = reduce_to_ports(baseline.robot, rows, screw.struts, gravity=baseline.absolute)
    by_compliance = model.derivatives(model.start, by="compliance")[1].sum(axis=-1)  # (N, 6), N
    longer = screw.grows * Following(baseline, variable).varying(lambda q: q)  # (N,), m
    size = screw.compliance / screw.length
    quantity = Quantity("length_compliance", "1/N", size, positive=True)
    return Shape(NAME, (by_compliance * longer[:, None])[..., None], (quantity,), prior_factor=3.0)


def of_slide(baseline: Baseline, axis: Axis) -> Shape:
    """Return the shape of the screw of a prismatic joint; which way it grows is not known."""
    variable = next(one for one in baseline.nominal.variables if one.name == axis.joint.variable)
    follow = Following(baseline, variable.name)
    low, high = variable.limits or (follow.fitted.min(), follow.fitted.max())
    size = drive_compliance(axis) / (float(high - low) or 1.0)
    column = scaled_torque(baseline, axis, follow.varying(lambda q: q)[:, None])
    return Shape(NAME, column, (Quantity("length_compliance", "1/N", size),), prior_factor=3.0)
