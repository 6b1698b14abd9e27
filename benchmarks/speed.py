"""How fast, beside what was asked and beside peers: `python -m benchmarks.speed [--peers PYTHON] [--large]`.

Prints the tables and writes them into benchmarks/README.md. PYTHON is an interpreter that has openseespy and
PyNiteFEA (neither is a dependency); `--large` adds 3e5 and 1e6 unknowns and 1e6 poses, some twenty minutes.
Times are processor time on one core, which counts no waiting on a busy machine, medians of five (peers of
three, large frames once); answers are compared before times are. Sections of the README that other benchmarks
wrote stay.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from beamstiff import Robot, compile_structure, load_robot, posture
from beamstiff.expression_graph import compiled
from beamstiff.expression_graph.expression import Op
from beamstiff.expression_graph.graph import ExpressionGraph
from beamstiff.fem.condensation import CHUNK, condense_by_matrices, tcp_compliance
from beamstiff.fem.condensation_program import condensation_program
from beamstiff.fem.placed_structure import place
from beamstiff.fem.structure import Structure
from beamstiff.measure.table import make_measurements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.robot.kinematics import Posture
from beamstiff.robot.parts import STIFFNESS_KINDS
from beamstiff.robot.sections import Section, section_properties
from beamstiff.se3 import Array
from benchmarks.batched_compliance import closing_poses, machine
from benchmarks.growth import all_finite, growth, median
from benchmarks.large_frame import lattices
from benchmarks.peers import ask, off

COMMAND = "python -m benchmarks.speed --large --peers PYTHON"
README = Path(__file__).parent / "README.md"
AGREED = 1e-9
Row = tuple[str, ...]


def floor() -> tuple[float, float]:
    """Return what this core can do: dgemm in flop/s, copying in B/s (read and written)."""
    a, b = np.random.default_rng(0).normal(size=(2, 1500, 1500))
    long = np.zeros(2**25)
    target = np.empty_like(long)
    return 2 * 1500**3 / median(lambda: a @ b), 16 * 2**25 / median(lambda: np.copyto(target, long))


def welded(robot: Robot) -> Robot:
    """Return a robot with rigid joints and round sections: PyNite knows no springs between joined nodes."""
    stiffness = dict.fromkeys(STIFFNESS_KINDS, "rigid")
    fields = [joint.model_dump() | {"stiffness": stiffness} for joint in robot.joints]
    joints = tuple(type(joint)(**field) for joint, field in zip(robot.joints, fields, strict=True))
    round_ones = {name: section_properties(section) for name, section in robot.sections.items()}
    # PyNite turns sections by rules of its own: take round ones
    sections = {
        name: Section(A=one.A, Iy=one.Iy + one.Iz, Iz=one.Iy + one.Iz, J=one.J)
        for name, one in round_ones.items()
    }
    return robot.model_copy(update={"joints": joints, "sections": sections})


def general(structure: Structure, poses: Posture) -> Array:
    """Return the compliance at the TCP by matrices, pose by pose."""
    tcp, number = [structure.robot.tcp], np.arange(len(poses.values))
    return condense_by_matrices(structure, poses, tcp, (), CHUNK, number).clamped


def flops(program: ExpressionGraph) -> int:
    """Return the floating point operations of a program for one pose."""
    double = (Op.MUL_ADD, Op.MUL_SUB, Op.SUB_FROM_MUL)
    return int(len(program.steps) + np.isin(program.steps[:, 0], double).sum())


def interpreted(work: Callable[[], object]) -> Callable[[], object]:
    """Return the same work as it is without numba."""

    def run() -> object:
        kept = os.environ.get(compiled.SWITCH)
        os.environ[compiled.SWITCH] = "0"
        try:
            return work()
        finally:
            os.environ.pop(compiled.SWITCH)
            if kept is not None:
                os.environ[compiled.SWITCH] = kept

    return run


def many_poses(rates: tuple[float, float], peers: str | None, count: int = 10_000) -> Iterator[Row]:
    """Yield rows: work, way, microseconds a pose, difference, what was asked."""
    yield ("work", "way", "us a pose", "differs by", "asked")
    for what, robot in (
        ("IR-663, 60 unknowns", all_finite(load_robot("ir663"))),
        ("IR-663 as shipped, 45 unknowns", load_robot("ir663")),
        ("KR 240-2, 6 unknowns", load_robot("kr240-2")),
        ("gantry, 72 unknowns", load_robot("gantry")),
    ):
        structure = compile_structure(robot)
        q = closing_poses(robot, count)
        poses = posture(structure.kinematics, q)
        tcp = structure.kinematics.node_index[robot.tcp]
        program = condensation_program(structure, (tcp,), (), False)
        assert program is not None
        expected = general(structure, poses)
        micro = 1e6 / count

        def everything(structure: Structure = structure, q: Array = q) -> Array:
            return tcp_compliance(structure, posture(structure.kinematics, q))

        def closing(structure: Structure = structure, q: Array = q) -> Posture:
            return posture(structure.kinematics, q)

        main = "60" in what
        yield (
            what,
            "by matrices",
            f"{median(lambda s=structure, p=poses: general(s, p), 1) * micro:.1f}",
            "-",
            "",
        )
        both = np.inf
        for way, run, asked in (
            ("numpy", interpreted(everything), "<= 20"),
            ("numba", everything, "<= 3"),
        ):
            if way == "numba" and compiled.kernel() is None:
                yield (what, "numba", "not installed", "", asked)
                continue
            found = np.asarray(run())
            both, loops = median(run), median(interpreted(closing) if way == "numpy" else closing)
            yield (
                what,
                f"{way}, joint values to compliance (of it closing loops {loops * micro:.1f})",
                f"{both * micro:.1f}",
                f"{off(found, expected):.0e}",
                asked if main else "",
            )
        work, moved = flops(program.program), 8 * (poses.values.shape[1] + 36)
        by_flops, by_bytes = 1e6 * work / rates[0], 1e6 * moved / rates[1]
        yield (what, f"floor: {work} flops, {moved} bytes", f"{by_flops:.2f}, {by_bytes:.2f}", "", "")
        if peers and main:
            for peer, some in (("opensees_poses", robot), ("pynite_poses", welded(robot))):
                yield _peer_poses(peers, peer, some, q, both * micro)


def _peer_poses(peers: str, peer: str, robot: Robot, q: Array, ours: float) -> Row:
    structure = compile_structure(robot)
    some = posture(structure.kinematics, q[: 20 if peer == "pynite_poses" else 500])
    expected = general(structure, some)
    work = _stated(structure, some)
    what = "the same"
    if peer == "pynite_poses":  # nodes at one place are one node
        what = "the same, joints welded, round"
        same = np.arange(len(robot.nodes))
        for a, b in structure.joint_nodes.tolist():
            same[same == same[b]] = same[a]
        kept, number = np.unique(same, return_inverse=True)
        work |= {"points": work["points"][:, kept], "beams": number[work["beams"]]}
        work |= {"fixed": number[work["fixed"]], "tcp": number[work["tcp"]]}
    answers = [ask(peers, peer, work) for _ in range(3)]
    found, seconds = answers[0].compliance, statistics.median(answer.seconds for answer in answers)
    name = {"opensees_poses": "OpenSeesPy", "pynite_poses": "PyNite"}[peer]
    each = 1e6 * seconds / len(found)
    times = {"opensees_poses": 300, "pynite_poses": 5000}[peer]
    reached = "reached" if each >= times * ours else "MISSED"
    verdict = f"ours {each / ours:,.0f} times faster; asked {times:,}: {reached}"
    return (what, name, f"{each:.0f}", f"{off(found, expected):.0e}", verdict)


def _stated(structure: Structure, poses: Posture) -> dict[str, Array]:
    geometry, robot = place(structure, poses), structure.robot
    kinds = [STIFFNESS_KINDS[at] for at in (0, 1, 1, 2, 3, 3)]
    names = ("E", "G", "A", "J", "Iy", "Iz")
    return {
        "points": poses.node_positions,
        "beams": structure.elements[: len(robot.beams)],
        "properties": np.stack([structure.beam_properties[name] for name in names], axis=1),
        "across": geometry.beam_rotation[:, :, :, 2],
        "joints": structure.joint_nodes,
        "stiffness": np.array([[getattr(joint.stiffness, kind) for kind in kinds] for joint in robot.joints]),
        "axes": geometry.joint_rotation.swapaxes(-1, -2),
        "fixed": np.array([structure.kinematics.node_index[name] for name in robot.fixed]),
        "tcp": np.array(structure.kinematics.node_index[robot.tcp]),
    }


def first_call() -> Iterator[Row]:
    """Yield what the first call costs, in processes of their own."""
    yield ("first call of 10,000 poses", "seconds")
    code = (
        "import time, numpy as np\n"
        "from beamstiff import load_robot, compile_structure, posture, tcp_compliance\n"
        "s = compile_structure(load_robot('kr240-2')); p = posture(s.kinematics, np.zeros((10000, 6)))\n"
        "t = time.process_time(); tcp_compliance(s, p); print(time.process_time() - t)"
    )
    with tempfile.TemporaryDirectory() as folder:
        for what, change in (
            ("numba, compiled for the first time", {"NUMBA_CACHE_DIR": folder}),
            ("numba, machine code kept from before", {"NUMBA_CACHE_DIR": folder}),
            ("numpy", {compiled.SWITCH: "0"}),
        ):
            if "numba" in what and compiled.kernel() is None:
                continue
            run = subprocess.run(
                [sys.executable, "-c", code],
                check=True,
                capture_output=True,
                text=True,
                env=os.environ | change,
            )
            yield (what, f"{float(run.stdout.split()[-1]):.2f}")


def ports(count: int = 10_000) -> Iterator[Row]:
    """Yield rows of evaluations by ports where joint stiffness alone changes."""
    yield ("work", "set up, us a row", "prediction", "with derivatives", "asked")
    finite = all_finite(load_robot("ir663"))
    hinged = finite.with_parameters({f"{joint.name}.torsional": 1e3 for joint in finite.joints[2:]})
    joints = [joint.name for joint in finite.joints]
    rng = np.random.default_rng(0)
    for what, robot, names, asked in (
        (
            "IR-663, 8 parameters, 8 ports",
            hinged,
            [f"{name}.torsional" for name in joints] + [f"{name}.axial" for name in joints[:3]],
            "<= 2",
        ),
        (
            "IR-663, 8 parameters, 11 ports",
            hinged,
            [f"{name}.torsional" for name in joints] + [f"{name}.radial" for name in joints[:3]],
            "",
        ),
        ("IR-663 as shipped, statics alone", load_robot("ir663"), None, ""),
    ):
        q, wrench = closing_poses(robot, count), rng.normal(size=(count, 6)) * 1000
        table = make_measurements(
            [variable.name for variable in robot.actuated],
            q,
            tcp=robot.tcp,
            wrench=wrench,
            displacement=np.zeros((count, 6)),
        )
        start = time.process_time()
        model = reduce_to_ports(robot, table, names)
        setting, micro = time.process_time() - start, 1e6 / count
        yield (
            what,
            f"{setting * micro:.0f}",
            f"{median(lambda model=model: model.predict(model.start)) * micro:.2f}",
            f"{median(lambda model=model: model.derivatives(model.start, 'log')) * micro:.2f}",
            asked,
        )


def written(title: str, rows: Iterator[Row]) -> str:
    """Return rows as a table of Markdown, and print them as they come."""
    lines = [f"## {title}", ""]
    print(f"\n{title}")
    for number, row in enumerate(rows):
        lines.append("| " + " | ".join(row) + " |")
        print(" | ".join(row), flush=True)
        if number == 0:
            lines.append("| " + " | ".join("---" for _ in row) + " |")
    return "\n".join([*lines, ""])


def main() -> None:
    """Print all tables and write them down."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peers", help="a Python that has openseespy and PyNiteFEA")
    parser.add_argument("--large", action="store_true", help="up to a million unknowns and poses")
    chosen = parser.parse_args()
    rates = floor()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    intro = (
        f"{machine()}; dgemm {rates[0] / 1e9:.0f} GFlop/s, copy {rates[1] / 1e9:.0f} GB/s; "
        f"load {load:.1f} at the start. Processor time on one core, medians of five, of peers three; large "
        "frames one run."
    )
    print(intro)
    tables = [
        written(
            "10,000 poses: joint values to the 6x6 compliance at the TCP", many_poses(rates, chosen.peers)
        ),
        written("First call", first_call()),
        written("Only joint stiffness changes: microseconds a row and evaluation", ports()),
        written("Large frames", lattices(rates, chosen.peers, chosen.large)),
        written("Growth", growth(chosen.large)),
    ]
    head = f"# Benchmarks\n\nWritten by `{COMMAND}`.\n\n{intro}\n\n"
    before = README.read_text(encoding="utf-8") if README.exists() else ""
    README.write_text(head + "\n".join([*tables, *others(before, tables)]), encoding="utf-8")


def others(before: str, tables: list[str]) -> list[str]:
    """Return the sections of a text that are none of some tables, by their titles."""
    titles = {table.partition("\n")[0] for table in tables}
    sections = re.split(r"(?m)^(?=## )", before)[1:]
    return [section for section in sections if section.partition("\n")[0] not in titles]


if __name__ == "__main__":
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    if not threads.keys() <= os.environ.keys():  # numpy asks once, when it is imported
        command = [sys.executable, "-m", "benchmarks.speed", *sys.argv[1:]]
        sys.exit(subprocess.call(command, env=threads | os.environ))
    main()
