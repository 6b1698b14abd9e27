"""Print which springs measurements cannot tell apart: random graphs, the IR-663, wrists nearly stretched.

Run as `python -m benchmarks.degeneracy_study` (a minute). The campaigns are simulated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console

from beamstiff import Robot, load_robot
from beamstiff.identification.degeneracy import Degeneracy, find_degeneracy
from beamstiff.identification.identify import identify
from beamstiff.identification.minimise import Effort
from beamstiff.identification.problem import Components, build_problem
from beamstiff.identification.result import Identification
from beamstiff.identification.separating_rows import expected_spread
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.planning.candidates import candidate_poses
from beamstiff.report.tables import Table, table
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array
from benchmarks.degeneracy_graphs import faults, random_case

SIGMA_POSITION = 35e-6  # m, the IR-663's
SIGMA_ROTATION = 70e-6  # rad: of points half a metre apart
JOINTS = ("J12", "J18", "J33", "J99", "J1010")
FORCE, MOMENT = 900.0, 500.0
LOADS = {
    "x": [FORCE, 0, 0, 0, 0, 0],
    "y": [0, FORCE, 0, 0, 0, 0],
    "z": [0, 0, -FORCE, 0, 0, 0],
    "mx": [0, 0, 0, MOMENT, 0, 0],
    "my": [0, 0, 0, 0, MOMENT, 0],
    "mz": [0, 0, 0, 0, 0, MOMENT],
}
# the paper prints none for axial and tilting (it sets them rigid): of the size of such bearings
AXIAL, TILTING = 2e8, 4e6  # N/m, N m/rad
CAMPAIGNS: Mapping[str, tuple[Sequence[str], Components]] = {
    "x, z": (("x", "z"), "position"),
    "x, y, z": (("x", "y", "z"), "position"),
    "x, y, z, rotations read": (("x", "y", "z"), "both"),
    "with moments": (("x", "y", "z", "mx", "my", "mz"), "position"),
    "with moments, rotations read": (("x", "y", "z", "mx", "my", "mz"), "both"),
}


@dataclass(frozen=True)
class Graphs:
    """How many random graphs were judged rightly."""

    graphs: int
    groups: int
    right: int


def random_graphs(count: int, planted: bool) -> Graphs:
    """Return how often the groups found are those planted."""
    right = groups = 0
    for seed in range(count):
        case = random_case(seed, planted)
        groups += len(case.series) + len(case.parallel)
        right += not faults(case, find_degeneracy(build_problem(case.robot, case.tests)))
    return Graphs(count, groups, right)


def campaign(
    robot: Robot, poses: Array, loads: Array, seed: int = 0, components: Components = "both"
) -> Measurements:
    """Return simulated readings of all loads in all poses, with noise.

    Parameters
    ----------
    robot : Robot
        As it is in truth.
    poses : (P, A) array
    loads : (L, 6) array
        At the TCP.
    seed : int
        Of the noise.
    components : "position" or "both"
    """
    q, wrench = np.repeat(poses, len(loads), axis=0), np.tile(loads, (len(poses), 1))
    rotation = None if components == "position" else SIGMA_ROTATION
    tests = make_measurements(
        [variable.name for variable in robot.actuated],
        q,
        tcp=robot.tcp,
        wrench=wrench,
        sigma_position=SIGMA_POSITION,
        sigma_rotation=rotation,
        source="simulated campaign",
    )
    noise = np.random.default_rng(seed).normal(size=(len(q), 6))
    seen = predict_displacements(robot, tests) + noise * np.repeat([SIGMA_POSITION, SIGMA_ROTATION], 3)
    if rotation is None:
        seen[:, 3:] = np.nan
    return replace(tests, displacement=seen)


def poses_of(robot: Robot, count: int = 63, seed: int = 0) -> Array:
    """Return poses within the limits whose loops close, as many as in the paper."""
    return candidate_poses(compile_kinematics(robot), count, seed)


def in_plane(name: str) -> Degeneracy:
    """Return what forces along x and z leave together of an IR-663's drives and radial stiffness."""
    robot = load_robot(name)
    names = [*robot.identify[:2], *(f"{joint}.radial" for joint in JOINTS)]
    tests = campaign(robot, poses_of(robot), loads_of(("x", "z")), components="position")
    return find_degeneracy(build_problem(robot, tests, names))


