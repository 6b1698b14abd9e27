"""Exported models in physics engines: `python -m benchmarks.simulators [POSTURES]`.

Asked: the static deflection in MuJoCo within 1e-3 of `deflect --preload` at a tenth of the nominal load and
within 1 % at nominal; what differs falls with the load. The same in engines that load joints in
series: Pinocchio (URDF) and Drake (SDF, its springs too); their wheels `pin` and `drake` are no dependencies,
skipped where they are missing. Effects one by
one: curve over a load cycle within 2 % of its range. MJCF files of FOLDER (environment variable MJCF), read
and written: the same places of bodies and the same masses to 1e-9; `--like` changes no byte of them.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.exam.robots import random_arm
from beamstiff.files import read_text
from beamstiff.functions.predict import predict
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.report.tables import table
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, sampled_postures
from beamstiff.robot.parts import Beam, Mass, Node
from beamstiff.se3 import Array, vector_from_rotation
from beamstiff.simulators.assemble import assemble
from beamstiff.simulators.bodies import BodyTree
from beamstiff.simulators.deflection import mujoco_deflection
from beamstiff.simulators.mjcf_edit import mjcf_like
from beamstiff.simulators.mjcf_reader import robot_of_model
from beamstiff.simulators.mjcf_writer import robot_to_mjcf, write_mjcf
from beamstiff.simulators.series_joints import series_text
from beamstiff.simulators.statics import MujocoModel, engine
from tests.fem.random_frames import machine_frame
from tests.simulators.test_effects import EFFECTS, cycle, with_effect

UR10_SPRINGS = {"J1": 6e4, "J2": 6e4, "J3": 4e4, "J4": 1e4, "J5": 1e4, "J6": 1e4}  # N m/rad, of our choice
NOMINAL = {"kr240-2": 2400.0, "ir663": 900.0, "ur10": 100.0, "gantry": 1000.0}  # N
SHARES = (0.1, 1.0)
LARGEST = 40  # bodies of an MJCF file that is tried
WORST = (12, 70, 170, 65, 134)  # seeds of structures that are looked at one by one
STEP = 1e-6  # of the differences that make Pinocchio's tangent


def robots() -> Iterator[tuple[str, Robot, float]]:
    """Yield the robots of the issue with their nominal loads, N."""
    for name, load in NOMINAL.items():
        if name == "ur10":
            robot = load_robot(Path(__file__).parents[1] / "examples" / "data" / "ur10.yaml")
            robot = robot.with_parameters({f"{joint}.torsional": k for joint, k in UR10_SPRINGS.items()})
        else:
            robot = load_robot(name)
        yield name, robot, load


def random_robot(seed: int) -> tuple[Robot, float]:
    """Return an arm of random proportions with weight, and a nominal load of 1 mm of deflection or so."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    masses = [Mass(node=f"n{at}b", mass=float(rng.uniform(5, 60)), at=(0.1, 0.0, 0.05)) for at in range(1, 7)]
    return arm.model_copy(update={"masses": tuple(masses)}), 0.002 * min(
        joint.stiffness.torsional for joint in arm.joints
    )


def weightless(robot: Robot) -> Robot:
    """Return a robot on which no gravity acts."""
    return robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def loads(robot: Robot, force: float, count: int, seed: int = 1) -> Measurements:
    """Return postures under forces and moments of random directions, at the TCP."""
    q = sampled_postures(robot, 6 * count, seed)[1:]
    q = q[close_loops(compile_kinematics(robot), q, strict=False).closed][:count]
    way = np.random.default_rng(seed).normal(size=(len(q), 6))
    way[:, :3] *= force / np.linalg.norm(way[:, :3], axis=1, keepdims=True)
    way[:, 3:] *= 0.2 * force / np.linalg.norm(way[:, 3:], axis=1, keepdims=True)
    return make_measurements([v.name for v in robot.actuated], q, tcp=robot.tcp, wrench=way)


def relative(ours: Array, theirs: Array) -> tuple[Array, Array]:
    """Return by how much rows differ, over their size: positions and rotations."""
    parts = (slice(3), slice(3, 6))
    position, rotation = (
        np.linalg.norm((theirs - ours)[:, part], axis=1) / np.linalg.norm(ours[:, part], axis=1)
        for part in parts
    )
    return position, rotation


