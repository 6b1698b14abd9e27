"""The deflection of every row of a table in MuJoCo: a second opinion on a robot's model."""

from typing import Any

import numpy as np

from beamstiff.measure.rows import history_order
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.mjcf_writer import write_mjcf
from beamstiff.simulators.statics import MujocoModel

JOINT_PARTS = ("pos", "axis", "stiffness", "damping", "armature", "qpos_spring")
BODY_PARTS = ("pos", "quat", "mass", "inertia", "ipos", "iquat")


def mujoco_deflection(
    robot: Robot, rows: Measurements, *, anew: bool = True
) -> tuple[Array, tuple[str, ...]]:
    """Return displacements (N, 6), loaded minus unloaded, in MuJoCo's equilibria; and what the model lacks.

    Drives are held exactly, gravity acts. A robot that is not the same in every posture (beams whose length
    follows a slide) is written `anew` for each, or once in its reference posture.
    """
    kinematics = compile_kinematics(robot)
    values = close_loops(kinematics, rows.q).values
    names, tree = [variable.name for variable in robot.actuated], assemble(robot)
    model = MujocoModel(write_mjcf(tree))
    result, at_pose = np.zeros((len(rows), 6)), None
    for row in history_order(rows).tolist():
        if rows.pose[row] != at_pose:
            at_pose, q = rows.pose[row], rows.q[row]
            if tree.varies and anew:
                model = MujocoModel(write_mjcf(assemble(robot, q)))
            held = dict(zip(names, q.tolist(), strict=True))
            start = model.at(dict(zip(kinematics.coupling.names, values[row].tolist(), strict=True)))
            unloaded = now = model.equilibrium(held, np.zeros(6), robot.tcp, start, friction=False)
        point, load_point = str(rows.point[row]), str(rows.load_point[row])
        now = model.equilibrium(held, rows.wrench[row], load_point, now)
        (before, turned), (after, turned_on) = (model.site_pose(point, qpos) for qpos in (unloaded, now))
        result[row] = [*(after - before), *vector_from_rotation(turned_on @ turned.T)]
    return result, tree.lost


def follow_posture(model: Any, robot: Robot, q: Array) -> None:
    """Give a MuJoCo model of a robot the springs and masses of a posture, where beams follow slides.

    `model`: of `robot_to_mjcf`, with whatever was added to it; `mujoco.mj_setConst` has to follow.
    `q`: (A,) array, rad or m; actuated variables.

    >>> from beamstiff import load_robot
    >>> gantry = load_robot("gantry")
    >>> model = MujocoModel(write_mjcf(assemble(gantry))).model
    >>> follow_posture(model, gantry, np.array([1.0, 0.3, 0.5]))  # the ram sticks out by 0.5 m, not 0.7 m
    >>> float(model.joint("ram.axial").stiffness[0] * 0.5 / (210e9 * (0.28**2 - 0.23**2)))
    1.0
    """
    now = MujocoModel(write_mjcf(assemble(robot, q))).model
    for count, kind, parts in ((now.njnt, "joint", JOINT_PARTS), (now.nbody, "body", BODY_PARTS)):
        for at in range(count):
            ours = getattr(now, kind)(at)
            theirs = getattr(model, kind)(ours.name)
            for part in parts:
                getattr(theirs, part)[:] = getattr(ours, part)
