"""Simulate the campaign of the tutorial (docs/tutorial.md): a KR240-2 whose pedestal gives way.

The drives differ from the robot's file, the pedestal tilts, the tracker scatters. Neither is told to the
tutorial's commands; they find it. `python examples/tutorial_campaign.py [FILE.csv]`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from beamstiff import Joint, Node, Robot, load_robot
from beamstiff.files import write_whole
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.planning.candidates import candidate_poses, force_loads
from beamstiff.robot.kinematics import compile_kinematics

FILE = Path(__file__).resolve().parent / "data" / "tutorial_campaign.csv"
SIGMA = 30e-6  # m, of the tracker
POSES, LOADS, SEED = 14, (1000.0, 2000.0), 5
AXES = ("x", "-x", "y", "-y", "z", "-z")
DRIVES = {"J1": 3.2e6, "J2": 5.9e6, "J3": 4.3e6, "J4": 5.0e5, "J5": 7.1e5, "J6": 4.7e5}  # N m/rad
PEDESTAL = {"tilting": 1.2e7, "torsional": 1.5e7}  # N m/rad


def machine() -> Robot:
    """Return the robot as it really is."""
    robot = load_robot("kr240-2").with_parameters({f"{name}.torsional": k for name, k in DRIVES.items()})
    pedestal = Joint(name="pedestal", nodes=("floor", "n0"), frame="base", axis="z", stiffness=PEDESTAL)
    parts = {name: getattr(robot, name) for name in type(robot).model_fields}
    parts |= {"nodes": (*robot.nodes, Node(name="floor")), "joints": (*robot.joints, pedestal)}
    return Robot(**parts | {"fixed": ("floor",)})


def campaign() -> str:
    """Return the table of what the tracker sees: every pose under forces along x, y and z, both ways."""
    robot, random = machine(), np.random.default_rng(SEED)
    poses = np.radians(np.degrees(candidate_poses(compile_kinematics(robot), POSES, SEED)).round(1))
    loads = np.concatenate([force_loads(size, AXES) for size in LOADS])
    q, wrench = np.repeat(poses, len(loads), axis=0), np.tile(loads, (len(poses), 1))
    names = [variable.name for variable in robot.actuated]
    exact = predict_displacements(robot, make_measurements(names, q, tcp=robot.tcp, wrench=wrench))
    read = 1e3 * (exact[:, :3] + SIGMA * random.normal(size=(len(q), 3)))
    lines = [f"# source: simulated, examples/{Path(__file__).name}", f"# sigma_position: {1e3 * SIGMA:g} mm"]
    lines.append(",".join([*(f"{name} [deg]" for name in names), "fx,fy,fz", "dx [mm],dy [mm],dz [mm]"]))
    for angles, force, seen in zip(np.degrees(q), wrench[:, :3], read, strict=True):
        cells = [f"{angle:.1f}" for angle in angles]
        cells += [f"{one:.0f}" for one in force]
        cells += [f"{one:.3f}" for one in seen]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write_whole(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE, campaign())
