"""Causes of the gap of real robots, from nominal geometry and tracker readings.

Two thirds of the postures are diagnosed, in the order in which they were measured; the rest, every third run
of them, is predicted by the robot with the causes, its measuring frame fitted again: promised against true.
Public data, read from the folder of shared data (BEAMSTIFF_SHARED); link masses of the IRB 120 and the Fanuc
are estimates.

Run `python -m benchmarks.real_robots [NAME ...]`.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from beamstiff import Robot, load_robot
from beamstiff.calibration.calibrate import calibrate
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.decomposition.applied import applied
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.verify import verify
from beamstiff.measure.rows import concatenate, subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.tables import table
from beamstiff.robot.parts import Frame, Joint, JointStiffness, Mass, Node, Rigid, Variable

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT / os.environ.get("BEAMSTIFF_SHARED", "../shared") / "real"
DEGREE = np.pi / 180.0


def arm(
    name: str,
    dh: Sequence[tuple[float, float, float, float]],
    masses: Sequence[float],
    reflectors: Sequence[str] = ("r1", "r2", "r3"),
) -> Robot:
    """Return a rigid 6R arm of classic Denavit-Hartenberg rows: theta offset and alpha, deg, d and a, mm.

    Each link's mass sits half way to the next joint; reflectors start at the flange.
    """
    frames, nodes, joints, rigids, weights = (
        [],
        [Node(name="n0")],
        [],
        [Rigid(name="link0", nodes=["n0", "n1a"])],
        [],
    )
    before = (0.0, 0.0)
    for k, (offset, alpha, d, a) in enumerate(dh, start=1):
        frames.append(
            Frame(
                name=f"f{k}",
                parent="base" if k == 1 else f"f{k - 1}",
                alpha=before[0] * DEGREE,
                d=before[1] * 1e-3,
                theta=f"q{k} {'-' if offset < 0 else '+'} {abs(offset):g} deg" if offset else f"q{k}",
                r=d * 1e-3,
            )
        )
        turn = before[0] * DEGREE  # the axis of the joint, in the frame before it
        place = 1e-3 * np.array([before[1], -np.sin(turn) * d, np.cos(turn) * d])
        nodes += [
            Node(name=f"n{k}a", frame="base" if k == 1 else f"f{k - 1}", at=tuple(place.tolist())),
            Node(name=f"n{k}b", frame=f"f{k}"),
        ]
        joints.append(
            Joint(
                name=f"J{k}",
                nodes=[f"n{k}a", f"n{k}b"],
                frame=f"f{k}",
                variable=f"q{k}",
                stiffness=JointStiffness(),
            )
        )
        if k < len(dh):
            rigids.append(Rigid(name=f"link{k}", nodes=[f"n{k}b", f"n{k + 1}a"]))
        before = (alpha, a)
    for k, mass in enumerate(masses, start=1):
        half = (0.5 * dh[k - 1][3] * 1e-3, 0.0, 0.0) if k < len(dh) else (0.0, 0.0, 0.0)
        weights.append(Mass(node=f"n{k}b", mass=mass, at=half))
    last = f"f{len(dh)}"
    nodes.append(Node(name="flange", frame=last))
    nodes += [
        Node(name=point, frame=last, at=(0.05 * (k - 1), 0.03 * k, 0.05))
        for k, point in enumerate(reflectors)
    ]
    rigids += [Rigid(name=f"to_{point}", nodes=[f"n{len(dh)}b", point]) for point in ("flange", *reflectors)]
    return Robot(
        name=name,
        gravity=(0.0, 0.0, -9.81),
        variables=[Variable(name=f"q{k}", type="revolute") for k in range(1, len(dh) + 1)],
        frames=frames,
        nodes=nodes,
        rigids=rigids,
        joints=joints,
        masses=weights,
        fixed=["n0"],
        tcp="flange",
    )


def stacked(
    robot: Robot, q: np.ndarray, points: Sequence[np.ndarray], sigma: float, source: str
) -> Measurements:
    """Return the readings of several reflectors on each posture."""
    count = len(points)
    names = [f"r{k + 1}" for k in range(count)]
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.repeat(q, count, axis=0),
        tcp=robot.tcp,
        position=np.stack(points, axis=1).reshape(-1, 3),
        point=names * len(q),
        pose=np.repeat(np.arange(len(q)), count),
        step=np.tile(np.arange(count), len(q)),
        sigma_position=sigma,
        source=source,
    )


def irb120() -> tuple[Robot, Measurements]:
    """Return the ABB IRB 120 and the first of its postures, three reflectors each."""
    folder = SHARED / "irb120_faro"
    q = np.loadtxt(folder / "measured_joints.txt")[:, :6] * DEGREE
    points = [1e-3 * np.loadtxt(folder / f"measured_SMR_{k}.txt")[:, :3] for k in (1, 2, 3)]
    valid = np.all([np.abs(one).sum(axis=1) > 0 for one in points], axis=0)
    dh = [
        (0, -90, 290, 0),
        (-90, 0, 0, 270),
        (0, -90, 0, 70),
        (0, 90, 302, 0),
        (0, -90, 0, 0),
        (180, 0, 72, 0),
    ]
    robot = arm("irb120", dh, (3.1, 3.9, 2.9, 1.3, 0.5, 0.5))
    return robot, stacked(
        robot, q[valid][:POSTURES], [one[valid][:POSTURES] for one in points], 5e-6, "irb120"
    )


def fanuc() -> tuple[Robot, Measurements]:
    """Return the Fanuc and its 36 postures, one joint moved at a time."""
    values = np.loadtxt(SHARED / "fanuc_r2000" / "N1N2N3Jval.csv")
    q = values[:, 15:21] * DEGREE
    q[:, 2] = -(q[:, 2] + q[:, 1])
    q[:, 3:] *= -1.0
    dh = [
        (0, -90, 670, 312),
        (-90, 0, 0, 1075),
        (0, -90, 0, 225),
        (0, 90, 1280, 0),
        (0, -90, 0, 0),
        (0, 0, 215, 0),
    ]
    robot = arm("fanuc", dh, (400.0, 250.0, 250.0, 100.0, 40.0, 20.0))
    return robot, stacked(robot, q, [1e-3 * values[:, 3 * k : 3 * k + 3] for k in range(3)], 3e-5, "fanuc")


def ur10() -> tuple[Robot, Measurements]:
    """Return the UR10 and its random postures."""
    sys.path.insert(0, str(ROOT / "examples"))
    from geometric_calibration import read_ur10

    robot = load_robot(ROOT / "examples" / "data" / "ur10.yaml")
    rows = subset(read_ur10(robot, "C"), np.arange(POSTURES_OF_ONE))
    return robot, replace(rows, sigma=np.where(rows.measured_mask, 1e-5, np.nan), sigma_position=1e-5)


def justin() -> tuple[Robot, Measurements]:
    """Return Agile Justin's right arm and torso; the tracking system reads to some tenths of a millimetre."""
    sys.path.insert(0, str(ROOT / "examples"))
    from geometric_calibration import read_justin

    robot = load_robot(ROOT / "examples" / "data" / "agile_justin.yaml").model_copy(update={"tcp": "hand_r"})
    rows = read_justin(robot, "r")
    return robot, replace(rows, sigma=np.where(rows.measured_mask, 1e-3, np.nan), sigma_position=1e-3)


