"""MJCF to a robot, by MuJoCo's own parser (optional extra `mujoco`).

Every body is a link, every joint a joint of the link tree; sites are links that are fixed. A joint with a
stiffness is a spring in series: along or about its own axis, and of the joint before it where that has the
same axis. What a robot has no words for is listed.
"""

import os
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.files import read_text
from beamstiff.robot.description import Robot
from beamstiff.robot.link_tree import (
    ALONG,
    WEIGHTLESS,
    Kind,
    LinkTree,
    Mimic,
    TreeJoint,
    TreeLink,
    robot_data,
    robot_of,
    springs_joined,
)
from beamstiff.se3 import Array, rotation_from_vector, transform
from beamstiff.simulators.bodies import free_name
from beamstiff.simulators.mjcf_writer import TCP
from beamstiff.simulators.statics import engine


@dataclass(frozen=True)
class ReadModel:
    """A robot that an MJCF file describes, and what of the file it does not hold."""

    robot: Robot
    lost: tuple[str, ...]


def read_mjcf(path: str | os.PathLike[str], *, tcp: str | None = None) -> ReadModel:
    """Return the robot of an MJCF file; `tcp` is the site or body at the TCP, by default the only end."""
    mujoco, file = engine(), Path(path)
    read_text(file)  # a file that is not there is told as everywhere
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise BeamstiffError(f"{file}: MuJoCo refuses it: {' '.join(str(error).split())}") from None
    return robot_of_model(mujoco, model, str(file), tcp)


def robot_of_model(mujoco: Any, model: Any, source: str, tcp: str | None) -> ReadModel:
    """Return the robot of a compiled model."""
    lost: list[str] = []
    links, joints = [TreeLink(_name(model.body(0), "world"))], list[TreeJoint]()
    names = {links[0].name}
    origin: dict[int, tuple[str, Array]] = {0: (links[0].name, np.eye(4))}  # link, and the body's frame in it
    mimics = _followers(mujoco, model)
    for number in range(1, model.nbody):
        body = model.body(number)
        parent, frame = origin[int(model.body_parentid[number])]
        frame = frame @ _pose(mujoco, body.pos, body.quat)
        for joint in (model.joint(at) for at in range(body.jntadr[0], body.jntadr[0] + body.jntnum[0])):
            one = _joint(joint, parent, frame, mimics)
            if one is None:
                lost.append(f"the free or ball joint of body {body.name!r}: it stands fixed here")
                continue
            parent, frame = free_name(one.child, names), transform(np.eye(3), -np.array(joint.pos))
            links.append(TreeLink(parent))
            joints.append(replace(one, child=parent))
        own = free_name(body.name or f"body {number}", names)
        joints.append(TreeJoint(f"{own} in {parent}", parent, own, "fixed", frame))
        mass = float(body.mass[0])
        x, y, z = body.ipos.tolist()
        links.append(TreeLink(own, mass, (x, y, z)))
        origin[number] = own, np.eye(4)
    for at in range(model.nsite):
        site = model.site(at)
        link, frame = origin[int(model.site_bodyid[at])]
        own = free_name(site.name or f"site {at}", names)
        links.append(TreeLink(own))
        joints.append(
            TreeJoint(f"{own} site", link, own, "fixed", frame @ _pose(mujoco, site.pos, site.quat))
        )
    lost += _lost(mujoco, model)
    tree = springs_joined(LinkTree(_model_name(model, source), tuple(links), tuple(joints), source))
    data = robot_data(tree, tcp or _end(mujoco, model, tree))

    def fail(message: str) -> Any:
        raise BeamstiffError(f"{source}: {message}")

    robot = robot_of(fail, data | {"gravity": model.opt.gravity.tolist()})
    return ReadModel(robot, tuple(lost))


def _model_name(model: Any, source: str) -> str:
    name = bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
    return name or Path(source).stem


def _name(item: Any, otherwise: str) -> str:
    return str(item.name) or otherwise