def loads_of(names: Sequence[str]) -> Array:
    """Return wrenches (L, 6) by name."""
    return np.array([LOADS[name] for name in names], dtype=np.float64)


def with_bearings() -> tuple[Robot, list[str]]:
    """Return the IR-663 with axial and tilting stiffness, and the names of all of its springs."""
    robot = load_robot("ir663")
    axial = {f"{joint}.axial": AXIAL for joint in JOINTS}
    tilting = {f"{joint}.tilting": TILTING for joint in JOINTS}
    radial = [f"{joint}.radial" for joint in JOINTS]
    return robot.with_parameters({**axial, **tilting}), [*robot.identify[:2], *radial, *axial, *tilting]


def expected(loads: Sequence[str], components: Components) -> dict[str, float]:
    """Return the relative standard deviation expected of every spring, or of every sum that is known.

    Infinite where it is never felt; what is only known in a sum is left out.
    """
    actual, names = with_bearings()
    tests = campaign(actual, poses_of(actual), loads_of(loads), components=components)
    problem = build_problem(actual, tests, names)
    found = find_degeneracy(problem)
    spread = dict(zip(names, expected_spread(problem, found).tolist(), strict=True))
    values = dict(zip(names, problem.model.start.tolist(), strict=True))
    grouped = {name for group in found.joined for name in group.members}
    result = {name: value for name, value in spread.items() if name not in grouped}
    for group in found.joined:  # all in series
        first = group.members[0]
        result[group.text()] = spread[first] / values[first] / group.value(values)
    return result


def out_of_plane(loads: Sequence[str], components: Components) -> tuple[Robot, Identification]:
    """Return the IR-663 with axial and tilting stiffness, and what a campaign tells of all of its springs."""
    actual, names = with_bearings()
    tests = campaign(actual, poses_of(actual), loads_of(loads), components=components)
    doubled = {name: 2.0 * actual.parameter(name) for name in names if ".axial" in name or ".tilting" in name}
    effort = Effort(evaluations=100)
    return actual, identify(actual.with_parameters(doubled), tests, names, folds=0, effort=effort)


def wrist(name: str, angle: float, seed: int = 0) -> Identification:
    """Return what 25 tests with the wrist's joint 5 at plus or minus an angle tell of a serial robot."""
    robot = load_robot(name)
    random = np.random.default_rng(seed)
    poses = random.uniform(-1, 1, (25, 6))
    poses[:, 4] = angle * random.choice([-1, 1], 25)
    loads = np.concatenate([random.normal(size=(25, 3)) * 1000, random.normal(size=(25, 3)) * 200], axis=1)
    tests = make_measurements(
        [variable.name for variable in robot.actuated],
        poses,
        tcp=robot.tcp,
        wrench=loads,
        sigma_position=SIGMA_POSITION,
        sigma_rotation=SIGMA_ROTATION,
        source="simulated campaign",
    )
    noise = random.normal(size=(25, 6)) * np.repeat([SIGMA_POSITION, SIGMA_ROTATION], 3)
    return identify(robot, replace(tests, displacement=predict_displacements(robot, tests) + noise), folds=0)


def told(found: Identification, name: str) -> str:
    """Return in a few characters what is known of a parameter."""
    item = found[name]
    if item.silent:
        return "never felt"
    if item.value is not None and item.std is not None:
        return f"{100 * item.std / item.value:.2g} %"
    group = next((one.parameters for one in found.degenerate if name in one.parameters), ())
    if group:
        return "with " + ", ".join(other.split(".")[0] for other in group if other != name)
    return f"> {item.lower_bound:.1e}"


