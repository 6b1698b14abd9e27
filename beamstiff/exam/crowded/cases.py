"""Crowded machines drawn at random: geometry, effects of falling size, campaign, and the label of it all."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.cases import GRAVITY, dealt
from beamstiff.exam.crowded.record import CrowdedLabel, Kind, TrueCause
from beamstiff.exam.designs import Data, draw_crowded, largest_force
from beamstiff.exam.effect import places_of
from beamstiff.exam.forms import OUTSIDE, author_of, came_to_rest, draw_truth, resized
from beamstiff.exam.machine import machine_of
from beamstiff.exam.names import EFFECTS, LATER
from beamstiff.exam.parameters import between, unit_vector
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.exam.record import sha256
from beamstiff.exam.robots import RANDOM_ARM, exam_robot, with_payload, with_stiff_drive
from beamstiff.exam.rotations import turn
from beamstiff.exam.simulate import draw_stiffness, read, reality_of, simulate, solve
from beamstiff.exam.sizes import linear_fit, size_for, true_rows, without_noise
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Node, Rigid
from beamstiff.robot.writer import robot_to_yaml

SHARES: Mapping[Kind, int] = {"crowded": 24, "outside": 6, "geometry": 5, "clean": 5}
ROBOTS = {RANDOM_ARM: 0.6, "kr240-2": 0.25, "kr500": 0.15}  # serial ones, whose whole geometry may be off
ABSOLUTE = 0.8  # share of the campaigns; geometry shows in no other
# what a calibration takes up in any case, and what is no effect
NOT_DRAWN = ("geometry-error", "tool-offset", "frame-misalignment", "outliers")
INSIDE = (*(name for name in EFFECTS if name not in NOT_DRAWN), *LATER)
BEYOND = tuple(effect.name for effect in OUTSIDE)
BY_ANGLE = ("angle-curve", "gravity-compensator")
LARGEST = (0.3e-3, 2e-3)  # m, RMS that the largest effect contributes
FALLS = (0.4, 0.8)  # to which share of it the next one
MET = (0.6, 1.7)  # of the contribution that is wanted, between which an effect is taken
FEWEST, MOST = 3, 6  # effects
DRAWS, TRIES = 8, 20  # of an effect, of a case
HIDDEN = 0.03  # share of the gap below which, or below the noise, an effect is hidden
LENGTHS, ANGLES = (1e-4, 5e-4), (5e-4, 3e-3)  # m and rad, by which the geometry is off
REFLECTORS = ("r1", "r2", "r3")
SINGLE = 0.7  # share of absolute campaigns with one of them
STALKS = (0.03, 0.1)  # m, from the TCP to a reflector
GUESSED = (2e-3, 2e-2)  # m, by which its place is off
FRAMED = 0.5  # share of absolute tables in a measuring frame of its own
STEP = 1e-4  # rad or m, of central differences
INDEPENDENT = 1e-6  # singular value of unit columns below which a direction is none


@dataclass(frozen=True)
class CrowdedExam:
    """What the exam draws its cases from; the same exam draws the same cases."""

    seed: int
    shares: Mapping[Kind, int] = field(default_factory=lambda: dict(SHARES))
    robots: Mapping[str, float] = field(default_factory=lambda: dict(ROBOTS))  # with the share of each
    absolute: float = ABSOLUTE  # share of the campaigns
    count: tuple[int, int] = (FEWEST, MOST)  # fewest effects, and most
    authors: tuple[int, ...] = ()  # whose forms the effects have; all by default
    robot: Robot | None = None  # one robot instead of those by name

    def settings(self) -> dict[str, Any]:
        """Return what the cases depend on, as plain data."""
        drawn = {
            **asdict(replace(self, robot=None)),
            "count": list(self.count),
            "authors": list(self.authors),
        }
        if self.robot is not None:
            drawn |= {"robots": {self.robot.name: 1.0}, "robot": sha256(robot_to_yaml(self.robot))}
        return {"crowded": True, **drawn}


@dataclass(frozen=True, eq=False)
class CrowdedCase:
    """A drawn case."""

    label: CrowdedLabel
    robot: Robot  # the model that is diagnosed
    machine: Robot  # the same with its true stiffness and reflectors
    geometry: tuple[Truth, ...]  # by what it is off
    truths: tuple[Truth, ...]  # the effects, as the label orders them
    campaign: SimulatedCampaign  # what is measured
    fresh: SimulatedCampaign  # the new poses
    frame: Array  # (6,): rad and m; rotation vector and origin of the base in the measuring frame
    gap: Array  # (3N,): m; what the best geometry and compliances leave of the noise-free rows
    parts: Array  # (3N, c): m; what leaving each effect out changes of it

    def measured(self, rng: np.random.Generator) -> Measurements:
        """Return the table of the campaign, in its measuring frame."""
        rows = simulate(self.machine, (*self.geometry, *self.truths), self.campaign, rng)
        if rows.kind != "absolute":
            return rows
        return replace(rows, position=rows.position @ turn(self.frame[:3]).T + self.frame[3:])

    def fresh_positions(self) -> Array:
        """Return what the fresh rows are, without noise, in the base frame, (M, 3), m."""
        truths = [
            came_to_rest(one, self.campaign) if one.effect == "target-slip" else one for one in self.truths
        ]
        return true_rows(self.machine, (*self.geometry, *truths), self.fresh)[:, :3]

    def left_by(self, causes: Sequence[TrueCause]) -> float:
        """Return the RMS, m, of what is left without noise once these effects are fitted."""
        at = [self.label.causes.index(cause) for cause in causes]
        return _rms(_beyond(self.gap, _basis(self.parts[:, at])))


def draw_crowded_case(exam: CrowdedExam, case: int) -> CrowdedCase:
    """Return a case, from the generator of ``[seed, case, 3]`` alone.

    Raises BeamstiffError when no machine was found that has enough effects.
    """
    rng = np.random.default_rng([exam.seed, case, 3])
    kind, _ = dealt(exam.seed, exam.shares, case)
    why = ""
    for _ in range(TRIES):
        try:
            return _drawn(exam, rng, case, kind)
        except BeamstiffError as error:  # a pose that does not come to rest, too few effects that show
            why = str(error)
    raise BeamstiffError(f"exam: case {case}: {why}")


def _drawn(exam: CrowdedExam, rng: np.random.Generator, case: int, kind: Kind) -> CrowdedCase:
    robot = exam.robot
    if robot is None:
        robot = exam_robot(str(rng.choice(list(exam.robots), p=list(exam.robots.values()))), rng)
    for _ in range(int(rng.integers(0, 5)) if rng.random() < 0.6 else 0):
        robot = with_stiff_drive(robot, rng)
    force = largest_force(robot, rng)
    mass = rng.uniform(0.2, 0.7) * force / GRAVITY
    robot = with_payload(robot, float(mass), tuple(rng.uniform(-0.1, 0.1, 3).tolist()))
    absolute = kind == "geometry" or rng.random() < exam.absolute
    machine = robot
    points: tuple[str, ...] = (robot.tcp,)
    if absolute:
        points = REFLECTORS[: 1 if rng.random() < SINGLE else len(REFLECTORS)]
        robot, machine = _with_reflectors(rng, robot, points)
    data: Data = "absolute" if absolute else "displacement"
    campaign, fresh = draw_crowded(rng, robot, data, force, points)
    machine = machine.with_parameters(draw_stiffness(rng, robot))
    geometry = _draw_geometry(rng, robot) if absolute and kind != "clean" else ()
    frame = np.zeros(6)
    if absolute and rng.random() < FRAMED:
        frame = np.concatenate([rng.uniform(-1.5, 1.5, 3), rng.uniform(-2.0, 2.0, 3)])
    basis = open_basis(robot, machine, campaign)
    noise_free = without_noise(campaign)
    start = solve(reality_of(machine, geometry), noise_free)

    def rows(some: Sequence[Truth]) -> Array:
        reality = reality_of(machine, (*geometry, *some))
        solved = solve(reality, noise_free, start=start) if some else start
        return _beyond(read(reality, noise_free, solved)[:, :3].reshape(-1), basis)

    truths: list[Truth] = []
    if kind in ("crowded", "outside"):
        truths = _draw_effects(rng, robot, rows, kind == "outside", exam)
    every, nothing = rows(truths), rows(())
    parts = np.zeros((len(every), len(truths)))
    for k in range(len(truths)):
        parts[:, k] = every - rows([*truths[:k], *truths[k + 1 :]])
    gap = every - nothing
    if not (np.isfinite(gap).all() and np.isfinite(parts).all()):
        raise BeamstiffError("without one of its effects the machine does not come to rest")
    order, closes = in_order(gap, parts)
    parts, truths = parts[:, order], [truths[k] for k in order]
    noise = np.sqrt(3.0) * campaign.sigma_position
    causes = tuple(
        TrueCause(
            key=truth.label,
            form=truth.form,
            author=author_of(truth),
            accept=_same_by_another_name(robot, truth),
            outside=truth.effect in BEYOND,
            contribution_mm=round(1e3 * _rms(part), 4),
            closes=round(share, 4),
            hidden=bool(share < HIDDEN or _rms(part) < noise),
        )
        for truth, part, share in zip(truths, parts.T, closes, strict=True)
    )
    if kind == "outside" and not causes[0].outside:
        raise BeamstiffError("the effect outside the library is not the largest")
    library = parts[:, [not cause.outside for cause in causes]]
    label = CrowdedLabel(
        case=case,
        kind=kind,
        robot=robot.name,
        data=campaign.kind,
        poses=len(np.unique(campaign.pose)),
        rows=len(campaign),
        causes=causes,
        noise_mm=round(1e3 * float(noise), 4),
        gap_mm=round(1e3 * _rms(gap), 4),
        remainder_mm=round(1e3 * _rms(_beyond(gap, _basis(library))), 4),
    )
    return CrowdedCase(
        label, robot, machine, tuple(geometry), tuple(truths), campaign, fresh, frame, gap, parts
    )


def _same_by_another_name(robot: Robot, truth: Truth) -> tuple[str, ...]:
    """Return other names that mean the same: torques by the angle; what stands on the ground is the base."""
    if truth.effect in BY_ANGLE:
        return tuple(f"{name}:{truth.component}" for name in BY_ANGLE if name != truth.effect)
    if truth.effect != "base-compliance":
        return ()
    ground = {node.name for node in robot.nodes if node.frame == "base"}
    return tuple(f"link-bending:{rigid.name}" for rigid in robot.rigids if ground.issuperset(rigid.nodes))


def _with_reflectors(rng: np.random.Generator, robot: Robot, names: Sequence[str]) -> tuple[Robot, Robot]:
    """Return the robot with reflectors on stalks at the TCP where they are guessed, and where they are."""
    tcp = next(node for node in robot.nodes if node.name == robot.tcp)
    true = [np.array(tcp.at) + rng.uniform(*STALKS) * unit_vector(rng) for _ in names]
    guess = [at + between(rng.random(), *GUESSED) * unit_vector(rng) for at in true]

    def with_nodes(places: Sequence[Array]) -> Robot:
        pairs = zip(names, places, strict=True)
        nodes = [Node(name=name, frame=tcp.frame, at=tuple(at.tolist())) for name, at in pairs]
        stalks = [Rigid(name=f"stalk_{name}", nodes=(robot.tcp, name)) for name in names]
        parts = {"nodes": (*robot.nodes, *nodes), "rigids": (*robot.rigids, *stalks)}
        return robot.model_copy(update=parts)

    return with_nodes(guess), with_nodes(true)


def _draw_geometry(rng: np.random.Generator, robot: Robot) -> tuple[Truth, ...]:
    """Return by what the lengths and angles of the axes, and their zeros, are off."""
    scale = {"length": between(rng.random(), *LENGTHS), "angle": between(rng.random(), *ANGLES)}
    errors = {
        name: float(scale[kind] * rng.standard_normal()) for name, kind in _open_parameters(robot).items()
    }
    return tuple(Truth("geometry-error", name, "single", {"error": by}) for name, by in errors.items())


def _open_parameters(robot: Robot) -> dict[str, str]:
    """Return zeros and frame parameters of the moving axes by name: whether angle or length."""
    found = {variable.name: variable.kind for variable in robot.actuated}
    for name, _, parameters in skeleton_of(robot).frames:
        if any(expression.coefficients for expression in parameters.values()):
            found |= {f"{name}.alpha": "angle", f"{name}.d": "length", f"{name}.r": "length"}
    return {name: kind for name, kind in found.items() if _closes(robot, name)}


def _closes(robot: Robot, name: str) -> bool:
    """Return whether loops close with an error of a parameter: tilted axes would lock rigid bearings."""
    if not robot.loops:
        return True
    middle = np.array([[sum(item.limits) / 2.0 if item.limits else 0.0 for item in robot.actuated]])
    try:
        place(skeleton_of(robot, {name: STEP}), middle, {name: STEP})
    except BeamstiffError:
        return False
    return True


def open_basis(robot: Robot, machine: Robot, campaign: SimulatedCampaign) -> Array:
    """Return an orthonormal basis (3N, k) of what is fitted in any case, in the positions.

    Compliances; of absolute positions also zeros, frame parameters with Hayati's, base frame and reflector.
    """
    columns = [*np.moveaxis(linear_fit(robot, machine, campaign).basis[:, :3], -1, 0)]
    if campaign.kind == "absolute":
        body = machine_of(robot)
        hayati = (f"{frame.name}.beta" for frame in robot.frames)
        names = [*_open_parameters(robot), *(name for name in hayati if _closes(robot, name))]
        for name in names:
            ends = [
                places_of(body, campaign.point, place(skeleton_of(robot, {name: by}), campaign.q, {name: by}))
                for by in (STEP, -STEP)
            ]
            columns.append((ends[0] - ends[1]) / (2.0 * STEP))
        placed = place(skeleton_of(robot), campaign.q)
        at, axes = places_of(body, campaign.point, placed), placed.rotations[body.node(body.tcp).frame]
        for unit in np.eye(3):
            columns += [np.tile(unit, (len(at), 1)), np.cross(unit, at)]
            columns += [axes @ unit * (campaign.point == name)[:, None] for name in np.unique(campaign.point)]
    flat = np.stack([column.reshape(-1) for column in columns], axis=1)
    return _basis(flat)


def in_order(gap: Array, parts: Array) -> tuple[list[int], list[float]]:
    """Return parts (n, c) in the order in which taking one away closes most, and the share each closes.

    Each as large as it is: sizes that are fitted would let an effect stand in for another that looks like it.
    """
    order: list[int] = []
    left, squares = gap, [float(gap @ gap)]
    while len(order) < parts.shape[1]:
        rest = {k: float(np.square(left - part).sum()) for k, part in enumerate(parts.T) if k not in order}
        order.append(min(rest, key=rest.__getitem__))
        left = left - parts[:, order[-1]]
        squares.append(rest[order[-1]])
    return order, [(before - after) / (squares[0] or 1.0) for before, after in pairwise(squares)]


Rows = Callable[[Sequence[Truth]], Array]  # what a machine with some effects reads


def _draw_effects(
    rng: np.random.Generator, robot: Robot, rows: Rows, outside: bool, exam: CrowdedExam
) -> list[Truth]:
    """Return effects, each at a place of its own, the largest first."""
    still = rows(())

    def contribution(truth_of: Callable[[float], Truth], size: float) -> float:
        try:
            return _rms(rows((truth_of(size),)) - still)
        except BeamstiffError:  # so large that the machine buckles under it
            return float("inf")

    found: list[Truth] = []
    wanted = between(rng.random(), *LARGEST)
    for at in range(int(rng.integers(exam.count[0], exam.count[1] + 1))):
        effects = BEYOND if outside and at == 0 else INSIDE
        for _ in range(DRAWS):
            seed, effect = int(rng.integers(2**31)), effects[int(rng.integers(len(effects)))]
            try:
                truth = draw_truth(rng, robot, effect, 0.5, authors=exam.authors)
            except BeamstiffError:  # this robot cannot have it
                continue
            if (truth.component or effect) in [one.component or one.effect for one in found]:
                continue
            truth_of = partial(resized, truth, robot, seed=seed)
            size, reached = size_for(partial(contribution, truth_of), wanted)
            if MET[0] <= reached / wanted <= MET[1]:
                found.append(truth_of(size))
                break
        if not found:
            raise BeamstiffError("no effect is large enough to be the largest")
        wanted *= rng.uniform(*FALLS)
    if len(found) < exam.count[0]:
        raise BeamstiffError(f"only {len(found)} effects show")
    return found


def _basis(columns: Array) -> Array:
    """Return an orthonormal basis (n, k) of columns (n, c)."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns / np.where(size > 0, size, 1.0), full_matrices=False)
    return np.asarray(left[:, values > INDEPENDENT])


def _beyond(values: Array, basis: Array) -> Array:
    """Return the part of values (n,) that a basis (n, k) does not span."""
    return np.asarray(values - basis @ (basis.T @ values))


def _rms(values: Array) -> float:
    """Return the RMS norm of positions (3N,)."""
    return float(np.sqrt(3.0 * np.mean(np.square(values)))) if values.size else 0.0
