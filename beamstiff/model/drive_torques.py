"""Torques, of slides forces, that drives hold against weights and loads: ``tau = -J^T w``, virtual work."""

from dataclasses import dataclass

import numpy as np

from beamstiff.fem.loads import gravity_wrenches
from beamstiff.fem.placed_structure import place
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import pose_of, posture, twist_jacobian
from beamstiff.se3 import Array


@dataclass(frozen=True)
class Weight:
    """What hangs on the nodes of a frame; N rows, A actuated variables.

    `torque`: (N, A) array, N m or N; what holds the weight that the robot states there.
    `unit`: (N, A, 4) array, N m/kg and N m/(kg m); what holds 1 kg more at the frame's first node, and 1 kg m
        away from it along each axis of the frame.
    """

    frame: str
    torque: Array
    unit: Array


def drive_torques(robot: Robot, rows: Measurements) -> tuple[list[Weight], Array]:
    """Return what the drives hold of the weights, frame by frame, and of the loads, (N, A), N m or N.

    Of rigid parts where the actuated variables are read; springs that act beside the drives do not count.
    """
    structure = compile_structure(robot)
    kinematics = structure.kinematics
    poses, number = np.unique(rows.q, axis=0, return_inverse=True)
    where, pose = posture(kinematics, poses), number.reshape(-1)
    weight = gravity_wrenches(structure, place(structure, where))
    gravity = np.array(robot.gravity)
    found: dict[str, Weight] = {}
    loads = np.zeros(rows.q.shape)
    for at, node in enumerate(robot.nodes):
        jacobian = twist_jacobian(kinematics, where, node.name)
        torque = -np.einsum("pia,pi->pa", jacobian, weight[:, at])[pose]
        if node.frame in found:
            torque = torque + found[node.frame].torque
            unit = found[node.frame].unit
        else:
            axes = pose_of(kinematics, where, node.name)[:, :3, :3].swapaxes(1, 2)
            turns = -np.einsum("pia,pei->pae", jacobian[:, 3:], np.cross(axes, gravity))
            unit = np.concatenate([-np.einsum("pia,i->pa", jacobian[:, :3], gravity)[..., None], turns], -1)
            unit = unit[pose]
        found[node.frame] = Weight(node.frame, torque, unit)
        loaded = rows.load_point == node.name
        loads[loaded] = -np.einsum("nia,ni->na", jacobian[pose[loaded]], rows.wrench[loaded])
    return list(found.values()), loads