POSTURES, POSTURES_OF_ONE = 300, 900
RUN = 25  # postures in a row, of which the first has lost the one before it
SETS: dict[str, Callable[[], tuple[Robot, Measurements]]] = {
    "ur10": ur10,
    "irb120": irb120,
    "fanuc": fanuc,
    "justin": justin,
}


def fitted_and_held_out(rows: Measurements) -> tuple[Measurements, Measurements]:
    """Return rows to fit, and every third run of postures as they were driven: effects have a memory."""
    poses = np.unique(rows.pose)
    run = min(RUN, max(len(poses) // 9, 1))
    held = np.isin(rows.pose, poses[np.arange(len(poses)) // run % 3 == 1])
    return subset(rows, np.flatnonzero(~held)), subset(rows, np.flatnonzero(held))


def study(name: str, console: Console) -> None:
    """Print one robot's causes, and what they leave of held-out postures."""
    robot, rows = SETS[name]()
    fitted, held = fitted_and_held_out(rows)
    start = time.perf_counter()
    found = diagnose(robot, fitted)
    seconds = time.perf_counter() - start
    geometry = calibrate(robot.model_copy(update={"identify": ()}), fitted, folds=0).robot
    lines = table(
        f"{name}: RMS position error on {len(held)} held-out rows",
        "model",
        "mm",
        "promised",
        "p",
        "not distinguished from",
        left=1,
    )
    lines.add_row("nominal", f"{1e3 * verify(robot, held, refit_frame=True).after:.3f}")
    lines.add_row("calibrated", f"{1e3 * verify(geometry, held, refit_frame=True).after:.3f}")
    checked = verify(extended(found), held, refit_frame=True)
    report, several = found.to_dict(), found.decomposition
    every = (*several.causes, *several.unclear) if several else ()
    for count, cause in enumerate(every, start=1):  # the geometry is fitted anew beside each
        robot_so_far = applied(replace(several, causes=every[:count], unclear=()))
        after = verify(robot_so_far, held, refit_frame=True).after
        what = cause.key if cause.named else f"{cause.key}, undecided"
        alike = ", ".join(cause.indistinguishable[:3])
        lines.add_row(
            f"and {what}",
            f"{1e3 * after:.3f}",
            f"closes {cause.closes:.0%}",
            f"{cause.probability:.2f}",
            alike,
        )
    promised = f"{checked.promised or 0.0:.0%}"
    lines.add_row("with all", f"{1e3 * checked.after:.3f}", f"{promised}, true {checked.true:.0%}")
    lines.add_row("noise as stated", f"{1e3 * checked.noise:.3f}")
    console.print(lines)
    verdict, rest = report["verdict"], report["remainder"]
    follows = [f"{item['what']} ({item['share']:.0%})" for item in rest["follows"][:4]]
    console.print(
        f"verdict {verdict['effect']}:{verdict['component']} ({verdict['probability']:.2f}); "
        f"gap {report['gap']['rms_mm']:.3f} mm, remainder {rest['rms_mm']:.3f} mm, "
        f"which follows {', '.join(follows) or 'nothing known'}; {seconds:.1f} s for {len(fitted)} rows\n"
    )


def trailblazer(console: Console) -> None:
    """Print the causes of a construction robot whose lifting column is rigid in the model, series by series.

    Every series by itself, its ten stations at once: no other series enters.
    """
    sys.path.insert(0, str(ROOT / "examples"))
    from trailblazer_calibration import FOLDER, SERIES, one_station, robot_from, stations

    soft = robot_from(SHARED.parent / FOLDER / "trailblazer.urdf")
    column = Rigid(name="column", nodes=("foot", "head"))
    robot = soft.with_parameters({"foot.tilting": np.inf}).model_copy(
        update={
            "beams": (),
            "materials": {},
            "sections": {},
            "identify": (),
            "rigids": (*soft.rigids, column),
        }
    )
    lines = table("trailblazer, rigid: RMS position gap, mm", "series", "gap", "remainder", "causes", left=1)
    for series in SERIES:
        tables = [one_station(*pair) for pair in stations(series)]
        report = diagnose(robot, concatenate(tables), stations=True).to_dict()
        told = [
            f"{one['effect']}:{one['component'] or 'null'} {one['closes']:.0%}" for one in report["causes"]
        ]
        verdict, left = report["verdict"], report["remainder"]["rms_mm"]
        lines.add_row(series, f"{report['gap']['rms_mm']:.2f}", f"{left:.2f}", ", ".join(told))
        console.print(f"{series}: verdict {verdict['effect']}:{verdict['component']}")
    console.print(lines)


def main() -> None:
    """Print all, or those that are named."""
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 150)
    for name in sys.argv[1:] or (*SETS, "trailblazer"):
        try:
            trailblazer(console) if name == "trailblazer" else study(name, console)
        except FileNotFoundError as error:
            console.print(f"{name}: skipped, missing {error.filename} (BEAMSTIFF_SHARED)")


if __name__ == "__main__":
    main()
