"""beamstiff: why the real robot does not do what the model says."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from beamstiff._version import __version__
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.calibration.calibrate import calibrate
    from beamstiff.diagnosis.reading import load_robot
    from beamstiff.fem.condensation import tcp_compliance, tcp_stiffness
    from beamstiff.fem.structure import compile_structure
    from beamstiff.identification.identify import identify
    from beamstiff.maps.run import map_workspace
    from beamstiff.measure.reader import read_measurements
    from beamstiff.measure.writer import write_measurements
    from beamstiff.report.shown import plot
    from beamstiff.robot.description import Robot
    from beamstiff.robot.kinematics import posture
    from beamstiff.robot.library import robot_names
    from beamstiff.robot.parts import (
        Beam,
        Frame,
        Joint,
        JointStiffness,
        Loop,
        Mass,
        Material,
        Node,
        Rigid,
        Strut,
        Variable,
    )
    from beamstiff.robot.sections import Section
    from beamstiff.robot.writer import save_robot

# Imported when first used: together they take a second, `beamstiff --help` needs none of them.
_HOME = {
    "calibrate": "calibration.calibrate",
    "compile_structure": "fem.structure",
    "identify": "identification.identify",
    "load_robot": "diagnosis.reading",
    "map_workspace": "maps.run",
    "plot": "report.shown",
    "posture": "robot.kinematics",
    "read_measurements": "measure.reader",
    "robot_names": "robot.library",
    "save_robot": "robot.writer",
    "tcp_compliance": "fem.condensation",
    "tcp_stiffness": "fem.condensation",
    "write_measurements": "measure.writer",
    "Robot": "robot.description",
    "Section": "robot.sections",
    **dict.fromkeys(
        (
            "Beam",
            "Frame",
            "Joint",
            "JointStiffness",
            "Loop",
            "Mass",
            "Material",
            "Node",
            "Rigid",
            "Strut",
            "Variable",
        ),
        "robot.parts",
    ),
}

__all__ = [
    "Beam",
    "BeamstiffError",
    "Frame",
    "Joint",
    "JointStiffness",
    "Loop",
    "Mass",
    "Material",
    "Node",
    "Rigid",
    "Robot",
    "Section",
    "Strut",
    "Variable",
    "__version__",
    "calibrate",
    "compile_structure",
    "identify",
    "load_robot",
    "map_workspace",
    "plot",
    "posture",
    "read_measurements",
    "robot_names",
    "save_robot",
    "tcp_compliance",
    "tcp_stiffness",
    "write_measurements",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'beamstiff' has no attribute {name!r}")
    found = globals()[name] = getattr(importlib.import_module(f"beamstiff.{_HOME[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
