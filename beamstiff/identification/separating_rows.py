"""What further measurement would distinguish springs identifiable only in combination, if any would.

Candidate rows are added to those measured, and it is seen whether the group dissolves: rotations read as
well, forces and moments at the tool along and about each axis, other postures, and at last the displacement
of other points of the machine. Each candidate also says how well it would tell: the standard deviation that
is expected of the worst of the springs, with the noise of the table.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.fem.unknowns import turning_nodes
from beamstiff.identification.degeneracy import Degeneracy, find_degeneracy
from beamstiff.identification.information import invert
from beamstiff.identification.problem import Components, Problem, build_problem
from beamstiff.identification.result import Identification
from beamstiff.measure.arrays import Integers
from beamstiff.measure.rows import concatenate, subset
from beamstiff.measure.table import Measurements
from beamstiff.robot.closure import close_loops
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.se3 import Array

MOST_ROWS = 60  # of the measured ones that are looked at: what a group is made of shows in a few
POSES = 20  # of a candidate
ROTATION_LENGTH = 0.25  # m, of the force that makes a moment
REFLECTORS = 0.5  # m, their distance: by it the noise of a rotation follows from that of a position
AXES = ("x", "y", "z")
GOOD = 0.5  # relative standard deviation below which a value is bounded on both sides


@dataclass(frozen=True)
class Separation:
    """A measurement that tells parameters apart."""

    measure: str  # what to measure, in words
    # what is known then: single parameters, and those that still act together only
    parts: tuple[tuple[str, ...], ...]
    # expected relative standard deviation of the worst of the single ones, at the values at hand; NaN where
    # the table states no noise
    std: float

    @property
    def complete(self) -> bool:
        """Whether every parameter is known by itself."""
        return all(len(part) == 1 for part in self.parts)


def find_separations(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    groups: Sequence[Sequence[str]],
    parameters: Sequence[str] | None = None,
    components: Components = "both",
    stiffness: Array | None = None,
    seed: int = 0,
) -> tuple[tuple[Separation, ...], ...]:
    """Return for each group the measurements that distinguish its members, the best first.

    `measurements`: what was measured. `groups`: parameters identifiable only in combination; or one that is
    never loaded. `parameters`: all that are identified; default ``robot.identify``. `components`: what counts
    of the measured rows. `stiffness` (m,): values at which to judge how well; default the robot's. `seed`: of
    other postures.
    """
    table = concatenate(measurements)
    table = subset(table, _spread(len(table), MOST_ROWS))
    noise_known = bool(np.isfinite(table.sigma).any())
    found: list[list[Separation]] = [[] for _ in groups]
    for stage in (_at_the_tool, _elsewhere):
        open_groups = [at for at, some in enumerate(found) if not any(one.complete for one in some)]
        if not open_groups:
            break
        for measure, rows in stage(robot, table, components, seed):
            try:
                problem = _stated(robot, table, rows, parameters, components)
                degeneracy = find_degeneracy(problem)
                spread = expected_spread(problem, degeneracy, stiffness)
            except (BeamstiffError, FloatingPointError):
                continue  # a moment on a node without rotation, a posture at which a loop is singular
            names = problem.model.parameters
            for at in open_groups:
                parts = _parts(groups[at], degeneracy)
                if parts is not None and (len(parts) > 1 or len(groups[at]) == 1):
                    alone = [names.index(part[0]) for part in parts if len(part) == 1]
                    std = float(spread[alone].max(initial=0.0)) if noise_known else np.nan
                    found[at].append(Separation(measure, parts, std))

    def worth(one: Separation) -> tuple[bool, int, float]:  # the best has least
        return not one.complete, -len(one.parts), one.std

    return tuple(tuple(sorted(some, key=worth)) for some in found)


def separation_text(group: Sequence[str], found: Sequence[Separation]) -> str:
    """Return in words what to measure so that a group is identified, from `find_separations`.

    >>> way = Separation("forces along y at the tool", (("a",), ("b", "c")), 0.1)
    >>> separation_text(["a", "b", "c"], [way])
    'to identify some of them, measure forces along y at the tool (expected std 10 %); b and c stay combined'
    >>> separation_text(["a"], [])
    'no load on the tool, posture or additional reading identifies it'
    """
    it = "it" if len(group) == 1 else "them"
    if not found:
        return f"no load on the tool, posture or additional reading identifies {it}"
    best = found[0]
    combined = [" and ".join(part) for part in best.parts if len(part) > 1]
    if len(group) == 1 and combined:
        return f"{best.measure} loads it, but only combined with others: {combined[0]}"
    some = it if len(group) == 1 or best.complete else "some of them"
    text = f"to identify {some}, measure {best.measure}"
    if best.std > GOOD:
        text += " with less noise than this"
    elif best.std > 0:
        text += f" (expected std {100 * best.std:.2g} %)"
    return "; ".join([text, *(f"{names} stay combined" for names in combined)])


def with_separations(
    found: Identification,
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    components: Components = "both",
    seed: int = 0,
) -> Identification:
    """Return an identification of a robot and rows that says what would distinguish what it could not."""
    groups = {item.parameters: "" for item in (*found.degenerate, *found.ill_determined)}
    groups |= {(item.name,): "" for item in found.parameters if item.silent}
    if not groups:
        return found
    names = [item.name for item in found.parameters]
    ways = find_separations(
        robot, measurements, list(groups), names, components, stiffness=found.stiffness, seed=seed
    )
    text = {group: separation_text(group, some) for group, some in zip(groups, ways, strict=True)}
    return replace(
        found,
        degenerate=tuple(replace(item, separate=text[item.parameters]) for item in found.degenerate),
        ill_determined=tuple(replace(item, separate=text[item.parameters]) for item in found.ill_determined),
        parameters=tuple(
            replace(item, separate=text.get((item.name,), item.separate)) for item in found.parameters
        ),
    )


Candidate = tuple[str, Measurements]


def _at_the_tool(robot: Robot, table: Measurements, components: Components, seed: int) -> Iterator[Candidate]:
    """Yield rotations, loads at the tool, and postures."""
    force = (
        float(np.abs(table.wrench[:, :3]).max()) or float(np.abs(table.wrench[:, 3:]).max()) / ROTATION_LENGTH
    )
    moment = float(np.abs(table.wrench[:, 3:]).max()) or force * ROTATION_LENGTH
    size = np.repeat([force, moment], 3)
    firsts = np.unique(table.pose, return_index=True)[1].astype(np.int64)
    poses = firsts[_spread(len(firsts), POSES)]  # a row of each of some poses
    turns = bool(table.measured_mask[:, 3:].any()) and components != "position"
    if not turns:
        yield "the rotation of the tool under the same loads", _rotations(table)
    other = _other_poses(robot, seed)
    if other is not None:
        loads = table.wrench[np.unique(table.wrench, axis=0, return_index=True)[1]][:6]
        rows = subset(table, np.zeros(len(other) * len(loads), dtype=np.int64))
        q, wrench = np.repeat(other, len(loads), axis=0), np.tile(loads, (len(other), 1))
        rows = _unmeasured(robot, rows, wrench, q)
        yield "other postures under the same loads", rows
        if not turns:
            yield "other postures under the same loads, with the tool's rotation read too", _rotations(rows)
    for at in range(6):
        if at >= 3 and robot.tcp not in turning_nodes(robot):
            continue
        wrench = np.zeros((len(poses), 6))
        wrench[:, at] = size[at]
        way = f"forces along {AXES[at]}" if at < 3 else f"moments about {AXES[at - 3]}"
        rows = _unmeasured(robot, subset(table, poses), wrench)
        yield f"{way} at the tool", rows
        if not turns:
            yield f"{way} at the tool, with its rotation read too", _rotations(rows)


def _elsewhere(robot: Robot, table: Measurements, _: Components, __: int) -> Iterator[Candidate]:
    """Yield the displacements of other points under the same loads."""
    for node in robot.nodes:
        if node.name not in robot.fixed and node.name != robot.tcp:
            rows = _unmeasured(robot, table, table.wrench)
            there = np.full(len(table), node.name)
            rows = replace(rows, point=there, load_point=table.load_point)
            yield f"the displacement of {node.name} under the same loads", rows


def _unmeasured(robot: Robot, rows: Measurements, wrench: Array, q: Array | None = None) -> Measurements:
    """Return rows of another load at the tool, read there as the others are; what they say does not count."""
    tip = np.full(len(rows), robot.tcp)
    turned = np.where(rows.measured_mask[:, 3:].any(), 0.0, np.nan)
    return replace(
        rows,
        q=rows.q if q is None else q,
        point=tip,
        load_point=tip,
        wrench=wrench,
        displacement=np.tile(np.concatenate([np.zeros(3), np.full(3, turned)]), (len(rows), 1)),
        pose=np.arange(len(rows)),
        sigma=np.tile(_noise(rows), (len(rows), 1)),
    )


def _rotations(rows: Measurements) -> Measurements:
    return replace(
        rows,
        displacement=np.zeros((len(rows), 6)),
        sigma=np.tile(_noise(rows), (len(rows), 1)),
        pose=np.arange(len(rows)),
    )


def _noise(table: Measurements) -> Array:
    """Return the standard deviations (6,) of a further reading: as stated, a rotation's from a position's."""
    known = np.where(np.isfinite(table.sigma), table.sigma, np.inf).min(axis=0)
    position, rotation = float(known[:3].min()), float(known[3:].min())
    if not np.isfinite(position):
        position = rotation * REFLECTORS if np.isfinite(rotation) else np.nan
    return np.repeat([position, rotation if np.isfinite(rotation) else position / REFLECTORS], 3)


def _stated(
    robot: Robot,
    table: Measurements,
    rows: Measurements,
    parameters: Sequence[str] | None,
    components: Components,
) -> Problem:
    """Return the problem of measured rows and further ones."""
    mask = np.ones(6, dtype=np.bool_)
    mask[3:], mask[:3] = components != "position", components != "rotation"
    own = replace(table, displacement=np.where(mask & np.isfinite(table.sigma), table.displacement, np.nan))
    if not np.isfinite(table.sigma).any():  # all count alike, as in the identification
        own = replace(table, displacement=np.where(mask, table.displacement, np.nan), sigma=_alike(table))
        rows = replace(rows, sigma=_alike(rows))
    return build_problem(robot, [own, rows], parameters)


def _alike(rows: Measurements) -> Array:
    return np.tile(np.repeat([1e-5, 1e-5 / REFLECTORS], 3), (len(rows), 1))


def _parts(group: Sequence[str], found: Degeneracy) -> tuple[tuple[str, ...], ...] | None:
    """Return what still acts together only, of the members and others; None if one is never loaded."""
    if {item.name for item in found.silent} & set(group):
        return None
    together_only = [*(one.members for one in found.joined), *(one.members for one in found.mixed)]
    left, parts = list(group), []
    while left:
        together = next((some for some in together_only if left[0] in some), (left[0],))
        parts.append(together)
        left = [name for name in left if name not in together]
    return tuple(parts)


def expected_spread(problem: Problem, found: Degeneracy, stiffness: Array | None = None) -> Array:
    """Return the relative standard deviations (m,) that are expected of stiffness values.

    `problem`: its readings do not matter. `found`: of it. Of a group the first spring stands for all, the
    others are held; what is silent is infinite. `stiffness` (m,): where; default the robot's values.
    """
    values = problem.model.start if stiffness is None else stiffness
    _, slopes = problem.jacobian(values)
    lost = {item.name for item in found.silent}
    lost |= {name for one in found.joined for name in one.members[1:]}
    lost |= {name for one in found.mixed for name in one.held}
    kept = [at for at, name in enumerate(problem.model.parameters) if name not in lost]
    result = np.full(len(values), np.inf)
    result[kept] = np.sqrt(np.diagonal(invert(slopes[:, kept].T @ slopes[:, kept])))
    return result


def _spread(count: int, most: int) -> Integers:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _other_poses(robot: Robot, seed: int) -> Array | None:
    """Return postures within the limits whose loops close, (P, A); None where there are hardly any."""
    ends = [
        variable.limits or ((-np.pi, np.pi) if variable.kind == "angle" else (0.0, 0.0))
        for variable in robot.actuated
    ]
    if not ends:
        return None
    low, high = np.array(ends, dtype=np.float64).T
    drawn = np.random.default_rng(seed).uniform(low, high, (4 * POSES, len(ends)))
    closed = drawn[close_loops(compile_kinematics(robot), drawn, strict=False).closed]
    return closed[:POSES] if len(closed) else None