def in_mujoco(robot: Robot, force: float, count: int) -> list[str]:
    """Return median and largest errors at shares of the load, with and without weight."""
    cells = []
    for machine in (robot, weightless(robot)):
        for share in SHARES:
            rows = loads(machine, share * force, count)
            found = relative(predict_displacements(machine, rows, True), mujoco_deflection(machine, rows)[0])
            cells.append(median_and_largest(found))
    return cells


@dataclass(frozen=True)
class Load:
    """What acts on a structure: a force, N, at the TCP and a share of its weight; its beams in pieces."""

    force: float = 1.0
    weight: float = 1.0
    pieces: int = 1
    ours_too: bool = False  # our own solution in pieces is held against that of whole beams

    def of(self, seed: int) -> tuple[Robot, Measurements]:
        """Return a random structure of all kinds of parts and its load."""
        robot = machine_frame(seed, more=6, loops=3).robot()
        robot = robot.model_copy(update={"gravity": tuple(self.weight * one for one in robot.gravity)})
        wrench = self.force * np.array([[1, 2, 3, 0.1, 0.2, 0.3]])
        return robot, make_measurements([], [[]], tcp=robot.tcp, wrench=wrench)

    def error(self, seed: int) -> float | None:
        """Return the error of positions: inf without equilibrium in MuJoCo, None where nothing deflects."""
        robot, push = self.of(seed)
        try:
            ours = predict_displacements(robot, push, True)
        except BeamstiffError:
            return None  # a mechanism
        if not np.abs(ours[:, :3]).max() > 1e-10 * self.force:
            return None  # the tool cannot move
        fine = in_pieces(robot, self.pieces)
        try:
            other = (
                predict_displacements(fine, push, True) if self.ours_too else mujoco_deflection(fine, push)[0]
            )
        except BeamstiffError:
            return float("inf")
        return float(np.linalg.norm((other - ours)[0, :3]) / np.linalg.norm(ours[0, :3]))


def structures(count: int, load: Load) -> dict[int, float]:
    """Return the errors of so many random structures by their seeds."""
    errors, seed = dict[int, float](), 0
    while len(errors) < count:
        if (error := load.error(seed)) is not None:
            errors[seed] = error
        seed += 1
    return errors


def reversed_hinges(seed: int) -> tuple[float, float]:
    """Return the errors with hinges that nothing resists in reverse order, and of the mean of both orders."""
    robot, push = Load().of(seed)
    tree, ours = assemble(robot), predict_displacements(robot, push, True)[0, :3]
    other = []
    for body in tree.bodies:
        free = [joint.kind == "hinge" and joint.stiffness == 0.0 for joint in body.joints]
        last = iter([joint for joint, is_free in zip(body.joints, free, strict=True) if is_free][::-1])
        joints = zip(body.joints, free, strict=True)
        other.append(replace(body, joints=[next(last) if is_free else joint for joint, is_free in joints]))
    moved = []
    for one in (tree, replace(tree, bodies=tuple(other))):
        model = MujocoModel(write_mjcf(one))
        rest = model.equilibrium({}, np.zeros(6), robot.tcp)
        loaded = model.equilibrium({}, push.wrench[0], robot.tcp, rest)
        moved.append(model.site_pose(robot.tcp, loaded)[0] - model.site_pose(robot.tcp, rest)[0])
    first, second = (
        float(np.linalg.norm(d - ours) / np.linalg.norm(ours)) for d in (moved[1], sum(moved) / 2)
    )
    return first, second


def in_pieces(robot: Robot, pieces: int) -> Robot:
    """Return a robot without variables with every beam in some pieces of equal length."""
    places = {node.name: np.array(node.at) for node in robot.nodes}
    nodes, beams = list(robot.nodes), list[Beam]()
    for beam in robot.beams:
        first, second = (places[name] for name in beam.nodes)
        names = [beam.nodes[0], *(f"{beam.name}_{at}" for at in range(1, pieces)), beam.nodes[1]]
        for at, name in enumerate(names[1:-1], start=1):
            nodes.append(Node(name=name, frame="base", at=tuple(first + (second - first) * at / pieces)))
        for at, ends in enumerate(pairwise(names)):
            beams.append(beam.model_copy(update={"name": f"{beam.name}_{at}", "nodes": ends}))
    return robot.model_copy(update={"nodes": tuple(nodes), "beams": tuple(beams)})


