"""MJCF (MuJoCo's XML) of a machine of bodies: text alone, MuJoCo is not needed."""

from collections.abc import Iterator
from dataclasses import replace
from xml.sax.saxutils import quoteattr

import numpy as np

from beamstiff.robot.description import Robot
from beamstiff.se3 import Array
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.bodies import (
    Body,
    BodyJoint,
    BodyTree,
    Closure,
    Shape,
    Tendon,
    inertia_of,
    placed_bodies,
)
from beamstiff.simulators.urdf_parts import Files, with_urdf_parts

# s: of springs without anything that they move. They get the armature k t^2, so that no motion of springs is
# faster than 1/t (Rayleigh), and the damping 2 k t, which is critical where nothing else is moved.
SETTLE = 2e-3
STEPS = 4  # time steps in it
# of stops: as hard as the time step lets them be
STOP = 'solreflimit="{!r} 1" solimplimit="0.99 0.9999 1e-06"'
TCP = "beamstiff-tcp"  # name of the text that says which site is the TCP
MESHES = (".stl", ".obj", ".msh")
LEAST_ARMATURE = 1e-6  # kg or kg m^2: of joints that nothing resists, so that they can be simulated
HEADER = """
    Written by beamstiff. Every compliance is a joint in series, named as in the robot file.
    Hold the drives exactly, by taking out their degrees of freedom: servos and equalities are springs too.
    Drives: {drives}"""


def robot_to_mjcf(
    robot: Robot, q: Array | None = None, settle: float = SETTLE, files: Files | None = None
) -> tuple[str, tuple[str, ...]]:
    """Return the MJCF text of a robot, and what it does not say.

    `q` (A,): the posture whose values stand for what varies with it; `settle`: s, see `SETTLE`; `files`: of
    meshes.
    """
    tree = with_urdf_parts(assemble(robot, q), robot, files)
    strange = [shape.file for body in tree.bodies for shape in body.shapes if not _drawable(shape)]
    lost = [*tree.lost, *(f"mesh {file}: MuJoCo reads {', '.join(MESHES)}" for file in strange)]
    if tree.varies:
        lost.append(
            "what varies stands as in one posture: --q chooses it, follow_posture changes it in MuJoCo"
        )
    tree = replace(tree, lost=tuple(lost))
    return write_mjcf(tree, settle), tree.lost


def _drawable(shape: Shape) -> bool:
    return shape.kind != "mesh" or shape.file.lower().endswith(MESHES)


def write_mjcf(tree: BodyTree, settle: float = SETTLE) -> str:
    """Return the MJCF text of a machine."""
    joints = [joint for body in tree.bodies for joint in body.joints]
    drives = " ".join(joint.name for joint in joints if joint.role == "drive") or "(none)"
    said = HEADER.format(drives=drives)
    if tree.lost:
        said += "\n    Not in this file, or not exactly:" + "".join(f"\n    - {item}" for item in tree.lost)
    lines = [
        f"<mujoco model={quoteattr(tree.name)}>",
        f"  <!-- {said.strip().replace('--', '- -')}\n  -->",
        '  <compiler angle="radian" autolimits="false"/>',
        f'  <option gravity="{_text(np.array(tree.gravity))}" timestep="{settle / STEPS!r}" '
        'integrator="implicitfast"/>',
        '  <default><geom type="capsule" contype="0" conaffinity="0" mass="0" group="1" rgba=".6 .6 .65 1"/>'
        '<site size=".005" group="3"/></default>',
        f'  <custom><text name="{TCP}" data={quoteattr(tree.tcp)}/></custom>',
        *_meshes(tree),
        "  <worldbody>",
        *_bodies(tree, -1, settle),
        "  </worldbody>",
        *_tendons(tree),
        *_equalities(tree, joints),
        *_reference(tree, joints),
        "</mujoco>",
        "",
    ]
    return "\n".join(lines)


