"""From a URDF to the stiffness at its tool, and back into the URDF.

A six-axis arm as its maker might publish it: links, joints, masses and meshes, no word of stiffness. Its
joints get a stiffness, the tool is pushed in a few postures, and the URDF is written again, the same but for
the stiffness, with the deformed structure for ParaView beside it.

Run `python examples/urdf_to_stiffness.py [FOLDER]`; files go to FOLDER (default `examples/output`).
"""

from __future__ import annotations

import difflib
import sys
from pathlib import Path

import numpy as np
from rich.console import Console

from beamstiff import compile_structure, posture, tcp_compliance
from beamstiff.report.tables import number, table
from beamstiff.report.vtk import write_vtu
from beamstiff.robot.description import Robot
from beamstiff.robot.urdf.reader import parse_urdf
from beamstiff.robot.urdf.writer import robot_to_urdf

HERE = Path(__file__).resolve().parent
# joint: type of axis, origin in the parent (m, rad), mass of the child (kg) and its centre (m)
JOINTS = {
    "a1": ("0 0 1", "0 0 0.50", "0 0 0", 150, "0.1 0 0.1"),
    "a2": ("0 1 0", "0.35 0 0.25", "0 0 0", 95, "0 0 0.5"),
    "a3": ("0 1 0", "0 0 1.15", "0 0 0", 80, "0.2 0 0.1"),
    "a4": ("1 0 0", "0.55 0 0.04", "0 0 0", 20, "0.2 0 0"),
    "a5": ("0 1 0", "0.47 0 0", "0 0 0", 10, "0.05 0 0"),
    "a6": ("1 0 0", "0.20 0 0", "0 1.5707963267948966 0", 3, "0 0 0"),
}
STIFFNESS = {"a1": 1.8e6, "a2": 2.4e6, "a3": 1.5e6, "a4": 3.0e5, "a5": 2.5e5, "a6": 1.5e5}  # N m/rad, made up
POSTURES = {
    "stretched": {"a2": 1.2, "a3": -1.1, "a5": 0.3},
    "upright": {"a2": 0.2, "a3": 0.2, "a5": 0.6},
    "low, aside": {"a1": 0.8, "a2": 1.1, "a3": 0.3, "a5": 0.9},
}
PUSH = 500.0  # N


def urdf() -> str:
    """Return the arm's URDF."""
    lines = ['<?xml version="1.0"?>', '<robot name="arm">', '  <link name="base_link"/>']
    parent = "base_link"
    for at, (joint, (axis, xyz, rpy, mass, centre)) in enumerate(JOINTS.items(), start=1):
        lines += [
            f'  <link name="link_{at}">',
            f'    <visual><geometry><mesh filename="package://arm/meshes/link_{at}.stl"/></geometry></visual>',
            f'    <inertial><origin xyz="{centre}"/><mass value="{mass}"/>',
            '      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>',
            "  </link>",
            f'  <joint name="{joint}" type="revolute">',
            f'    <parent link="{parent}"/><child link="link_{at}"/>',
            f'    <origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>',
            '    <limit lower="-3" upper="3" effort="0" velocity="2"/>',
            "  </joint>",
        ]
        parent = f"link_{at}"
    lines += [
        '  <link name="tool0"/>',
        '  <joint name="flange" type="fixed">',
        f'    <parent link="{parent}"/><child link="tool0"/><origin xyz="0 0 0.15"/>',
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def softest(robot: Robot, q: dict[str, float]) -> tuple[float, np.ndarray]:
    """Return how far PUSH moves the tool in the direction where it gives way most (m), and that direction."""
    structure = compile_structure(robot)
    compliance = tcp_compliance(structure, posture(structure.kinematics, q))[0, :3, :3]
    sizes, directions = np.linalg.eigh(compliance)
    direction = directions[:, -1] * np.sign(directions[np.abs(directions[:, -1]).argmax(), -1])
    return float(PUSH * sizes[-1]), direction


def springy(robot: Robot) -> Robot:
    """Return the robot with springs about its joints, which measurements may identify."""
    stiffness = {f"{name}.torsional": value for name, value in STIFFNESS.items()}
    return robot.with_parameters(stiffness).model_copy(update={"identify": tuple(stiffness)})


def main(folder: Path) -> None:
    console = Console()
    text = urdf()
    robot = springy(parse_urdf(text, "arm.urdf"))
    console.print(
        f"{robot.name}: {len(robot.actuated)} joints, {sum(mass.mass for mass in robot.masses):g} kg, "
        f"TCP {robot.tcp}"
    )
    result = table(f"Where {PUSH:g} N move the tool most", "posture", "mm", "x", "y", "z")
    for name, q in POSTURES.items():
        size, direction = softest(robot, q)
        result.add_row(name, number(1e3 * size), *(f"{value:.2f}" for value in direction))
    console.print(result)

    folder.mkdir(parents=True, exist_ok=True)
    written = robot_to_urdf(robot)
    (folder / "arm.urdf").write_text(written, encoding="utf-8")
    write_vtu(robot, POSTURES["stretched"], [0, 0, -PUSH, 0, 0, 0], folder / "arm.vtu")
    console.print("What the URDF says now, all else as it was:")
    for line in difflib.unified_diff(text.splitlines(), written.splitlines(), n=0, lineterm=""):
        if line.startswith("+ "):
            console.print(line, markup=False, highlight=False)
    console.print(f"Written: {folder / 'arm.urdf'}, {folder / 'arm.vtu'} (ParaView)", soft_wrap=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "output")