def graphs_table(count: int = 200) -> Table:
    """Return the table of the random graphs."""
    result = table(
        "Random graphs: springs that only act together", "graphs", "groups in them", "judged rightly"
    )
    for what, planted in (("with planted groups", True), ("without", False)):
        found = random_graphs(count, planted)
        result.add_row(f"{count} {what}", str(found.groups), f"{found.right}")
    return result


def in_plane_table() -> Table:
    """Return the table of the IR-663 under forces in its plane."""
    result = table(
        "IR-663 under forces along x and z: drives and radial stiffness of five bearings",
        "robot",
        "groups",
        left=2,
    )
    for name in ("ir663", "ir663-screws"):
        groups = in_plane(name)
        texts = [group.text() for group in groups.joined] + [
            f"mixed {group.members}" for group in groups.mixed
        ]
        result.add_row(name, "; ".join(texts))
    return result


def expected_table() -> Table:
    """Return the table of axial and tilting stiffness, which the paper could not identify."""
    by_campaign = [expected(*one) for one in CAMPAIGNS.values()]
    result = table(
        "IR-663, 63 poses, 900 N and 500 N m along or about the axes: expected relative standard deviation",
        "known by itself, or as a sum",
        *CAMPAIGNS,
    )
    for name in sorted(dict.fromkeys(name for one in by_campaign for name in one), key=_kind):
        cells = [one.get(name) for one in by_campaign]
        result.add_row(name, *("-" if cell is None else _percent(cell) for cell in cells))
    return result


def _kind(name: str) -> tuple[int, str]:
    return next(
        at for at, kind in enumerate(("torsional", "radial", "axial", "tilting")) if kind in name
    ), name


def _percent(value: float) -> str:
    if not np.isfinite(value):
        return "never felt"
    return f"{100 * value:.2g} %" if value < 0.5 else "not bounded"


def out_of_plane_table() -> Table:
    """Return the table of what is found with moments, rotations read."""
    actual, found = out_of_plane(*CAMPAIGNS["with moments, rotations read"])
    result = table(
        "IR-663, forces and moments along all axes, rotations read: identified from a simulated campaign",
        "stiffness",
        "actual",
        "found",
        "95 %",
    )
    for item in found.parameters:
        ends = "-" if item.interval is None else f"{item.interval[0]:.3g} to {item.interval[1]:.3g}"
        result.add_row(item.name, f"{actual.parameter(item.name):.3g}", told(found, item.name), ends)
    for one in found.degenerate:
        values = {name: actual.parameter(name) for name in one.parameters}
        truth = sum(1.0 / value for value in values.values())
        ends = "-" if one.interval is None else f"{one.interval[0]:.2g} to {one.interval[1]:.2g}"
        result.add_row(one.relation, f"{truth:.2g}", "-" if one.value is None else f"{one.value:.2g}", ends)
    return result


def wrist_table() -> Table:
    """Return the table of joints 4 and 6 near the wrist singularity."""
    result = table(
        "Joints 4 and 6 near the wrist singularity, 25 tests",
        "robot",
        "q5, deg",
        "J4.torsional",
        "J6.torsional",
        "known of both",
        "std",
        left=1,
    )
    for name in ("kr500", "kr240-2"):
        for degrees in (0.0, 0.05, 0.5, 3.0, 10.0, 30.0):
            found = wrist(name, np.radians(degrees))
            both = next(iter((*found.degenerate, *found.ill_determined)), None)
            cells = ["-", "-"]
            if both is not None and both.value is not None and both.std is not None:
                kind = "exactly" if both.kind == "series" else "nearly"
                cells = [f"{both.relation} ({kind})", f"{100 * both.std / both.value:.2g} %"]
            result.add_row(
                name, f"{degrees:g}", told(found, "J4.torsional"), told(found, "J6.torsional"), *cells
            )
    return result


def main() -> None:
    """Print the tables."""
    console = Console(highlight=False, markup=False, width=None if Console().is_terminal else 160)
    for one in (graphs_table, in_plane_table, expected_table, out_of_plane_table, wrist_table):
        console.print(one())
        console.print()


if __name__ == "__main__":
    main()
