"""Sockets on real robots: calibration from balls in sockets, held-out error beside the authors' own.

The data are public (MIT): Franzese, Spahn, Ramirez, MUKCa: Accurate and Affordable Cobot Calibration Without
External Measurement Devices, 2025; https://github.com/platonics-delft/kinematics_calibration. A ball on the
flange sits in two printed sockets, 50 mm apart; about 30 postures a socket, at several places of the tool.

    git clone https://github.com/platonics-delft/kinematics_calibration ../mukca
    python -m benchmarks.mukca ../mukca

The authors calibrated panda_6 and panda_7 on the place "front" alone (their config.yaml) and keep the URDF
that they found. So do we here, from their nominal URDF; the other places are held out for both. The figure
is theirs (evaluate_model): the mean distance of the ball's predicted places from their mean in each socket,
and how far the two means are from 50 mm apart.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from beamstiff import calibrate
from beamstiff.measure.instruments import target
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.urdf.reader import read_urdf

ROBOTS = {"panda_6": ("left", "right"), "panda_7": ("right",)}  # held out; "front" is fitted
APART = 0.05  # m, between the sockets
SEAT = 2e-4  # m: of a printed ball in a printed socket, as the authors' own residuals have it


def sockets(folder: Path) -> list[np.ndarray]:
    """Return the postures (n, 7) in each socket of a place."""
    return [np.loadtxt(folder / f"hole_{k}.csv", delimiter=",") for k in (0, 1)]


def joints(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return postures with the fingers closed."""
    return np.hstack([q, np.zeros((len(q), len(robot.actuated) - q.shape[1]))])


def table(robot: Robot, folder: Path) -> Measurements:
    """Return the postures of a place as rows of two sockets."""
    parts = sockets(folder)
    return make_measurements(
        [variable.name for variable in robot.actuated],
        joints(robot, np.concatenate(parts)),
        tcp=robot.tcp,
        position=np.zeros((sum(map(len, parts)), 3)),
        target=np.repeat([f"{folder.name} {k}" for k in (0, 1)], [len(part) for part in parts]),
        targets=[target(f"{folder.name} {k}", "socket") for k in (0, 1)],
        sigma_position=SEAT,
    )


def figures(robot: Robot, folder: Path) -> tuple[float, float]:
    """Return the authors' figures, m: mean distance from the mean, and error of the sockets' distance."""
    kinematics = compile_kinematics(robot)
    node = kinematics.node_index[robot.tcp]
    places = [posture(kinematics, joints(robot, q)).node_positions[:, node] for q in sockets(folder)]
    away = np.concatenate([np.linalg.norm(p - p.mean(axis=0), axis=1) for p in places])
    return float(away.mean()), float(
        abs(np.linalg.norm(places[0].mean(axis=0) - places[1].mean(axis=0)) - APART)
    )


def main(folder: str) -> None:
    """Print the table."""
    root = Path(folder)
    print("mean distance from the socket's mean, error of the distance between sockets; mm")
    print(f"{'robot':9}{'place':18}{'nominal':>16}{'authors':>16}{'beamstiff':>16}")
    nominal = read_urdf(root / "urdf" / "panda.urdf", tcp="ball_link")
    for name, held_out in ROBOTS.items():
        theirs = read_urdf(root / "calibrated_urdf" / name / "panda.urdf", tcp="ball_link")
        found = calibrate(nominal, table(nominal, root / "data" / name / "front"), folds=0)
        for place in ("front", *held_out):
            at = root / "data" / name / place
            shown = [figures(robot, at) for robot in (nominal, theirs, found.robot)]
            label = place if place != "front" else "front (fitted)"
            print(f"{name:9}{label:18}" + "".join(f"{1e3 * a:9.3f}{1e3 * b:7.3f}" for a, b in shown))
        seen = found.identifiability
        print(f"  {len(seen.identified)} parameters identified; noise {found.noise:.2f} of {1e3 * SEAT} mm")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "../mukca")