def _bodies(tree: BodyTree, parent: int, settle: float, depth: int = 2) -> Iterator[str]:
    pad = "  " * depth
    for number, body in enumerate(tree.bodies):
        if body.parent != parent:
            continue
        yield f"{pad}<body name={quoteattr(body.name)}{_place(body.placed)}>"
        if body.masses or body.moments or body.joints:
            yield f"{pad}  {_inertial(body)}"
        springs = sum(joint.stiffness for joint in body.joints if joint.kind == "hinge")
        for joint in body.joints:
            yield f"{pad}  {joint_text(joint, settle, springs)}"
        for name, pose in body.sites:
            yield f"{pad}  <site name={quoteattr(name)}{_place(pose)}/>"
        for start, end in body.lines:
            if not body.shapes and (size := float(np.linalg.norm(end - start))) > 1e-6:
                yield f'{pad}  <geom fromto="{_text(start)} {_text(end)}" size="{0.04 * size:.4g}"/>'
        yield from (f"{pad}  {_geom(shape)}" for shape in body.shapes if _drawable(shape))
        yield from _bodies(tree, number, settle, depth + 1)
        yield f"{pad}</body>"


def _meshes(tree: BodyTree) -> Iterator[str]:
    """Yield meshes by name; their volume is not looked at, so those that are not closed pass."""
    drawn = [shape for body in tree.bodies for shape in body.shapes if shape.file and _drawable(shape)]
    for name, shape in {_mesh_name(shape): shape for shape in drawn}.items():
        yield (
            f"  <asset><mesh name={quoteattr(name)} file={quoteattr(shape.file)} "
            f'scale="{_text(shape.sizes["scale"])}" inertia="shell"/></asset>'
        )


def _mesh_name(shape: Shape) -> str:
    return f"{shape.file} {_text(shape.sizes['scale'])}"


def _geom(shape: Shape) -> str:
    said = f'type="{shape.kind}"' + (' group="3"' if shape.collision else "") + _place(shape.pose)
    if shape.kind == "mesh":
        return f"<geom {said} mesh={quoteattr(_mesh_name(shape))}/>"
    numbers = [0.5 * value if name != "radius" else value for name, value in shape.sizes.items()]
    return f'<geom {said} size="{_text(np.concatenate(numbers))}"/>'


def _place(pose: Array) -> str:
    """Return the attributes that place a frame: its position, and its orientation by two of its axes."""
    said = ""
    if np.any(np.abs(pose[:3, 3]) > 1e-15):
        said += f' pos="{_text(pose[:3, 3])}"'
    if not np.allclose(pose[:3, :3], np.eye(3), rtol=0.0, atol=1e-15):
        said += f' xyaxes="{_text(pose[:3, 0])} {_text(pose[:3, 1])}"'
    return said


def _text(values: Array) -> str:
    """Return numbers without the rounding of the products that they come from."""
    return " ".join(f"{0.0 if abs(value) < 1e-15 else value:.15g}" for value in values.tolist())


def _inertial(body: Body) -> str:
    """Return the element of mass, centre and inertia of a body."""
    mass, centre, inertia = inertia_of(body)
    moments = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial pos="{_text(centre)}" mass="{mass!r}" fullinertia="{_text(moments)}"/>'


def joint_text(joint: BodyJoint, settle: float, springs: float) -> str:
    """Return the element of a joint; `springs` is the stiffness of those behind it in its body."""
    said = f'name={quoteattr(joint.name)} type="{joint.kind}"'
    if np.any(joint.at) and joint.kind == "hinge":
        said += f' pos="{_text(joint.at)}"'
    said += f' axis="{_text(joint.axis)}"'
    if joint.limits is not None and joint.role == "drive":
        said += f' limited="true" range="{_text(np.array(joint.limits))}"'
    if joint.stiffness > 0.0:
        k = float(joint.stiffness)
        hard = f" 0 {float(joint.cubic)!r}" if joint.cubic else ""
        said += f' stiffness="{k!r}{hard}" damping="{2 * k * settle!r}" armature="{k * settle**2!r}"'
        if joint.rest:
            said += f' springref="{float(joint.rest)!r}"'
        if joint.friction:
            said += f' frictionloss="{float(joint.friction)!r}"'
        if joint.deadband:
            width = repr(float(joint.deadband))
            said += f' limited="true" range="-{width} {width}" {STOP.format(settle)}'
    elif joint.role == "drive" and joint.kind == "hinge" and springs > 0.0:
        said += f' armature="{springs * settle**2!r}"'
    else:
        said += f' armature="{LEAST_ARMATURE!r}"'
    return f"<joint {said}/>"