def _pose(mujoco: Any, position: Array, quaternion: Array) -> Array:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return transform(rotation.reshape(3, 3), np.array(position))


KINDS: dict[int, Kind] = {2: "prismatic", 3: "revolute"}


def _joint(joint: Any, parent: str, frame: Array, mimics: dict[str, Mimic]) -> TreeJoint | None:
    """Return a joint at its anchor; its zero is the file's posture less `ref`."""
    if (number := int(joint.type[0])) not in KINDS:
        return None
    kind = KINDS[number]
    name, axis = joint.name or f"joint_{joint.id}", np.array(joint.axis)
    at, start = transform(np.eye(3), np.array(joint.pos)), float(joint.qpos0[0])
    placed = frame @ at
    if start:  # the pose in the file is that at `ref`
        turned = kind == "revolute"
        back = rotation_from_vector(-start * axis) if turned else np.eye(3)
        placed = placed @ transform(back, np.zeros(3) if turned else -start * axis)
    stiffness = float(joint.stiffness[0])
    limits = tuple(joint.range.tolist()) if joint.limited[0] else None
    along = {ALONG[kind]: stiffness} if stiffness > 0.0 and limits is None else {}
    return TreeJoint(
        name=name,
        parent=parent,
        child=f"{name} link",
        kind="fixed" if stiffness > 0.0 else kind,
        placed=placed,
        axis=axis + 0.0,
        limits=limits if limits is None or limits[0] < limits[1] else None,
        mimic=mimics.get(name),
        stiffness=along,
        spring=bool(along),
    )


def _followers(mujoco: Any, model: Any) -> dict[str, Mimic]:
    found = {}
    for at in range(model.neq):
        if model.eq_type[at] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[at] >= 0:
            one, other = (model.joint(int(joint[at])).name for joint in (model.eq_obj1id, model.eq_obj2id))
            offset, factor = model.eq_data[at, :2].tolist()
            found[one] = Mimic(other, factor, offset)
    return found


def _lost(mujoco: Any, model: Any) -> list[str]:
    kinds = Counter(int(kind) for kind in model.eq_type if kind != mujoco.mjtEq.mjEQ_JOINT)
    lost = [f"{mujoco.mjtEq(kind).name[5:].lower()} equalities ({count})" for kind, count in kinds.items()]
    if model.ntendon:
        lost.append(f"tendons ({model.ntendon})")
    if model.nu:
        lost.append(f"actuators ({model.nu}): joints that have none are driven here too")
    if np.any(np.linalg.norm(model.body_inertia[1:], axis=1) > WEIGHTLESS):
        lost.append("moments of inertia: masses are points at their centres")
    if model.ngeom:
        lost.append(f"shapes ({model.ngeom})")
    if stops := int(np.sum((model.jnt_stiffness > 0.0) & (model.jnt_limited > 0))):
        lost.append(f"springs with stops ({stops}): rigid here")
    if np.any(model.dof_frictionloss > 0.0):
        lost.append("friction of joints")
    if np.any(model.qpos_spring[: model.nq] != model.qpos0) and model.jnt_stiffness.any():
        lost.append("rest positions of springs (springref)")
    return [f"not read: {item}" for item in lost]


def _end(mujoco: Any, model: Any, tree: LinkTree) -> str | None:
    """Return the TCP: what the file says, its only site, or its only end; None where it has several."""
    said = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, TCP)
    if said >= 0:
        start = int(model.text_adr[said])
        text: bytes = bytes(model.text_data[start : start + int(model.text_size[said]) - 1])
        return text.decode()
    ends = set(range(model.nbody)) - set(model.body_parentid[1:].tolist())
    sites = [at for at in range(model.nsite) if int(model.site_bodyid[at]) in ends]
    if len(sites) == 1 or model.nsite == 1:
        return tree.links[(sites or [0])[0] - int(model.nsite)].name
    return str(model.body(ends.pop()).name) if len(ends) == 1 and not sites else None