@dataclass(frozen=True)
class Engine:
    """A robot in an engine that loads URDF or SDF with joints in series, its loops cut open."""

    tree: BodyTree
    place: dict[str, int]  # of joints among the n degrees of freedom
    inner: Callable[[Array], Array]  # forces of gravity and springs (n,) at values (n,)
    link: Callable[[Array, str], tuple[Array, Array, Array]]  # position, rotation, Jacobian (6, n) of a link

    def gaps(self, v: Array) -> tuple[Array, Array]:
        """Return what keeps loops, screws and followers from being closed, and its derivatives: our own.

        ``g``, (c,), and ``dg/dv``, (c, n).
        """
        gap, rows = list[float](), list[Array]()
        for loop in self.tree.closures:
            (one, turned, J), (other, held, K) = (self.link(v, name) for name in (loop.one, loop.other))
            count = 6 if loop.kind == "weld" else 3
            gap += [*(one - other), *vector_from_rotation(turned @ held.T)][:count]
            rows += [*(J - K)[:count]]
        lengths = {tendon.name: self.length(v, *tendon.sites) for tendon in self.tree.tendons}
        for tendon in self.tree.tendons:
            if tendon.like:
                (longer, J), (length, K) = lengths[tendon.name], lengths[tendon.like]
                gap.append(longer - length)
                rows.append(J - K)
        for joint in (joint for body in self.tree.bodies for joint in body.joints if joint.leader):
            row = np.zeros(len(v))
            row[self.place[joint.name]], row[self.place[joint.leader]] = 1.0, -joint.factor
            gap.append(float(row @ v))
            rows.append(row)
        return np.array(gap), np.array(rows).reshape(-1, len(v))

    def length(self, v: Array, first: str, second: str) -> tuple[float, Array]:
        """Return the distance of two links and its derivatives."""
        (one, _, J), (other, _, K) = self.link(v, first), self.link(v, second)
        length = float(np.linalg.norm(other - one))
        return length, (other - one) @ (K - J)[:3] / length

    def rest(
        self, v: Array, held: list[int], wrench: Array, tangent: Array | None = None
    ) -> tuple[Array, Array]:
        """Return equilibrium and tangent by Newton's method, loops closed by Lagrange multipliers."""
        free = np.setdiff1d(np.arange(len(v)), held)
        tool, v, pull = self.tree.tcp, v.copy(), np.zeros(len(self.gaps(v)[0]))

        def forces(at: Array) -> Array:
            return (self.inner(at) + self.link(at, tool)[2].T @ wrench + self.gaps(at)[1].T @ pull)[free]

        for turn in range(40):
            left, (gap, G) = forces(v), self.gaps(v)
            if tangent is None or turn % 10 == 9:  # chords between
                tangent = np.empty((free.size, free.size))
                for column, at in enumerate(free):
                    ahead, behind = v.copy(), v.copy()
                    ahead[at] += STEP
                    behind[at] -= STEP
                    tangent[:, column] = (forces(behind) - forces(ahead)) / (2 * STEP)
            size = np.sqrt(np.maximum(np.abs(np.diag(tangent)), 1e-10 * np.abs(tangent).max()))
            rows = G[:, free] / size
            most = np.linalg.norm(rows, axis=1)
            matrix = np.zeros((free.size + len(gap),) * 2)
            matrix[: free.size, : free.size] = tangent / size[:, None] / size
            matrix[: free.size, free.size :] = -(rows / most[:, None]).T
            matrix[free.size :, : free.size] = rows / most[:, None]
            step = np.linalg.lstsq(matrix, np.concatenate([left / size, -gap / most]), rcond=1e-13)[0]
            v[free] += step[: free.size] / size
            pull += step[free.size :] / most
            if np.abs(step[: free.size] / size).max() < 1e-11:
                return v, tangent
        raise BeamstiffError("no equilibrium")


