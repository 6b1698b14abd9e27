"""The stiffness values of a robot by name: what can be identified."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from beamstiff.errors import BeamstiffError, listed
from beamstiff.robot.parts import STIFFNESS_KINDS

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


def stiffness_parameters(robot: Robot) -> dict[str, float]:
    """Return every stiffness by its name, SI: of joints and struts (inf is rigid, 0 is free), and beams' E.

    ``"J12.torsional"`` is a joint's, ``"screw2"`` a strut's, ``"arm.E"`` the modulus of a beam (its G follows
    in proportion), which stands for the stiffness of the whole link.
    """
    parameters = {
        f"{joint.name}.{kind}": getattr(joint.stiffness, kind)
        for joint in robot.joints
        for kind in STIFFNESS_KINDS
    }
    parameters |= {strut.name: strut.stiffness for strut in robot.struts}
    return parameters | {f"{beam.name}.E": robot.materials[beam.material].E for beam in robot.beams}


def missing_stiffness(robot: Robot) -> list[str]:
    """Return the joints of a robot without any stiffness; none where a spring, strut or beam is compliant."""
    gives = any(
        getattr(joint.stiffness, kind) != math.inf for joint in robot.joints for kind in STIFFNESS_KINDS
    )
    if gives or robot.beams or robot.struts:
        return []
    return [joint.name for joint in robot.joints if joint.variable is not None]


def check_stiffness(robot: Robot) -> None:
    """Refuse a robot without any compliance, such as one from a URDF that says no stiffness."""
    if missing := missing_stiffness(robot):
        raise BeamstiffError(
            f"robot {robot.name!r}: nothing is compliant, the joints {listed(missing, 12)} are rigid: "
            "expected a stiffness (`stiffness: {torsional: 1e6 N*m/rad}`; of a URDF: beamstiff convert IN "
            "--joint-stiffness '1e6 N*m/rad' --out OUT)"
        )


def parameter_unit(robot: Robot, name: str) -> str:
    """Return the SI unit of a stiffness parameter: ``N/m``, ``N*m/rad`` or ``Pa``."""
    if name in {f"{beam.name}.E" for beam in robot.beams}:
        return "Pa"
    if name in {f"{joint.name}.{kind}" for joint in robot.joints for kind in ("torsional", "tilting")}:
        return "N*m/rad"
    return "N/m"
