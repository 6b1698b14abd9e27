"""Calibrate how a lifting column bends: a construction robot before a total station (Hilti, public data).

Kindle et al. (IEEE RA-L 2025) station a robot with a telescopic column of up to 4 m, an arm on top and a
prism at the tool. It is stationed on about 8 points at every height and side, and tested on the others.
Here the column is a beam on a foot that tilts, under the arm's own weight. Its compliances, then all
kinematics and the compliances of the arm's joints are calibrated in one series (`flat`, all its points),
together with the ten places of the base in it, and tested in two others.

The measurements (CC BY-NC-SA) are read from the folder of shared data (BEAMSTIFF_SHARED, default `../shared`
beside the repository). Run `python examples/trailblazer_calibration.py`.
"""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from rich.console import Console

from beamstiff import (
    Beam,
    Frame,
    Joint,
    JointStiffness,
    Mass,
    Material,
    Node,
    Rigid,
    Robot,
    Section,
    Variable,
    calibrate,
)
from beamstiff.calibration.validation import gap_of
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.tables import table
from beamstiff.se3 import Array

HERE = Path(__file__).resolve().parent
SHARED = HERE.parent / os.environ.get("BEAMSTIFF_SHARED", "../shared")
FOLDER = Path("real") / "hilti_trailblazer"
SERIES = ("flat", "outdoor", "seesaw")
# 95 % of the errors in x and y, mm, with other tools, by us: the rigid robot; a column that bends, two
# parameters fitted to `flat`
KNOWN = {
    "rigid": {"flat": 15.1, "outdoor": 12.9, "seesaw": 20.4},
    "column bends": {"flat": 8.0, "outdoor": 8.1, "seesaw": 10.5},
}
SIGMA = 7.5e-4  # m, of the total station
MODULUS, INERTIA = 7e10, 2e-6  # Pa, m^4: a guess to start from
TILT = 1e6  # N m/rad, likewise
VARIABLES = ("column", *(f"q{k}" for k in range(1, 7)))
COLUMN = ("foot.tilting", "column.E")
ARM = tuple(f"A{k}.torsional" for k in range(1, 7))
STAGES: dict[str, tuple[list[str], tuple[str, ...]]] = {
    "column bends": (["base"], COLUMN),
    "and all kinematics": (["base", "target", "offsets", "frames"], COLUMN),
    "and the arm's joints": (["base", "target", "offsets", "frames"], (*COLUMN, *ARM)),
}


def robot_from(urdf: Path) -> Robot:
    """Return the robot of the URDF as frames and links, its column a beam on a foot that tilts."""
    joints = {item.find("child").get("link"): item for item in ET.parse(urdf).iter("joint")}
    inertial = {item.get("name"): item.find("inertial") for item in ET.parse(urdf).iter("link")}
    chain = ["prism"]
    while chain[0] in joints:
        chain.insert(0, joints[chain[0]].find("parent").get("link"))
    # the column's three stages sum up to its length
    chain = [link for link in chain if link not in ("column_middle", "column_top")]
    frames: list[Frame] = []
    nodes = [Node(name="ground"), Node(name="foot")]
    rigids: list[Rigid] = []
    masses: list[Mass] = []
    elastic: list[Joint] = []
    last, held = "base", "foot"

    def turned(name: str, **parameters: float | str) -> None:
        nonlocal last
        frames.append(Frame(name=name, parent=last, **parameters))
        last = name

    for link in chain[1:]:
        joint = joints[link]
        if link == "column_tip":
            turned("column_tip", r="column")
            nodes.append(Node(name="head", frame=last))
            held = "head"
            continue
        origin = joint.find("origin")
        x, y, z = map(float, origin.get("xyz").split())
        roll, pitch, yaw = map(float, origin.get("rpy").split())
        turned(f"{link} x", d=x, r=z)
        turned(f"{link} y", gamma=np.pi / 2, d=y, theta=-np.pi / 2)
        turned(f"{link} turn", theta=yaw, beta=pitch)
        moving = joint.get("type") == "revolute"
        number = sum(item.variable is not None for item in elastic) + 1
        if moving:
            turned(f"{link} roll", alpha=roll)
            nodes.append(Node(name=f"{number}a", frame=last))
            turned(link, theta=f"q{number}")
            nodes.append(Node(name=f"{number}b", frame=last))
            rigids.append(Rigid(name=f"link {number}", nodes=(held, f"{number}a")))
            elastic.append(
                Joint(
                    name=f"A{number}",
                    nodes=(f"{number}a", f"{number}b"),
                    frame=last,
                    variable=f"q{number}",
                    stiffness=JointStiffness(),
                )
            )
            held = f"{number}b"
        else:
            turned(link, alpha=roll)
            if link == "column_base":
                nodes[:2] = [Node(name="ground", frame=last), Node(name="foot", frame=last)]
                column = link
        weight = inertial[link]
        if weight is not None and held != "foot" and float(weight.find("mass").get("value")) > 0.1:
            at = tuple(map(float, weight.find("origin").get("xyz").split()))
            nodes.append(Node(name=link, frame=last))
            rigids.append(Rigid(name=link, nodes=(held, link)))
            masses.append(Mass(node=link, mass=float(weight.find("mass").get("value")), at=at))
    nodes.append(Node(name="prism", frame=last))
    rigids.append(Rigid(name="tool", nodes=(held, "prism")))
    foot = Joint(name="foot", nodes=("ground", "foot"), frame=column, stiffness=JointStiffness(tilting=TILT))
    section = Section(A=5e-3, Iy=INERTIA, Iz=INERTIA, J=2 * INERTIA)
    return Robot(
        name="trailblazer",
        variables=[
            Variable(name=name, type="prismatic" if name == "column" else "revolute") for name in VARIABLES
        ],
        frames=frames,
        nodes=nodes,
        materials={"aluminium": Material(E=MODULUS, G=MODULUS / 2.6)},
        sections={"column": section},
        beams=[Beam(name="column", nodes=("foot", "head"), section="column", material="aluminium")],
        rigids=rigids,
        joints=[foot, *elastic],
        masses=masses,
        fixed=["ground"],
        tcp="prism",
        identify=list(COLUMN),
    )


