"""The stiffness values of a robot by name: what can be identified."""

from __future__ import annotations

from typing import TYPE_CHECKING

from beamstiff.robot.parts import STIFFNESS_KINDS

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


def stiffness_parameters(robot: Robot) -> dict[str, float]:
    """Return every stiffness of the joints and struts by its name, SI (inf is rigid, 0 is free)."""
    parameters = {
        f"{joint.name}.{kind}": getattr(joint.stiffness, kind)
        for joint in robot.joints
        for kind in STIFFNESS_KINDS
    }
    return parameters | {strut.name: strut.stiffness for strut in robot.struts}


def parameter_unit(robot: Robot, name: str) -> str:
    """Return the SI unit of a stiffness parameter: ``N/m`` or ``N*m/rad``."""
    return (
        "N*m/rad"
        if name.endswith((".torsional", ".tilting")) and name in stiffness_parameters(robot)
        else "N/m"
    )
