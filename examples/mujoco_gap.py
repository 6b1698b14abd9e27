"""A simulator's model that deflects like the machine: MJCF in, diagnosis, MJCF out.

The "machine" is simulated in MuJoCo: a KUKA KR240-2 whose axis 2 is softer than its model says and
whose pedestal is compliant; a tracker reads its tool under loads. Needs `pip install 'beamstiff[mujoco]'`.
"""

import tempfile
from pathlib import Path

import numpy as np

from beamstiff import diagnose, load_robot
from beamstiff.diagnosis.apply import extended, readable
from beamstiff.measure import make_measurements
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import AddedEffect
from beamstiff.simulators.deflection import mujoco_deflection
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_writer import robot_to_mjcf

NOISE = 1e-5  # m


def campaign(machine: Robot, seed: int, count: int) -> Measurements:
    """Return what a tracker reads of a machine that MuJoCo simulates."""
    rng = np.random.default_rng(seed)
    q = rng.uniform([-2, 0.3, -2.2, -1, -1, -1], [2, 1.8, -0.3, 1, 1, 1], (count, 6))
    wrench = rng.normal(size=(count, 6)) * [800, 800, 800, 50, 50, 50]
    names = [variable.name for variable in machine.actuated]
    rows = make_measurements(names, q, tcp=machine.tcp, wrench=wrench)
    moved = mujoco_deflection(machine, rows)[0]
    seen = moved[:, :3] + rng.normal(size=(count, 3)) * NOISE
    sigma = {"sigma_position": f"{NOISE} m"}
    return make_measurements(names, q, tcp=machine.tcp, wrench=wrench, displacement=seen, metadata=sigma)


def gap(robot: Robot, rows: Measurements) -> float:
    """Return how far MuJoCo's model of a robot is from the readings, RMS, m."""
    error = mujoco_deflection(robot, rows)[0][:, :3] - rows.displacement[:, :3]
    return float(np.sqrt((error**2).sum(axis=1).mean()))


def main() -> None:
    """Run the example."""
    nominal = load_robot("kr240-2")
    pedestal = AddedEffect(
        effect="base-compliance", shape="tilt", parameters={"tilting_compliance": "1e-7 rad/(N*m)"}
    )
    machine = nominal.with_parameters({"J2.torsional": 5e6}).model_copy(update={"effects": (pedestal,)})
    with tempfile.TemporaryDirectory() as folder:
        start = Path(folder) / "robot.xml"
        start.write_text(robot_to_mjcf(nominal)[0])
        robot = load_robot(start)
        found = diagnose(robot, campaign(machine, 1, 60))
        print(f"verdict: {found.verdict.effect}, {found.verdict.probability:.0%}")
        closed = Path(folder) / "closed.xml"
        text, lost = mjcf_like(readable(extended(found)), start.read_text(), str(start))
        closed.write_text(text)
        added = [line.strip() for line in text.splitlines() if line not in start.read_text()]
        print("changed in the MJCF:", *added, *lost, sep="\n  ")
        fresh = campaign(machine, 2, 30)
        for label, model in (("before", robot), ("after", load_robot(closed))):
            print(f"gap in MuJoCo {label}: {1e3 * gap(model, fresh):.4f} mm on 30 fresh postures")


if __name__ == "__main__":
    main()
