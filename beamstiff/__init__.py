"""beamstiff: predict robot deflection, identify joint stiffness, and find why the real machine differs."""

import importlib
from typing import TYPE_CHECKING, Any

from beamstiff._version import __version__
from beamstiff.errors import BeamstiffError

if TYPE_CHECKING:
    from beamstiff.fem.structure import compile_structure
    from beamstiff.functions.calibrate import calibrate
    from beamstiff.functions.campaign import campaign
    from beamstiff.functions.compare import compare
    from beamstiff.functions.compare_runs import compare_runs
    from beamstiff.functions.compensate import compensate, compensate_online
    from beamstiff.functions.diagnose import diagnose
    from beamstiff.functions.examine import examine
    from beamstiff.functions.identify import identify
    from beamstiff.functions.plan import plan
    from beamstiff.functions.predict import predict
    from beamstiff.functions.robots import load_robot
    from beamstiff.functions.stiffness import forward_kinematics, stiffness, tcp_compliance, tcp_stiffness
    from beamstiff.functions.verify import verify
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
_MODULES = {
    "fem.structure": "compile_structure",
    **{f"functions.{name}": name for name in ("calibrate", "campaign", "compare", "compare_runs")},
    **{f"functions.{name}": name for name in ("diagnose", "examine")},
    **{f"functions.{name}": name for name in ("identify", "plan", "predict", "verify")},
    "functions.compensate": "compensate compensate_online",
    "functions.robots": "load_robot",
    "functions.stiffness": "forward_kinematics stiffness tcp_compliance tcp_stiffness",
    "maps.run": "map_workspace",
    "measure.reader": "read_measurements",
    "measure.writer": "write_measurements",
    "report.shown": "plot",
    "robot.description": "Robot",
    "robot.kinematics": "posture",
    "robot.library": "robot_names",
    "robot.parts": "Beam Frame Joint JointStiffness Loop Mass Material Node Rigid Strut Variable",
    "robot.sections": "Section",
    "robot.writer": "save_robot",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

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
    "campaign",
    "compare",
    "compare_runs",
    "compensate",
    "compensate_online",
    "compile_structure",
    "diagnose",
    "examine",
    "forward_kinematics",
    "identify",
    "load_robot",
    "map_workspace",
    "plan",
    "plot",
    "posture",
    "predict",
    "read_measurements",
    "robot_names",
    "save_robot",
    "stiffness",
    "tcp_compliance",
    "tcp_stiffness",
    "verify",
    "write_measurements",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'beamstiff' has no attribute {name!r}")
    found = globals()[name] = getattr(importlib.import_module(f"beamstiff.{_HOME[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
