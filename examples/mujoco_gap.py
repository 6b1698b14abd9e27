"""A simulator's model that deflects like the machine: MJCF in, diagnosis, MJCF out.

    python examples/mujoco_gap.py [ARM.xml]

The arm is any MJCF with six hinges, such as universal_robots_ur10e/ur10e.xml of MuJoCo Menagerie, or without
an argument a UR10 of this repository. Its drives get a nominal stiffness. MuJoCo simulates the "machine":
its elbow is softer than that, and it stands on a pedestal that tilts. A tracker reads two reflectors under
several loads: at the tool, and on the base plate, without which a pedestal that tilts and a bearing of axis 1
that does look the same. Needs `pip install 'beamstiff[mujoco]'`.
"""

import re
import sys
import tempfile
from pathlib import Path

import numpy as np

from beamstiff import diagnose, load_robot
from beamstiff.diagnosis.apply import extended, readable
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.simulators.deflection import mujoco_deflection
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_writer import robot_to_mjcf

STIFFNESS = [6e4, 6e4, 4e4, 1e4, 1e4, 1e4]  # N m/rad: of our choice, no maker states it
NOISE = 1e-5  # m, an axis


def campaign(machine: Robot, seed: int, postures: int, noise: float = NOISE) -> Measurements:
    """Return what a tracker reads of a machine in MuJoCo: three loads a posture, two reflectors."""
    rng = np.random.default_rng(seed)
    q = np.repeat(rng.uniform(-2.5, 2.5, (postures, 6)), 6, axis=0)
    wrench = np.repeat(rng.normal(size=(3 * postures, 6)) * [80, 80, 80, 8, 8, 8], 2, axis=0)
    rows = {
        "variables": [variable.name for variable in machine.actuated],
        "q": q,
        "wrench": wrench,
        "tcp": machine.tcp,
        "point": [machine.tcp, "plate"] * (3 * postures),
        "load_point": [machine.tcp] * len(q),
    }
    moved = mujoco_deflection(machine, make_measurements(**rows))[0][:, :3]
    seen = moved + noise * rng.normal(size=moved.shape)
    return make_measurements(**rows, displacement=seen, sigma_position=NOISE)


def gap(robot: Robot, rows: Measurements) -> float:
    """Return how far MuJoCo's model of a robot is from the readings, RMS, m."""
    error = mujoco_deflection(robot, rows)[0][:, :3] - rows.displacement[:, :3]
    return float(np.sqrt((error**2).sum(axis=1).mean()))


def main() -> None:
    """Run the example."""
    with tempfile.TemporaryDirectory() as folder:
        base, start, closed = (Path(folder) / f"{name}.xml" for name in ("base", "start", "closed"))
        if len(sys.argv) > 1:
            base = Path(sys.argv[1])
        else:
            bare = load_robot(Path(__file__).parent / "data" / "ur10.yaml")
            base.write_text(robot_to_mjcf(bare)[0])
        plate = '<site name="plate" pos="0.2 0.15 0"/>'
        with_plate = re.sub(r"(<body [^>]*>)", rf"\1\n      {plate}", base.read_text(), count=1)
        start.write_text(with_plate)
        arm = load_robot(start)
        nominal = arm.with_parameters(
            {f"{joint.name}.torsional": k for joint, k in zip(arm.joints, STIFFNESS, strict=True)}
        )
        start.write_text(mjcf_like(nominal, with_plate, str(start))[0])
        robot = load_robot(start)
        pedestal = AddedEffect(
            effect="base-compliance", shape="tilt", parameters={"tilting_compliance": "4e-6 rad/(N*m)"}
        )
        elbow = f"{robot.joints[2].name}.torsional"
        machine = robot.with_parameters({elbow: 0.8 * STIFFNESS[2]}).model_copy(
            update={"effects": (pedestal,)}
        )
        found = diagnose(robot, campaign(machine, 1, 40))
        print(f"verdict: {found.verdict.effect}, {found.verdict.probability:.0%}")
        text, lost = mjcf_like(readable(extended(found)), start.read_text(), str(start))
        closed.write_text(text)
        added = [line.strip() for line in text.splitlines() if line not in start.read_text()]
        print("changed in the MJCF:", *added, *lost, sep="\n  ")
        fresh = campaign(machine, 2, 15, noise=0.0)
        for label, model in (("before", robot), ("after", load_robot(closed))):
            print(f"gap in MuJoCo {label}: {1e3 * gap(model, fresh):.4f} mm on 15 fresh postures, no noise")


if __name__ == "__main__":
    main()
