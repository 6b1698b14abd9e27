"""What a socket, a ball bar, a plane and a dial gauge find, beside a tracker, on simulated machines.

    python -m benchmarks.instruments calibration   # geometry: parameters found, error on fresh postures
    python -m benchmarks.instruments absolute      # diagnosis of unloaded states: effects by instrument
    python -m benchmarks.instruments displacement  # diagnosis of loaded minus unloaded states

Machines and effects are the exam's (`beamstiff.exam`: another mechanics than the diagnosis), read by other
instruments. A diagnosis names the effect and its place, has it among what it says it cannot tell from its
verdict (in set), says unknown or none, or names another.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from beamstiff import calibrate, diagnose, load_robot
from beamstiff.calibration.corrected import corrected
from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import SimulatedCampaign
from beamstiff.exam.cases import Case, Exam, draw_case
from beamstiff.exam.effect import Reality
from beamstiff.exam.names import EFFECTS
from beamstiff.exam.simulate import readings, reality_of, simulate
from beamstiff.measure.instruments import Target, target
from beamstiff.measure.registration import fit_rigid_motion
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.planning.seated import reached, seated_postures
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian

NOISE = 2e-5  # m, of every reading
MACHINES = 10  # calibrated
CASES = 2  # of each effect
ROBOTS = ("kr240-2",)  # of the exam's: closed loops take minutes to be brought to their seats
OF_WEIGHT = (  # effects that unloaded states can show: geometry, and what the machine's own weight does
    "geometry-error",
    "payload-error",
    "joint-compliance",
    "backlash",
    "base-compliance",
    "none",
)
OF_LOADS = (
    "backlash",
    "hardening",
    "hysteresis",
    "joint-coupling",
    "bearing-tilt",
    "link-bending",
    "base-compliance",
    "tool-compliance",
    "load-error",
    "thermal-drift",
    "none",
)
Sets = dict[str, list[Target]]


def places(robot: Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return where the TCP is in some postures near the middle of its range, (count, 3)."""
    low, high = np.array([variable.limits or (-1.0, 1.0) for variable in robot.actuated]).T
    found: list[np.ndarray] = []
    kinematics = compile_kinematics(robot)
    while len(found) < count:
        q = low + (high - low) * rng.uniform(0.3, 0.7, len(low))
        try:
            at = posture(kinematics, q[None]).node_positions[0, kinematics.node_index[robot.tcp]]
        except BeamstiffError:
            continue
        found.append(at)
    return np.array(found)


def set_ups(robot: Robot, rng: np.random.Generator) -> Sets:
    """Return three set-ups of each instrument, where they are."""
    at = places(robot, 3, rng)
    size = 0.25 * compile_kinematics(robot).size
    normals = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return {
        "socket": [target(f"S{k}", "socket", place=one) for k, one in enumerate(at)],
        "ball-bar": [target(f"B{k}", "ball-bar", place=one, length=size) for k, one in enumerate(at)],
        "plane": [
            target(f"P{k}", "plane", place=a, normal=n)
            for k, (a, n) in enumerate(zip(at, normals, strict=True))
        ],
        "gauge": [
            target(f"G{k}", "gauge", place=a, normal=n)
            for k, (a, n) in enumerate(zip(at, normals, strict=True))
        ],
    }


def unknown(one: Target) -> Target:
    """Return a set-up as the one who reads knows it: a bar its length, a gauge its direction."""
    return target(
        one.name,
        one.instrument,
        normal=one.normal if one.instrument == "gauge" else None,
        length=one.length,
    )


def still(robot: Robot, q: np.ndarray) -> SimulatedCampaign:
    """Return unloaded states."""
    count = len(q)
    return SimulatedCampaign(
        q=q,
        wrench=np.zeros((count, 6)),
        pose=np.arange(count),
        step=np.zeros(count, dtype=np.int64),
        time=60.0 * np.arange(count),
        temperature=np.full(count, 20.0),
        point=np.full(count, robot.tcp),
        load_point=np.full(count, robot.tcp),
        kind="absolute",
        rotations=False,
    )


