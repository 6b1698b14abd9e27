"""Links and joints for a robot that never was a URDF: its frames, one elementary motion after the other.

A frame's constants make the origin of a joint; each variable in it makes a joint, the first of unit
coefficient the variable's own, all others mimic it. What is left makes a fixed joint. Loops are cut: their
passive joints look free to other readers.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from beamstiff.robot.coupling import Coupling, coupling, frame_expressions, variable_kinds
from beamstiff.robot.description import Robot
from beamstiff.robot.expression import Expression
from beamstiff.robot.frames import MOTIONS, compile_frames
from beamstiff.robot.link_tree import short_number
from beamstiff.robot.placement import elementary, roll_pitch_yaw
from beamstiff.se3 import Array

LEAST_MASS = 1e-9  # kg, and kg m^2: of links that move; simulators refuse less, Gazebo takes none for 1 kg
FLATTEST = 1e-6  # of the moments of inertia: the least of them, for Drake refuses flat ones by their rounding
WEIGHTLESS_LINKS = "links without mass have 1e-9 kg and 1e-9 kg m^2, which simulators ask for"
FARTHEST = 100.0  # m: limits of a slide that has none, which URDF asks for


@dataclass
class Step:
    """A joint to be written: the variable that moves it, by how much, about or along which axis."""

    parent: str
    child: str
    placed: Array
    variable: str = ""
    coefficient: float = 0.0
    kind: str = ""
    axis: int = 2


def numbers_text(values: Array) -> str:
    """Return numbers as an attribute: the shortest text that is read back the same.

    >>> numbers_text(np.array([0.0, -1.5, 1e-5]))
    '0 -1.5 1e-05'
    """
    return " ".join(map(short_number, values.tolist()))


def urdf_skeleton(robot: Robot) -> str:
    """Return a URDF text with the links, joints and masses of a robot's frames."""
    joined = coupling(robot)
    steps = [*elementary_steps(robot, joined)]
    own: dict[str, Step] = {}
    for step in steps:
        if step.variable and abs(step.coefficient) == 1.0:
            own.setdefault(step.variable, step)
    for name in joined.free:  # nothing moves by the variable as it is: a link beside the machine does
        if name not in own:
            kind = variable_kinds(robot)[name]
            own[name] = Step("base", f"{name} drive", np.eye(4), name, 1.0, kind)
            steps.append(own[name])
    masses = _masses(robot)
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(robot.name)}>"]
    lines.append(f"  <!-- {WEIGHTLESS_LINKS} -->")
    for link in ["base", *(step.child for step in steps)]:
        lines += link_lines(link, *masses.get(link, mass_of_points([])))
    names: set[str] = set(joined.free)
    for step in steps:
        lines += _joint_lines(robot, step, own, names)
    if not steps:  # the structure is all in the extension
        lines.append("  <beamstiff/>")
    return "\n".join([*lines, "</robot>", ""])


def elementary_steps(robot: Robot, joined: Coupling) -> Iterator[Step]:
    """Yield the motions that make the frames of a robot, parents first; each moved by one free variable."""
    expressions = frame_expressions(robot)
    kinematics = compile_frames(robot)
    parents = {frame.name: frame.parent for frame in robot.frames}
    taken = {*kinematics.frame_names}
    for name in kinematics.frame_names[1:]:
        own = expressions[name]
        order = [motion for motion, _, _ in MOTIONS]
        moved = [at for at in order if own[at].coefficients]
        # rot(z, theta) and trans(z, r) commute: both constants before either variable
        if "theta" in moved and own["beta"] == Expression():
            order = ["gamma", "b", "alpha", "d", "r", "theta"]
        parent, placed, count = parents[name], np.eye(4), 0
        steps: list[Step] = []
        for motion in order:
            constant, terms = _resolved(own[motion], joined)
            placed = placed @ elementary({motion: constant})
            _, kind, axis = next(item for item in MOTIONS if item[0] == motion)
            for variable, coefficient in terms.items():
                count += 1
                while (link := f"{name} {count}") in taken:
                    count += 1
                step = Step(parent, link, placed, variable, coefficient, kind, axis)
                steps.append(step)
                parent, placed = step.child, np.eye(4)
        if not steps or not np.array_equal(placed, np.eye(4)):
            steps.append(Step(parent, name, placed))
        steps[-1].child = name
        taken.update(step.child for step in steps)
        yield from steps