def _tendons(tree: BodyTree) -> Iterator[str]:
    if not tree.tendons:
        return
    yield "  <tendon>"
    for tendon in tree.tendons:
        spring = ""
        if 0.0 < tendon.stiffness < np.inf and not tendon.like:
            spring = f' stiffness="{tendon.stiffness!r}" springlength="{tendon.length!r}"'
        sites = "".join(f"<site site={quoteattr(name)}/>" for name in tendon.sites)
        yield f"    <spatial name={quoteattr(tendon.name)}{spring}>{sites}</spatial>"
    yield "  </tendon>"


def _equalities(tree: BodyTree, joints: list[BodyJoint]) -> Iterator[str]:
    followers = [joint for joint in joints if joint.role == "follower"]
    lines = [
        f"    <joint joint1={quoteattr(joint.name)} joint2={quoteattr(joint.leader)} "
        f'polycoef="0 {joint.factor!r} 0 0 0"/>'
        for joint in followers
    ]
    lines += map(_closure, tree.closures)
    lines += _lengths(tree)
    if lines:
        yield from ["  <equality>", *lines, "  </equality>"]


def _closure(closure: Closure) -> str:
    return (
        f"    <{closure.kind} name={quoteattr(closure.name)} site1={quoteattr(closure.one)} "
        f"site2={quoteattr(closure.other)}/>"
    )


def _lengths(tree: BodyTree) -> Iterator[str]:
    """Yield the constraints of tendons that keep their length, or are as long as another."""
    poses = placed_bodies(tree.bodies, {})
    places = {
        name: poses[number] @ pose[:, 3]
        for number, body in enumerate(tree.bodies)
        for name, pose in body.sites
    }

    def at_zero(tendon: Tendon) -> float:
        one, other = (places[name][:3] for name in tendon.sites)
        return float(np.linalg.norm(other - one))

    of_name = {tendon.name: tendon for tendon in tree.tendons}
    for tendon in tree.tendons:
        name = quoteattr(tendon.name)
        if tendon.like:  # lengths are counted from those with all joints at 0
            first = at_zero(of_name[tendon.like]) - at_zero(tendon)
            yield (
                f"    <tendon name={name} tendon1={name} tendon2={quoteattr(tendon.like)} "
                f'polycoef="{first!r} 1 0 0 0"/>'
            )
        elif not np.isfinite(tendon.stiffness):
            longer = tendon.length - at_zero(tendon)
            yield f'    <tendon name={name} tendon1={name} polycoef="{longer!r} 0 0 0 0"/>'


def _reference(tree: BodyTree, joints: list[BodyJoint]) -> Iterator[str]:
    """Yield the posture in which loops are closed, as a keyframe."""
    if not joints:
        return
    values = [tree.reference.get(joint.leader or joint.name, 0.0) * joint.factor for joint in joints]
    # joints in the order of bodies depth first, as the file has them
    order = [joint.name for number in _depth_first(tree, -1) for joint in tree.bodies[number].joints]
    of_name = {joint.name: value for joint, value in zip(joints, values, strict=True)}
    qpos = _text(np.array([of_name[name] for name in order]))
    yield f'  <keyframe><key name="reference" qpos="{qpos}"/></keyframe>'


def _depth_first(tree: BodyTree, parent: int) -> Iterator[int]:
    for number, body in enumerate(tree.bodies):
        if body.parent == parent:
            yield number
            yield from _depth_first(tree, number)
