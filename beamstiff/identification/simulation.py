"""What the machine does at the loads and joint values that were there, where the table holds those read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from beamstiff.identification.input_errors import InputErrors, rigid_motion
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.model.ports import PortModel, reduce_to_ports
from beamstiff.robot.description import Robot

AT_ONCE = 2500  # rows that are condensed together


def as_they_were(
    robot: Robot,
    rows: Measurements,
    errors: InputErrors,
    parameters: tuple[str, ...],
    count: int,
    random: np.random.Generator,
) -> Iterator[PortModel]:
    """Yield the model of the rows at loads and joint values drawn around those in the table, several times.

    `rows`: N rows; those of a pose share the error of the joint values. `parameters`: the open stiffness
    values. `count`: how many times.
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
        model = reduce_to_ports(robot, shifted, parameters, gravity=False)
        if hold.any():
            let_go = hold * random.standard_normal((len(every), hold.size))
            moved = np.einsum("nij,nj->ni", np.tile(motion, (times, 1, 1)), let_go)
            model = replace(model, clamped=model.clamped + moved)
        for at in range(times):
            yield model.rows(np.arange(at * n, (at + 1) * n))