def in_pinocchio(robot: Robot, q: Array) -> Engine:
    """Return a robot in Pinocchio: its gravity and Jacobians, our springs (URDF has none)."""
    import pinocchio

    tree = assemble(robot, q)
    model = pinocchio.buildModelFromXML(series_text(tree, "urdf", []))
    model.gravity.linear = np.array(robot.gravity)
    data = model.createData()
    stiffness = np.zeros(model.nv)
    place = {name: model.joints[model.getJointId(name)].idx_v for name in model.names[1:]}
    for joint in (joint for body in tree.bodies for joint in body.joints):
        stiffness[place[joint.name]] = joint.stiffness

    def placed(v: Array) -> Array:
        return np.asarray(pinocchio.integrate(model, pinocchio.neutral(model), v))

    def inner(v: Array) -> Array:
        return np.asarray(-pinocchio.computeGeneralizedGravity(model, data, placed(v)) - stiffness * v)

    def link(v: Array, name: str) -> tuple[Array, Array, Array]:
        frame = model.getFrameId(name)
        J = pinocchio.computeFrameJacobian(model, data, placed(v), frame, pinocchio.LOCAL_WORLD_ALIGNED)
        return data.oMf[frame].translation.copy(), data.oMf[frame].rotation.copy(), J

    return Engine(tree, place, inner, link)


def in_drake(robot: Robot, q: Array) -> Engine:
    """Return a robot in Drake, which reads the springs of the SDF itself."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

    tree, plant = assemble(robot, q), MultibodyPlant(0.0)
    (machine,) = Parser(plant).AddModelsFromString(series_text(tree, "sdf", []), "sdf")
    plant.mutable_gravity_field().set_gravity_vector(np.array(robot.gravity))
    plant.Finalize()
    context, world = plant.CreateDefaultContext(), plant.world_frame()
    joints = [plant.get_joint(at) for at in plant.GetJointIndices(machine)]
    place = {joint.name(): joint.velocity_start() for joint in joints if joint.num_velocities()}
    forces = MultibodyForces(plant)

    def inner(v: Array) -> Array:
        plant.SetPositions(context, v)
        plant.CalcForceElementsContribution(context, forces)  # gravity and springs
        return np.asarray(plant.CalcGeneralizedForces(context, forces))

    def link(v: Array, name: str) -> tuple[Array, Array, Array]:
        plant.SetPositions(context, v)
        body = plant.GetBodyByName(name)
        at, variable = plant.EvalBodyPoseInWorld(context, body), JacobianWrtVariable.kV
        J = plant.CalcJacobianSpatialVelocity(context, variable, body.body_frame(), np.zeros(3), world, world)
        return at.translation().copy(), at.rotation().matrix().copy(), J[[3, 4, 5, 0, 1, 2]]

    return Engine(tree, place, inner, link)


def deflections(make: Callable[[Robot, Array], Engine], robot: Robot, rows: Measurements) -> Array:
    """Return displacements (shares, N, 6) in an engine's equilibria under shares of loads, drives held."""
    kinematics = compile_kinematics(robot)
    values, engine_of = close_loops(kinematics, rows.q).values, None
    result = np.zeros((len(SHARES), len(rows), 6))
    for row, (q, wrench) in enumerate(zip(rows.q, rows.wrench, strict=True)):
        if engine_of is None or engine_of.tree.varies:
            engine_of = make(robot, q)
        start = np.zeros(len(engine_of.place))
        known = dict(zip(kinematics.coupling.names, values[row].tolist(), strict=True))
        for joint in (joint for body in engine_of.tree.bodies for joint in body.joints):
            start[engine_of.place[joint.name]] = known.get(joint.leader or joint.name, 0.0) * joint.factor
        held = [engine_of.place[name] for name in rows.variables]
        unloaded, tangent = engine_of.rest(start, held, np.zeros(6))
        before, turned, _ = engine_of.link(unloaded, robot.tcp)
        for at, share in enumerate(SHARES):
            loaded = engine_of.rest(unloaded, held, share * wrench, tangent)[0]
            after, on, _ = engine_of.link(loaded, robot.tcp)
            result[at, row] = [*(after - before), *vector_from_rotation(on @ turned.T)]
    return result


def errors_in(
    make: Callable[[Robot, Array], Engine], robot: Robot, load: float, count: int, seed: int = 1
) -> list[tuple[Array, Array]]:
    """Return the errors of positions and rotations at every share of the load."""
    theirs = deflections(make, robot, loads(robot, load, count, seed))
    return [
        relative(predict_displacements(robot, loads(robot, share * load, count, seed), True), one)
        for share, one in zip(SHARES, theirs, strict=True)
    ]


