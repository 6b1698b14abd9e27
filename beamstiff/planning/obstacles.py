"""Which postures keep clear of boxes: parts of the machine are lines between the nodes that they join."""

import numpy as np

from beamstiff.planning.poses import Mask
from beamstiff.robot.graph import structure_graph
from beamstiff.robot.kinematics import Kinematics
from beamstiff.se3 import Array


def clear(kinematics: Kinematics, positions: Array) -> Mask:
    """Return the postures (P,) in which no moving part runs through an obstacle of the robot.

    `positions`: (P, n, 3), m, of the nodes. By the slabs of a box: a line is inside between the last side
    that it enters and the first that it leaves (Kay and Kajiya 1986).
    """
    robot, fixed = kinematics.robot, set(kinematics.robot.fixed)
    result = np.ones(len(positions), dtype=np.bool_)
    if not robot.obstacles:
        return result
    parts = [ends for ends in structure_graph(robot).edges() if not fixed.issuperset(ends)]
    if not parts:
        return result
    start, end = (
        positions[:, [kinematics.node_index[one] for one in ends]] for ends in zip(*parts, strict=True)
    )
    for box in robot.obstacles:
        # along a side: inf, or NaN on it, which is outside
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = [(np.array(side) - start) / (end - start) for side in (box.low, box.high)]
        enters, leaves = np.minimum(*sides).max(axis=2), np.maximum(*sides).min(axis=2)
        result &= ~np.any(np.maximum(enters, 0.0) < np.minimum(leaves, 1.0), axis=1)
    return result
