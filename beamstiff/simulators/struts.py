"""Struts between bodies: springs of a length, whatever sets that length.

A strut whose length does not change with the posture is a tendon with a spring. One that a drive lengthens
lies in a closed loop of frames (a slider-crank, the leg of a hexapod): the chain of frames becomes bodies,
with the strut's spring behind the drive's slide, and its end meets the other body. Where no such chain is
described (a ball screw along a guide), two tendons are held equally long, from the same point to where the
machine would have the other end without compliance, and to where it has it but for three equal slides, the
springs of which only the one along the strut is loaded.
"""

import numpy as np

from beamstiff.robot.fields import FREE
from beamstiff.robot.parts import Strut
from beamstiff.se3 import Array, transform
from beamstiff.simulators.bodies import BodyJoint, Closure, Tendon, motion
from beamstiff.simulators.joints import Assembly, rank, twist
from beamstiff.simulators.paths import Move, constant, moves_between


def add_struts(made: Assembly) -> None:
    """Add the struts of a machine whose other elements are bodies already."""
    for strut in made.machine.robot.struts:
        if strut.stiffness == FREE:
            continue
        lengths = made.machine.distance(*strut.nodes)
        stiffness = _stiffness(made, strut, lengths)
        if constant(lengths):
            made.tendons.append(Tendon(strut.name, strut.nodes, stiffness, float(lengths[0])))
        elif not _in_a_loop(made, strut, stiffness):
            _beside_its_drive(made, strut, stiffness)


def _stiffness(made: Assembly, strut: Strut, lengths: Array) -> float:
    if strut.EA is None:
        return strut.stiffness
    if not constant(lengths):
        made.varies = True
        made.lost.append(f"strut {strut.name} has its compliance at {lengths[0]:.4g} m in every posture")
    return 1.0 / (1.0 / strut.stiffness + (float(lengths[0]) - strut.fixed_length) / strut.EA)


def _in_a_loop(made: Assembly, strut: Strut, stiffness: float) -> bool:
    """Add a strut as the chain of frames that leads to one end of a loop; return whether there is one."""
    machine = made.machine
    kinematics, where = machine.kinematics, machine.where
    names, index = kinematics.frame_names, kinematics.node_index
    for loop in kinematics.loops:
        for frame, at in ((loop.frame_b, loop.at_b), (loop.frame_a, loop.at_a)):
            end = where.transforms[:, frame, :3, :3] @ at + where.transforms[:, frame, :3, 3]
            for start, other in (strut.nodes, strut.nodes[::-1]):
                if np.abs(end - where.node_positions[:, index[other]]).max() > 1e-6:
                    continue
                along = end - where.node_positions[:, index[start]]
                local = np.einsum("sji,sj->si", where.transforms[:, frame, :3, :3], along)
                local /= np.linalg.norm(local, axis=1, keepdims=True)
                moves = moves_between(machine, made.nodes[start].frame, names[frame])
                if not constant(local) or any(move.variable in made.joint_names for move in moves):
                    continue
                body, placed = _pivot(made, strut, start, moves, along[0])
                body, placed, _ = made.move(body, placed, made.nodes[start].frame, names[frame], strut.name)
                point = placed[:3, :3] @ at + placed[:3, 3]
                if np.isfinite(stiffness):
                    body = made.body(strut.name, body, np.eye(4))
                    axis = placed[:3, :3] @ local[0]
                    made.join(body, BodyJoint(strut.name, "slide", point, axis, "spring", stiffness))
                site = made.site(f"{strut.name} end", body, transform(np.eye(3), point))
                made.closures.append(Closure(strut.name, "connect", site, other))
                return True
    return False


def _pivot(made: Assembly, strut: Strut, start: str, moves: list[Move], along: Array) -> tuple[int, Array]:
    """Give a strut's first end those turns across it that the variables of its chain of frames lack."""
    machine = made.machine
    pose = machine.where.transforms[0, machine.kinematics.frame_index[made.nodes[start].frame]]
    turned, end = pose[:3, :3], pose[:3, :3] @ np.array(made.nodes[start].at) + pose[:3, 3] + along
    across = np.eye(3) - np.outer(along, along) / (along @ along)
    swings: list[Array] = []
    for move in moves:
        pose = pose @ move.placed
        if move.variable:
            joint = made.moved_by(move)
            swings.append(across @ twist(joint, pose, end)[:3] * made.variables[move.variable].passive)
            pose = pose @ motion(joint, move.factor * machine.value(move.variable))
    body, placed = made.of_node[start]
    missing = []
    for letter, axis in zip("xyz", np.eye(3), strict=True):
        swing = np.cross(axis, along)
        if rank([*swings, swing]) > rank([*swings, np.zeros(3)]):
            swings.append(swing)
            at = made.point(start, placed)
            missing.append(
                BodyJoint(f"{strut.name}.r{letter}", "hinge", at, placed[:3, :3] @ turned.T @ axis, "spring")
            )
    if missing:
        body = made.body(f"{strut.name} pivot", body, np.eye(4))
        for joint in missing:
            made.join(body, joint)
    return body, placed


def _beside_its_drive(made: Assembly, strut: Strut, stiffness: float) -> None:
    """Add a strut between two bodies whose distance follows drives directly."""
    first, second = strut.nodes
    frames = made.nodes[first].frame, made.nodes[second].frame
    moved = {move.variable for move in moves_between(made.machine, *frames)} - {""}
    if passive := [name for name in moved if not made.variables[name].actuated]:
        made.lost.append(
            f"strut {strut.name} is not written: its length follows the passive {', '.join(sorted(passive))}"
        )
        return
    body, placed = made.of_node[first]
    body, placed, _ = made.move(body, placed, *frames, f"{strut.name} nominal")
    nominal = made.site(f"{strut.name} nominal", body, transform(np.eye(3), made.point(second, placed)))
    to, there = made.of_node[second]
    end = second
    if np.isfinite(stiffness):
        at = made.point(second, there)
        to = made.body(f"{strut.name} end", to, transform(np.eye(3), at))
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            made.join(
                to, BodyJoint(f"{strut.name}.{letter}", "slide", np.zeros(3), axis, "spring", stiffness)
            )
        end = made.site(f"{strut.name} end", to, np.eye(4))
    length = float(made.machine.distance(first, second)[0])
    made.tendons.append(Tendon(f"{strut.name} nominal", (first, nominal), 0.0, length))
    made.tendons.append(Tendon(strut.name, (first, end), stiffness, length, like=f"{strut.name} nominal"))