def _resolved(expression: Expression, joined: Coupling) -> tuple[float, dict[str, float]]:
    """Return an expression as a constant and coefficients of free variables."""
    row, constant = np.zeros(len(joined.free)), expression.constant
    for name, coefficient in expression.coefficients.items():
        at = joined.names.index(name)
        row, constant = row + coefficient * joined.matrix[at], constant + coefficient * joined.offset[at]
    return float(constant), {
        name: float(value) for name, value in zip(joined.free, row, strict=True) if value != 0.0
    }


def _masses(robot: Robot) -> dict[str, tuple[float, Array, Array]]:
    """Return mass, centre and inertia about it of the point masses of each frame."""
    nodes = {node.name: node for node in robot.nodes}
    points: dict[str, list[tuple[float, Array]]] = {}
    for item in robot.masses:
        node = nodes[item.node]
        points.setdefault(node.frame, []).append((item.mass, np.add(node.at, item.at)))
    return {frame: mass_of_points(some) for frame, some in points.items()}


def mass_of_points(points: list[tuple[float, Array]]) -> tuple[float, Array, Array]:
    """Return mass, centre (3,) and inertia about it (3, 3) of point masses: kg, and where, m.

    Never less than what simulators take for a link that moves, and none as flat as points in a plane are.
    """
    inertia = np.zeros((3, 3))
    total = float(sum(mass for mass, _ in points))
    if total == 0.0:
        return LEAST_MASS, np.zeros(3), LEAST_MASS * np.eye(3)
    centre = np.asarray(np.sum([mass * at for mass, at in points], axis=0) / total)
    for mass, at in points:
        arm = at - centre
        inertia += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total, centre, inertia + max(LEAST_MASS, FLATTEST * float(np.trace(inertia))) * np.eye(3)


def link_lines(name: str, mass: float, centre: Array, inertia: Array) -> list[str]:
    """Return a link of a URDF with its inertial."""
    moments = " ".join(
        f'i{"xyz"[i]}{"xyz"[j]}="{numbers_text(inertia[i, j : j + 1])}"'
        for i in range(3)
        for j in range(i, 3)
    )
    return [
        f"  <link name={quoteattr(name)}>",
        "    <inertial>",
        f'      <origin xyz="{numbers_text(centre)}"/>',
        f'      <mass value="{mass!r}"/>',
        f"      <inertia {moments}/>",
        "    </inertial>",
        "  </link>",
    ]


def _joint_lines(robot: Robot, step: Step, own: dict[str, Step], names: set[str]) -> list[str]:
    home = own.get(step.variable)
    name = step.variable if home is step else f"{step.child} joint"
    while home is not step and name in names:
        name += "_"
    names.add(name)
    slides = step.kind in ("shift", "length")
    limits, speed = next(
        ((item.limits, item.speed or 0.0) for item in robot.variables if item.name == step.variable),
        (None, 0.0),
    )
    kind = "fixed" if not step.variable else "prismatic" if slides else "revolute" if limits else "continuous"
    if home is not step and kind == "revolute":
        kind = "continuous"
    lines = [
        f"  <joint name={quoteattr(name)} type={quoteattr(kind)}>",
        f"    <parent link={quoteattr(step.parent)}/>",
        f"    <child link={quoteattr(step.child)}/>",
        f'    <origin xyz="{numbers_text(step.placed[:3, 3])}" '
        f'rpy="{numbers_text(roll_pitch_yaw(step.placed[:3, :3]))}"/>',
    ]
    if step.variable:
        sign = step.coefficient if home is step else 1.0
        lines.append(f'    <axis xyz="{numbers_text(sign * np.eye(3)[step.axis])}"/>')
        low, high = limits if limits is not None and home is step else (-FARTHEST, FARTHEST)
        if kind != "continuous":
            lines.append(f'    <limit lower="{low!r}" upper="{high!r}" effort="0" velocity="{speed!r}"/>')
        if home is not None and home is not step:
            # the own joint's axis carries its sign: its value is the variable's
            lines.append(
                f'    <mimic joint={quoteattr(step.variable)} multiplier="{step.coefficient!r}" offset="0"/>'
            )
    return [*lines, "  </joint>"]