def seated(
    robot: Robot, reality: Reality, targets: list[Target], count: int, rng: np.random.Generator
) -> Measurements:
    """Return what instruments read on a machine whose point is brought to each set-up, `count` rows each."""
    kinematics, q, names, read = compile_kinematics(robot), [], [], []
    for one in targets:
        states = seated_postures(robot, one, count, int(rng.integers(1 << 30)))
        if len(states) < 8:
            raise BeamstiffError(f"{one.name} is out of reach")
        for _ in range(3):  # the machine itself brings its point there, not its model
            off, toward = reached(one, readings(reality, still(robot, states))[:, :3])
            slopes = toward @ twist_jacobian(kinematics, posture(kinematics, states), robot.tcp)[:, :3]
            states = states - np.clip(
                (np.linalg.pinv(slopes, rcond=1e-3) @ off[..., None])[..., 0], -0.05, 0.05
            )
        off, _ = reached(one, readings(reality, still(robot, states))[:, :3])
        there = np.abs(off).max(axis=1) < 1e-3
        off, states = off[there], states[there]
        values = np.full((len(states), 3), np.nan)
        values[:, : off.shape[1]] = off + NOISE * rng.standard_normal(off.shape)
        q.append(states)
        names += [one.name] * len(states)
        read.append(values)
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.concatenate(q),
        tcp=robot.tcp,
        position=np.concatenate(read),
        target=names,
        targets=[unknown(one) for one in targets],
        sigma_position=NOISE,
    )


def tracked(robot: Robot, reality: Reality, q: np.ndarray, rng: np.random.Generator) -> Measurements:
    """Return what a tracker reads of free states."""
    position = readings(reality, still(robot, q))[:, :3]
    return make_measurements(
        [variable.name for variable in robot.actuated],
        q,
        tcp=robot.tcp,
        position=position + NOISE * rng.standard_normal(position.shape),
        sigma_position=NOISE,
    )


def every_instrument(
    robot: Robot, reality: Reality, rng: np.random.Generator
) -> Iterator[tuple[str, Measurements]]:
    """Yield tables of about as many readings by each instrument."""
    sets = set_ups(robot, rng)
    for name, targets in sets.items():
        yield name, seated(robot, reality, targets, 25 if name == "socket" else 60, rng)
    free = np.concatenate([seated_postures(robot, one, 20, k) for k, one in enumerate(sets["plane"])])
    yield "tracker", tracked(robot, reality, free, rng)


def calibration() -> None:
    """Print how many parameters of the robot each instrument finds, and the error on fresh postures."""
    robot = load_robot("kr500")
    robot = robot.with_parameters(dict.fromkeys(robot.identify, np.inf))
    usual = [f"{frame.name}.{part}" for frame in robot.frames for part in ("alpha", "d", "r", "beta")]
    usual += [variable.name for variable in robot.actuated]
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    found: dict[str, list[tuple[float, ...]]] = {}
    for number in range(MACHINES):
        rng = np.random.default_rng([31, number])
        real = corrected(
            robot, {name: 1e-3 * rng.standard_normal() for name in usual}, 0.5 * (low + high)[None]
        )
        fresh = rng.uniform(low, high, (200, len(low)))
        truth = tcp_at(real, fresh)
        try:
            tables = list(every_instrument(robot, reality_of(real, ()), rng))
        except BeamstiffError:
            continue
        for name, rows in tables:
            fit = calibrate(robot, rows, folds=0)
            own = sum(
                p.identified and p.parameter.group in ("offset", "frame", "target") for p in fit.parameters
            )
            there = tcp_at(fit.robot, fresh)
            rigid = fit_rigid_motion(there, truth).rms
            scaled = fit_rigid_motion(there, truth, with_scale=True).rms
            before = fit_rigid_motion(tcp_at(robot, fresh), truth).rms
            found.setdefault(name, []).append(
                (len(rows), rows.measured_mask.sum(), own, before, rigid, scaled)
            )
    print(f"{len(found['tracker'])} kr500, each usual parameter off by 1 mm or 1 mrad (std); noise 0.02 mm")
    print("medians: rows, values, parameters of the robot identified; mm on fresh postures laid over as a")
    print("rigid body: before, after, after but for the scale")
    for name, values in found.items():
        median = np.median(np.array(values), axis=0)
        print(
            f"{name:12}" + "{:6.0f}{:6.0f}{:6.0f}".format(*median[:3]),
            *(f"{1e3 * x:9.4f}" for x in median[3:]),
        )