def second_engine(name: str, make: Callable[[Robot, Array], Engine], count: int) -> Any:
    """Return the table of an engine that loads URDF or SDF."""
    found = table(name, "robot", "weight, load/10 (1e-3)", "weight, nominal (1e-2)")
    for robot_name, robot, load in robots():
        found.add_row(robot_name, *map(median_and_largest, errors_in(make, robot, load, count)))
    arms = [errors_in(make, *random_robot(seed), 1, seed) for seed in range(count)]
    together = [
        (np.concatenate([one[0] for one in share]), np.concatenate([one[1] for one in share]))
        for share in zip(*arms, strict=True)
    ]
    found.add_row(f"{count} random arms, a posture each", *map(median_and_largest, together))
    return found


def median_and_largest(errors: tuple[Array, Array]) -> str:
    """Return what is printed of the errors of positions and of rotations."""
    return " ".join(f"{np.median(one):.0e}/{one.max():.0e}" for one in errors)


def effects() -> Iterator[list[str]]:
    """Yield a row for each effect: what it adds, and how far MuJoCo is from it, of the range of the curve."""
    for name, component, shape, parameters, scales in EFFECTS:
        robot = with_effect(name, component, shape, parameters, scales)
        rows = cycle(robot)
        ours = predict(robot, rows, preload=True).displacement
        plain = predict(robot.model_copy(update={"effects": ()}), rows, preload=True).displacement
        gap = np.abs(mujoco_deflection(robot, rows)[0] - ours)
        cells = []
        for part in (slice(3), slice(3, 6)):
            size = np.ptp(ours[:, part], axis=0).max()
            cells += [f"{np.abs(ours - plain)[:, part].max() / size:.1%}", f"{gap[:, part].max() / size:.2%}"]
        yield [f"{name}, {shape}", *cells]