def stations(series: str) -> list[tuple[Measurements, Measurements]]:
    """Return the points of every height and side: those for stationing, those for testing."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    with (SHARED / FOLDER / f"{series}.yaml").open(encoding="utf-8") as file:
        heights = yaml.load(file, Loader=loader)["column_heights"]
    found = []
    for height, sides in heights.items():
        for side, points in sides["solution_spaces"].items():
            both = (points["stationing_measurements"], points["evaluation_measurements"])
            if len(both[0]) >= 4:
                name = f"{series}, {height} m, side {side}"
                found.append((_table(both[0], name), _table(both[1], f"{name}, tests")))
    return found


def _table(points: list[dict[str, list[float]]], name: str) -> Measurements:
    return make_measurements(
        VARIABLES,
        [point["joint_states"] for point in points],
        tcp="prism",
        position=[point["prism_position"] for point in points],
        sigma_position=SIGMA,
        source=name,
    )


def tested(robot: Robot, series: str) -> Array:
    """Return the errors (n, 3), m, of points tested, the robot stationed anew at every height and side."""
    errors = []
    for stationing, tests in stations(series):
        placed = calibrate(robot, stationing, ["base"], folds=0)
        upright = levelled(robot, placed.base)
        placed = calibrate(upright, stationing, ["base"], folds=0)
        errors.append(gap_of(upright, tests, placed.base)[:, :3])
    return np.concatenate(errors)


def levelled(robot: Robot, base: Array) -> Robot:
    """Return the robot with gravity as the total station has it: straight down, however the base stands."""
    x, y, z = (base[:3, :3].T @ [0.0, 0.0, -9.81]).tolist()
    return robot.model_copy(update={"gravity": (x, y, z)})


def main() -> None:
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 110)
    for name in ("trailblazer.urdf", *(f"{series}.yaml" for series in SERIES)):
        if not (SHARED / FOLDER / name).exists():
            missing = f"{FOLDER / name} (set BEAMSTIFF_SHARED to the folder that holds it)"
            console.print(f"Skipped: shared data missing: {missing}")
            return
    soft = robot_from(SHARED / FOLDER / "trailblazer.urdf")
    tables = [one_station(*pair) for pair in stations("flat")]
    robots = {"rigid": soft.with_parameters({"foot.tilting": np.inf, "column.E": 1e9 * MODULUS})}
    columns = [part for series in SERIES for part in (series, "known")]
    result = table("95 % of the errors in x and y, mm, on points tested", "calibrated on flat", *columns)
    told = []
    for name, (parameters, compliances) in STAGES.items():
        found = calibrate(soft, tables, parameters, compliances=compliances, stations=True, folds=0)
        robots[name] = found.robot
        stiffness = ", ".join(
            f"{item.name} {1 / item.value:.2g} ({100 * item.std / item.value:.0f} %)"
            for item in found.compliances
            if item.std and item.value > 2 * item.std
        )
        count = len(found.identifiability.identified)
        told.append(f"{name}: {count} parameters, {found.noise:.2f} times the noise left; {stiffness}.")
    for name, robot in robots.items():
        cells = []
        for series in SERIES:
            size = np.linalg.norm(tested(robot, series)[:, :2], axis=1)
            known = KNOWN.get(name, {}).get(series)
            cells += [f"{1e3 * np.percentile(size, 95):.1f}", "-" if known is None else f"{known:.1f}"]
        result.add_row(name, *cells)
    console.print(result)
    console.print(
        "\nKnown: with other tools, by us. Stiffness in N m/rad and Pa, with its standard deviation:"
    )
    for line in told:
        console.print(f"- {line}")


def one_station(stationing: Measurements, tests: Measurements) -> Measurements:
    """Return both tables of a place as one."""
    both = concatenate([stationing, tests])
    return replace(both, sources=stationing.sources, run=np.zeros(len(both), dtype=np.int64))


if __name__ == "__main__":
    main()