def tcp_at(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return where the TCP of an undeformed robot is, (P, 3)."""
    kinematics = compile_kinematics(robot)
    return posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]


def drawn(effect: str, kind: str, count: int) -> Iterator[Case]:
    """Yield cases of an effect that the exam measures with a kind of readings."""
    shares = {"null": 1} if effect == "none" else {"single": 1}
    effects = EFFECTS if effect == "none" else (effect,)
    exam = Exam(seed=3100, shares=shares, effects=effects, robots=ROBOTS, lean=0.0)
    yielded, number = 0, 0
    while yielded < count and number < 40 * count:
        try:
            case = draw_case(exam, number)
        except BeamstiffError:
            return
        number += 1
        if kind != "absolute" and case.campaign.kind != kind:
            continue
        if kind == "absolute" and not case.robot.masses:  # unloaded, and weightless: no drive shows
            continue
        yielded += 1
        yield case


def judged(case: Case, rows: Measurements) -> str:
    """Return whether a diagnosis of the model names what its machine has."""
    truth = case.truths[0].label if case.truths else "none:null"
    try:
        found = diagnose(case.robot, rows)
    except BeamstiffError as error:
        print(f"    no diagnosis: {error}", file=sys.stderr)
        return "refused"
    if found.verdict.key == truth:
        return "named"
    if truth in found.indistinguishable:
        return "in set"
    return "unknown" if found.verdict.effect in ("unknown", "none") else "other"


def along(rows: Measurements, direction: np.ndarray, name: str) -> Measurements:
    """Return displacements as read along one direction in each row, (N, 3)."""
    moved = np.full((len(rows), 6), np.nan)
    moved[:, 0] = (direction * rows.displacement[:, :3]).sum(axis=1)
    return replace(
        rows,
        displacement=moved,
        direction=direction,
        target=np.full(len(rows), name),
        targets=(replace(target(name, "gauge", normal=(0, 0, 1)), sought=()),),
    )


def by_displacement(case: Case, rng: np.random.Generator) -> Iterator[tuple[str, Measurements]]:
    """Yield the displacements of a campaign as each instrument reads them."""
    every = simulate(case.machine, case.truths, case.campaign, rng)
    every = replace(every, displacement=np.where(np.arange(6) < 3, every.displacement, np.nan))
    point = tcp_at(case.robot, every.q)
    yield "tracker", every
    yield "gauge, z", along(every, np.broadcast_to([0.0, 0.0, 1.0], point.shape).copy(), "z")
    off = point - point.mean(axis=0) - np.array([0.0, 0.0, -0.3])
    yield "ball-bar", along(every, off / np.linalg.norm(off, axis=1, keepdims=True), "bar")


def judgements(kind: str, count: int) -> Iterator[tuple[str, str, str]]:
    """Yield effect, instrument and what became of it, for `count` cases of each effect."""
    for effect in OF_WEIGHT if kind == "absolute" else OF_LOADS:
        told = 0
        for number, case in enumerate(drawn(effect, kind, 3 * count)):
            if told == count:
                break
            rng = np.random.default_rng([31, number])
            try:
                if kind == "absolute":
                    tables = list(every_instrument(case.robot, reality_of(case.machine, case.truths), rng))
                else:
                    tables = list(by_displacement(case, rng))
            except BeamstiffError as error:
                print(f"    {effect} {number}: no states: {error}", file=sys.stderr)
                continue
            told += 1
            for name, rows in tables:
                yield effect, name, judged(case, rows)


def table_of(kind: str, count: int) -> None:
    """Print effects by instrument, in Markdown: how often each is named; broken off, what there is so far."""
    said: dict[str, dict[str, Counter[str]]] = {}
    with suppress(KeyboardInterrupt):
        for effect, name, found in judgements(kind, count):
            said.setdefault(effect, {}).setdefault(name, Counter())[found] += 1
            print(f"  {effect:20} {name:12} {found}", file=sys.stderr, flush=True)
    print(f"{kind}: named / in the set / unknown or none / another, of {', '.join(ROBOTS)}\n")
    names = list(next(iter(said.values()), {}))
    print(f"| effect | cases | {' | '.join(names)} |\n| --- | --- |{' --- |' * len(names)}")
    for effect, by in said.items():
        cells = [(c["named"], c["in set"], c["unknown"] + c["refused"], c["other"]) for c in by.values()]
        texts = [" / ".join(map(str, cell)) for cell in cells]
        print(f"| {effect} | {max(map(sum, cells))} | {' | '.join(texts)} |")


if __name__ == "__main__":
    which = sys.argv[1] if len(sys.argv) > 1 else "calibration"
    if which == "calibration":
        calibration()
    else:
        table_of(which, int(sys.argv[2]) if len(sys.argv) > 2 else CASES)
