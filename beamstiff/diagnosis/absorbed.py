"""What a calibration puts into its parameters where effects are left out.

The robot that a diagnosis writes has the geometry and stiffness that were fitted beside its effects; by
itself, without them, it is no model that anybody would use. What effects close is a share of what that robot
leaves which is calibrated without them. It differs by what calibration absorbs of each: ``T^+ A theta``, T
the tangent of the open parameters, ``A theta`` what the effect moves.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from beamstiff.calibration.corrected import corrected
from beamstiff.calibration.parameters import AXES, TURNS
from beamstiff.diagnosis.decomposition.open_model import inverse_of
from beamstiff.diagnosis.residual.baseline import KNOWN_FACTOR, nominal_pose
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array, rotation_from_vector

DIGITS = 4  # of a change, which is itself known to some per cent


def absorbed_by(
    names: Sequence[str], tangent: Array, moved: Array, compliances: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Return the changes of parameters that fit what an effect moves, by name, SI.

    `names`: of geometry, base frame and stiffness; of the latter the compliance is meant. `tangent` (n, t),
    `moved` (n,): in units of the noise. `compliances` with the effect, by name: no calibration makes them
    negative, and where one comes to 0 the others change by what fits best then.
    """
    changes = inverse_of(tangent) @ moved
    present = np.array([(compliances or {}).get(name, np.inf) for name in names])
    if (changes < -present).any():
        size = np.linalg.norm(tangent, axis=0)
        size = np.where(size > 0.0, size, 1.0)  # what the readings do not see stays as it is
        left, right = np.linalg.qr(tangent / size)
        changes = lsq_linear(right, left.T @ moved, (-present * size, np.inf), method="bvls").x / size
    return _rounded(dict(zip(names, changes.tolist(), strict=True)))


def difference(without: Mapping[str, float], beside: Mapping[str, float]) -> dict[str, float]:
    """Return by how much the parameters of two calibrations differ, by name."""
    return _rounded({name: by - beside[name] for name, by in without.items()})


def _rounded(changes: Mapping[str, float]) -> dict[str, float]:
    return {name: float(f"{by:.{DIGITS}g}") for name, by in changes.items() if by != 0.0}


def total(changes: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Return the sum of changes of parameters, by name."""
    result: dict[str, float] = {}
    for one in changes:
        for name, by in one.items():
            result[name] = result.get(name, 0.0) + by
    return result


def calibrated_without(
    robot: Robot, absorbed: Iterable[Mapping[str, float]], rows: Measurements
) -> tuple[Robot, Measurements]:
    """Return a robot with what a calibration without some effects would find, and rows in its frame.

    `absorbed`: of each effect, as `absorbed_by`.

    >>> from beamstiff.measure.table import make_measurements
    >>> from beamstiff.robot.reader import load_robot
    >>> robot = load_robot("kr240-2")
    >>> change = 1e-3 / robot.parameter("J2.torsional")
    >>> names = [one.name for one in robot.actuated]
    >>> rows = make_measurements(names, np.zeros((1, 6)), tcp=robot.tcp, position=np.zeros((1, 3)))
    >>> other, _ = calibrated_without(robot, [{"J2.torsional": change}], rows)
    >>> round(other.parameter("J2.torsional") / robot.parameter("J2.torsional"), 6)
    0.999001
    """
    changes = total(absorbed)
    if not changes:
        return robot, rows
    stiffness = {
        name: 1.0 / max(1.0 / value + changes[name], 1.0 / (KNOWN_FACTOR * value))
        for name, value in stiffness_parameters(robot).items()
        if name in changes and value < np.inf
    }
    robot = corrected(robot.with_parameters(stiffness), changes, rows.q[:1])
    if rows.kind != "absolute":
        return robot, rows
    shift, turn = (np.array([changes.get(f"base.{axis}", 0.0) for axis in some]) for some in (AXES, TURNS))
    read = ~np.isnan(rows.position)
    whole = rows.position
    if not read.all():  # an axis that was read turns with one that was not
        whole = np.where(read, whole, nominal_pose(robot, rows)[0])
    turned = (whole - shift) @ rotation_from_vector(turn)
    return robot, replace(rows, position=np.where(read, turned, np.nan))