def round_trips(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield each MJCF of a folder and what came of it: `same`, or why not."""
    mujoco = engine()
    for file in sorted(folder.rglob("*.xml")):
        try:
            model = mujoco.MjModel.from_xml_path(str(file))
        except ValueError:
            yield str(file), "refused by MuJoCo (a part of a model, or files are missing)"
            continue
        moving = [at for at in range(model.njnt) if model.jnt_type[at] >= 2]
        if not moving or model.nbody > LARGEST:
            yield str(file), f"without hinges and slides, or of more than {LARGEST} bodies"
            continue
        try:
            tip = model.body(model.nbody - 1).name or f"body {model.nbody - 1}"
            robot = robot_of_model(mujoco, model, str(file), tip).robot
            again = MujocoModel(robot_to_mjcf(robot)[0])
        except BeamstiffError as error:
            yield str(file), f"refused: {str(error).split(': ', 1)[-1][:70]}"
            continue
        what = same(mujoco, model, again, robot)
        if what == "same" and mjcf_like(robot, read_text(file), str(file))[0] != read_text(file):
            what = "changed by --like"
        yield str(file), what


def same(mujoco: Any, model: Any, again: MujocoModel, robot: Robot) -> str:
    """Return `same` where bodies stand in the same places at random joint values, with the same masses."""
    heavy = sum(float(mass) for mass in model.body_mass if mass > 1e-6)
    if abs(heavy - sum(mass.mass for mass in robot.masses)) > 1e-9 * max(heavy, 1.0):
        return "other masses"
    variables = {joint.name: joint.variable for joint in robot.joints}
    called = {at: model.joint(at).name or f"joint_{at}" for at in range(model.njnt)}
    names = {variables.get(name) or name: at for at, name in called.items()}
    data, worst, rng = mujoco.MjData(model), 0.0, np.random.default_rng(0)
    for _ in range(5):
        full = again.at({one.name: float(rng.uniform(-0.5, 0.5)) for one in robot.actuated})
        again._lead_followers(full)
        data.qpos[:] = model.qpos0
        for name, at in names.items():
            there = mujoco.mj_name2id(again.model, mujoco.mjtObj.mjOBJ_JOINT, name)
            if there >= 0 and model.jnt_type[at] >= 2:
                data.qpos[model.jnt_qposadr[at]] = full[again.model.jnt_qposadr[there]]
        mujoco.mj_kinematics(model, data)
        for number in range(1, model.nbody):
            name = model.body(number).name or f"body {number}"
            if mujoco.mj_name2id(again.model, mujoco.mjtObj.mjOBJ_SITE, name) >= 0:
                position, rotation = again.site_pose(name, full)
                worst = max(worst, np.abs(position - data.xpos[number]).max())
                worst = max(worst, np.abs(rotation - data.xmat[number].reshape(3, 3)).max())
    return "same" if worst < 1e-9 else f"apart by {worst:.0e}"


def main() -> None:
    """Print the tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    console = Console(width=170)
    first = table(
        f"MuJoCo, {count} postures: difference of positions and of rotations, median/largest",
        *(
            "robot",
            "weight, load/10 (1e-3)",
            "weight, nominal (1e-2)",
            "load/10, weightless",
            "nominal, weightless",
        ),
    )
    for name, robot, load in robots():
        first.add_row(name, *in_mujoco(robot, load, count))
    arms = [in_arm(seed) for seed in range(count)]
    first.add_row(f"{count} random arms, a posture each", *map(summed, zip(*arms, strict=True)))
    console.print(first)
    for name, robot, load in robots():
        if assemble(robot).varies:
            rows = loads(robot, 0.1 * load, count)
            once = mujoco_deflection(robot, rows, anew=False)[0]
            off = relative(predict_displacements(robot, rows, True), once)[0]
            ends = ", ".join(f"{value:.1%}" for value in np.percentile(off, [10, 50, 90, 100]))
            console.print(
                f"{name}, one model for {len(rows)} postures: off by {ends} (10, 50, 90 %, largest)"
            )
    second = table(
        f"{count} random structures of all kinds of parts, with loops: positions, of the deflection",
        *("load", "median", "90 %", "largest", "below 1e-3", "no equilibrium", "seeds not below 1e-3"),
    )
    rows = {
        "1e-3 N, weightless": Load(1e-3, 0.0),
        "0.1 N, weight/10": Load(0.1, 0.1),
        "1 N, weight": Load(),
        "1 N, weight, beams of 4": Load(pieces=4),
        "1 N, weight, beams of 4, ours": Load(pieces=4, ours_too=True),
    }
    for what, load_of in rows.items():
        by_seed = structures(count, load_of)
        errors = np.array([*by_seed.values()])
        found = errors[np.isfinite(errors)]
        worst = [f"{seed}: {error:.1e}" for seed, error in by_seed.items() if error >= 1e-3]
        second.add_row(
            what,
            *(f"{value:.0e}" for value in np.percentile(found, [50, 90, 100])),
            str((errors < 1e-3).sum()),
            str(len(errors) - len(found)),
            ", ".join(worst),
        )
    console.print(second)
    for seed in WORST:
        pieces = ", ".join(f"{Load(pieces=count).error(seed):.1e}" for count in (2, 4, 8))
        ours = ", ".join(f"{Load(pieces=count, ours_too=True).error(seed):.1e}" for count in (2, 4, 8))
        back, mean = reversed_hinges(seed)
        console.print(
            f"seed {seed}: {Load().error(seed):.1e}, at a tenth {Load(0.1, 0.1).error(seed):.1e}; 2, 4, 8 "
            f"pieces a beam: MuJoCo {pieces}, ours moves by {ours}; free hinges in reverse order {back:.1e}, "
            f"mean of both orders {mean:.1e}"
        )
    for engine_name, make, wheel in (("Pinocchio", in_pinocchio, "pin"), ("Drake", in_drake, "drake")):
        try:
            console.print(second_engine(engine_name, make, count))
        except ImportError:
            console.print(f"{engine_name} is not installed (pip install {wheel}): skipped")
    third = table(
        "Effects over a load cycle, of the range of the curve: what each adds, and the difference (2 %)",
        *("effect", "position", "differs", "rotation", "differs"),
    )
    for row in effects():
        third.add_row(*row)
    console.print(third)
    if folder := os.environ.get("MJCF"):
        found = [*round_trips(Path(folder))]
        for what, times in Counter(what for _, what in found).most_common():
            console.print(f"{times} of {len(found)} MJCF files: {what}")


def in_arm(seed: int) -> list[tuple[float, float]]:
    """Return the errors of a random arm in one posture, with weight, then without, at shares of the load."""
    robot, load = random_robot(seed)
    found = []
    for machine in (robot, weightless(robot)):
        for share in SHARES:
            rows = loads(machine, share * load, 1, seed)
            one = relative(predict_displacements(machine, rows, True), mujoco_deflection(machine, rows)[0])
            found.append((float(one[0][0]), float(one[1][0])))
    return found


def summed(pairs: tuple[tuple[float, float], ...]) -> str:
    """Return median and largest of positions and of rotations."""
    return " ".join(f"{np.median(one):.0e}/{max(one):.0e}" for one in zip(*pairs, strict=True))


if __name__ == "__main__":
    main()
