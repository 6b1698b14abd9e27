"""Print what the core must show, asked beside reached: closed forms, identities, kinematics, IR-663, time.

Run as `python -m benchmarks.core_figures` from the repository, with the tests' tools installed: the cases are
those of the tests, which hold them to the same bounds. Exit code 1 where a figure misses what is asked.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from beamstiff import BeamstiffError, compile_structure, load_robot, posture, robot_names
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.report.tables import table
from beamstiff.robot.kinematics import compile_kinematics, twist_jacobian
from beamstiff.se3 import Array
from benchmarks import degenerate_figures
from benchmarks.batched_compliance import best, closing_poses, machine
from benchmarks.condition_numbers import condition_numbers, random_poses
from tests.fem import builders, random_frames
from tests.fem import test_cantilever as cantilever
from tests.fem import test_castigliano_bents as bents
from tests.fem import test_identities as identities
from tests.fem import test_macneal_harder as macneal
from tests.fem import test_rigid_offsets as offsets
from tests.fem import test_roark_beams as roark
from tests.fem import test_textbooks as portals
from tests.fem import test_trusses as trusses
from tests.robot import machines
from tests.robot.test_kinematics import differences
from tests.robots import slider_cranks
from tests.robots import test_ir663 as ir663_tests
from tests.robots.machine import at, compliance, inside, springs, values

CASES = 200  # random structures for each identity


@dataclass(frozen=True)
class Figure:
    """One number: of what, what is asked of it, what was reached."""

    claim: str
    asked: str
    reached: str
    holds: bool


def below(claim: str, reached: float, most: float) -> Figure:
    """Return an error beside the largest that is asked for."""
    return Figure(claim, f"<= {most:.0e}", f"{reached:.1e}", bool(reached <= most))


def printed(claim: str, reached: Sequence[float], digits: str, published: Sequence[str]) -> Figure:
    """Return numbers beside published ones, to the digits that are printed there."""
    found = [format(value, digits) for value in reached]
    return Figure(claim, " ".join(published), " ".join(found), found == list(published))


def closed_forms() -> Iterator[Figure]:
    """Yield relative errors against closed forms."""
    for name, section in (("Euler-Bernoulli", builders.SECTION), ("Timoshenko", builders.SHEAR_SECTION)):
        errors = []
        for elements in (1, 2, 7):
            points = [(cantilever.LENGTH * at / elements, 0, 0) for at in range(elements + 1)]
            beams = [(at, at + 1) for at in range(elements)]
            found = builders.compliance(builders.frame(points, beams=beams, section=section, up=(0, 1, 0)))
            errors.append(builders.direct_error(found, cantilever.tip_compliance(section)).max())
        yield below(f"cantilever under six end loads, {name}", max(errors), 1e-9)
    for case in ("propped", "fixed", "simple"):
        errors = []
        for a in (0.5, 1.2, 1.9):
            for axis, second in ((1, builders.SECTION.Iz), (2, builders.SECTION.Iy)):
                load = roark.FORCE * np.eye(6)[axis]
                found = builders.displacement(roark.supported(a, *roark.SUPPORTS[case]), {"n2": load})[axis]
                errors.append(found / roark.under_the_load(case, a, builders.STEEL.E * second) - 1)
        yield below(f"{case if case != 'fixed' else 'fixed-fixed'} beam", np.abs(errors).max(), 1e-9)
    sway = portals.FORCE * portals.HEIGHT**3 / (12 * builders.STEEL.E * portals.COLUMN.Iy)
    for hinged, factor in (
        (False, (3 * portals.K + 2) / (6 * portals.K + 1)),
        (True, (2 * portals.K + 1) / portals.K),
    ):
        found = builders.displacement(portals.portal(hinged), {"n1": portals.FORCE * np.eye(6)[0]})[0]
        name = f"portal, {'hinged' if hinged else 'fixed'} feet: sway"
        yield below(name, abs(found / (sway * factor) - 1), 1e-9)
    found = np.diag(builders.compliance(bents.BENT))
    expected = np.array(list(bents.BENT_BY_CASTIGLIANO.values()))
    yield below("three-dimensional bent under six end loads", np.abs(found / expected - 1).max(), 1e-9)
    found, expected = trusses.tripod(0.6, 1.1, 4e7)
    yield below("space truss (tripod)", np.abs(found / expected - 1).max(), 1e-9)
    errors = [offsets.error_on_a_rigid_arm(arm, rigids) for arm in offsets.ARMS for rigids in (1, 4)]
    yield below("rigid offset at a beam's tip", max(errors), 1e-9)


def published_values() -> Iterator[Figure]:
    """Yield published numbers to their printed digits."""
    straight = builders.compliance(
        builders.frame(
            [(6.0 * at / 6, 0, 0) for at in range(7)],
            beams=[(at, at + 1) for at in range(6)],
            section=macneal.bar(0.2, 0.1),
            material=macneal.material(1e7, 0.3),
            up=(0, 1, 0),
        )
    )
    yield printed("MacNeal-Harder straight, along", straight[[0], [0]], ".1e", ["3.0e-05"])
    yield printed("MacNeal-Harder straight, across", np.diag(straight)[1:3], ".4f", ["0.1081", "0.4321"])
    published, found = np.array([0.005424, 0.001754]), macneal.twisted(12)
    yield Figure(
        "MacNeal-Harder twisted, 12 elements",
        "0.005424 0.001754, one in the last digit",
        f"{found[0]:.8f} {found[1]:.8f}: off by {np.abs(found / published - 1).max():.3%}",
        bool(np.abs(found - published).max() <= 1e-6),
    )
    yield printed("MacNeal-Harder curved, 120 elements", macneal.tip(120), ".4f", ["0.0886", "0.5004"])


def on_random_structures(error: Callable[[int], float | None]) -> float:
    """Return the largest error over random structures; None is one that says nothing."""
    found = [value for seed in range(3 * CASES) if (value := error(seed)) is not None]
    return max(found[:CASES])


def identity_errors() -> Iterator[Figure]:
    """Yield how well identities hold on random structures."""
    yield below(
        "patch test: unequal elements, constant strain",
        max(
            max(identities.patch(seed, 1 + seed % 6, identities.PATCH[seed % 4])) for seed in range(4 * CASES)
        ),
        1e-9,
    )

    zero_modes: list[int] = []

    def rigid_body(seed: int) -> float:
        made = random_frames.beam_frame(seed, 1 + seed % 7, seed % 5)
        K = identities.unsupported_stiffness(compile_structure(made.robot()))
        scale = 1 / np.sqrt(np.diag(K))
        zero_modes.append(int((np.linalg.eigvalsh(scale[:, None] * K * scale) < 1e-9).sum()))
        return float(np.abs(K @ identities.rigid_motions(np.array(made.points))).max() / np.abs(K).max())

    yield below("rigid-body motions meet no force", on_random_structures(rigid_body), 1e-9)
    found = " to ".join(map(str, sorted({min(zero_modes), max(zero_modes)})))
    yield Figure("motions without energy of unsupported frames", "6", found, set(zero_modes) == {6})

    def on_machine(seed: int, of: Callable[[random_frames.RandomFrame, Array], float]) -> float | None:
        made = random_frames.machine_frame(seed, 1 + seed % 7, seed % 5, free=0.1)
        if made.reference().softness() <= identities.FIRM:
            return None
        return of(made, identities.random_loads(made, seed))

    def reciprocity(made: random_frames.RandomFrame, one: Array) -> float:
        other = identities.random_loads(made, 12345)
        first, second = (identities.answer(made.robot(), load).displacement for load in (one, other))
        size = np.abs(one * second).sum()
        return float(abs((one * second).sum() - (other * first).sum()) / size) if size else 0.0

    def turning(made: random_frames.RandomFrame, loads: Array) -> float:
        rotation = builders.some_rotation(7)
        turn = builders.screw(rotation).T
        moved = builders.turned(made.robot(), rotation, (0.5, -0.3, 0.8))
        found = identities.answer(moved, loads @ turn, gravity=True).displacement
        expected = identities.answer(made.robot(), loads, gravity=True).displacement @ turn
        return builders.relative_error(found, expected)

    def energy(made: random_frames.RandomFrame, loads: Array) -> float:
        response = identities.answer(made.robot(), loads)
        work = float((loads * response.displacement).sum())
        twice = 2 * float(response.element_energy.sum() + response.spring_energy.sum())
        return abs(twice - work) / work if work else 0.0

    for claim, of in (
        ("reciprocity (Maxwell, Betti)", reciprocity),
        ("turning and shifting the machine", turning),
        ("twice the strain energy is the loads' work (Clapeyron)", energy),
    ):
        yield below(claim, on_random_structures(lambda seed, of=of: on_machine(seed, of)), 1e-9)


def serial_robots() -> Iterator[Figure]:
    """Yield errors of compliance and Jacobian of rigid-link robots."""
    for name in ("kr240-2", "kr500"):
        robot = load_robot(name)
        q = inside(robot, 1000)
        structure, where = at(robot, q)
        J = twist_jacobian(structure.kinematics, where, robot.tcp)
        expected = (J / [robot.parameter(f"J{n}.torsional") for n in range(1, 7)]) @ J.swapaxes(1, 2)
        error = np.abs(compliance(robot, q) - expected).max() / np.abs(expected).max()
        yield below(f"{name}: compliance against J diag(1/k) J^T, 1000 poses", error, 1e-10)
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (1000, 6))
    kinematics = compile_kinematics(machines.kr240())
    J = twist_jacobian(kinematics, posture(kinematics, q), "tool")
    error = np.abs(J - machines.kr240_appendix_a(q)).max()
    yield below("KR240-2: J against the corrected Appendix A, 1000 poses", error, 1e-12)
    error = np.abs(J - differences(machines.kr240(), q)).max() / np.abs(J).max()
    yield below("KR240-2: J against finite differences", error, 1e-9)


def ir663() -> Iterator[Figure]:
    """Yield size, displacements and joint angles of the IR-663."""
    robot = load_robot("ir663")
    finite = robot.with_parameters({name: 1e9 for name, k in springs(robot).items() if np.isinf(k)})
    size, condition = condition_numbers(finite, ir663_tests.TABLE_4)
    yield Figure("IR-663: reduced K, all joint directions finite or free", "60", f"{size}", size == 60)
    yield Figure("the same, condition number", "< 1e10", f"{condition.max():.1e}", condition.max() < 1e10)
    size, _ = condition_numbers(robot, ir663_tests.TABLE_4)
    yield Figure("the same, 15 rigid joint directions eliminated", "45", f"{size}", size == 45)
    for q, expected, measured in (
        ((1.37, 48.63), "0.96", 0.953),
        ((12.54, 33.04), "0.72", 0.711),
        ((36.83, 62.90), "1.56", 1.156),
    ):
        found = 900e3 * compliance(robot, np.radians([q]))[0, 0, 0]
        yield printed(f"IR-663: mm under 900 N at {q} deg (measured {measured})", [found], ".2f", [expected])
    q = inside(robot, 10_000)
    branch = -1 if ir663_tests.tool_in_front(-1, q) else 1
    difference = values(at(robot, q), "th3") + np.pi / 2 - machines.four_bar_th3(*q.T, branch=branch)
    error = np.abs(slider_cranks.wrapped(difference)).max()
    yield below("IR-663: four-bar angle against the corrected closed form, 10,000 poses", error, 1e-12)
    for name in ("ir663-screws", "ir663-screws-beams"):
        r = inside(load_robot(name), 10_000)
        posed = at(load_robot(name), r)
        angle = np.radians([-110, -155])
        expected = slider_cranks.marie_theta(r[:, 0], *angle, 0.220, 0.750, branch=1)
        error = np.abs(slider_cranks.wrapped(values(posed, "th2") - expected)).max()
        yield below(f"{name}: slider-crank angle likewise", error, 1e-12)


def conditions() -> Iterator[Figure]:
    """Yield the largest condition number of each robot that comes along."""
    for name in robot_names():
        robot = load_robot(name)
        size, found = condition_numbers(robot, random_poses(robot, 1000))
        claim = f"{name}: condition of the scaled reduced K ({size} unknowns), 1000 poses"
        yield Figure(claim, "< 1e10", f"{found.max():.1e}", bool(found.max() < 1e10))


def batches() -> Iterator[Figure]:
    """Yield the time of 10,000 poses of the IR-663 in one call."""
    robot = load_robot("ir663")
    structure = compile_structure(robot)
    q = closing_poses(robot, 10_000)
    seconds = best(lambda: tcp_compliance(structure, posture(structure.kinematics, q)), times=3)
    reached = f"{seconds:.2f} s, {1e6 * seconds / len(q):.0f} us a pose"
    yield Figure(f"IR-663: {len(q)} poses to 6x6 compliance in one call", "printed", reached, True)


def degenerate() -> Iterator[Figure]:
    """Yield what is said of structures that peers answer with garbage."""
    for claim, ask, says in degenerate_figures.REFUSED:
        try:
            reached, holds = f"answered {ask()}", False
        except BeamstiffError as error:
            reached, holds = str(error), says in str(error)
        yield Figure(claim, "one clear line", reached, holds)
    for claim, ask, exact in degenerate_figures.ANSWERED:
        yield below(f"{claim}: exact {exact:g}", abs(ask() / exact - 1), 1e-9)


PARTS: dict[str, Callable[[], Iterator[Figure]]] = {
    "Closed forms, largest relative error": closed_forms,
    "Published values, to their printed digits": published_values,
    f"Identities, largest relative error over {CASES} random structures": identity_errors,
    "Serial robots with rigid links": serial_robots,
    "IR-663": ir663,
    "Condition numbers (the papers' way gives 1e25)": conditions,
    "Many poses": batches,
    "Degenerate structures": degenerate,
}


def main() -> int:
    """Print a table a part; return 1 if a figure misses what is asked."""
    console = Console(highlight=False, markup=False, width=132)
    console.print(machine(), "\n")
    missed = 0
    for title, figures in PARTS.items():
        result = table(title, "", "asked", "reached", "", left=3)
        for figure in figures():
            result.add_row(figure.claim, figure.asked, figure.reached, "" if figure.holds else "MISSED")
            missed += not figure.holds
        console.print(result, "")
    console.print(f"{missed} figures miss what is asked" if missed else "all reached")
    return 1 if missed else 0


if __name__ == "__main__":
    if "OMP_NUM_THREADS" not in os.environ:  # numpy asks once, when it is imported
        threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
        sys.exit(subprocess.call([sys.executable, "-m", "benchmarks.core_figures"], env=threads | os.environ))
    sys.exit(main())
