"""Equilibrium of the deformed machine: Newton's method on displacements, rotations and holding forces.

Unknowns are the displacement and spin of every body and one multiplier a rigid direction. Rotations are
updated on the rotation group. The tangent is complete but for terms of second order in the relative rotation
of a spring, so that corrections shrink by orders of magnitude a step.
"""

import dataclasses
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, Integers
from beamstiff.exam.laws import Law, Memory, Situation
from beamstiff.exam.layout import Layout, Topology
from beamstiff.exam.machine import Cross, Mesh, Weight
from beamstiff.exam.rotations import cross, cross_matrix, turn
from beamstiff.exam.strain import State, Strain, Tangent, add_stiffness, resisting, strain_of

STILL = 1e-11  # m or rad: largest correction of the last step
SMALL = 1e-5  # m or rad: corrections from which the next one is foreseen
ROUNDING = 1e-17  # m or rad: a correction that is foreseen to be smaller is not made
MOST = 60
RAMP = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
HOLD_SCALE = 1e7  # N/m: makes rows of rigid directions as large as those of springs
SLACK = 1e-10  # against redundant rigid directions, of the scaled system

Weighted = tuple[tuple[int, Weight], ...]


@dataclass(frozen=True, eq=False)
class Load:
    """What acts on the machine besides its weight; P states."""

    body: Integers  # (P,)
    arm: Array  # (P, 3): m; point of action from the body's reference point, before the body turns
    wrench: Array  # (P, 6): N and N m; keeps its direction


@dataclass(frozen=True, eq=False)
class Rows:
    """What the rows of the strains are: rigid, governed by a law, or linear, alone or with another row.

    A law's strain is a sum of rows, each with its weight: one row but for drives that mesh.
    """

    rigid: NDArray[np.bool_]
    laws: tuple[tuple[Weighted, Law], ...]
    rods: Array
    crosses: tuple[tuple[tuple[int, int], Array], ...]


@dataclass(frozen=True, eq=False)
class Solved:
    """Equilibrium states, the laws' memories after, and the largest unbalanced force of each, (P,), N."""

    state: State
    memory: tuple[Memory, ...]
    unbalanced: Array


def rows_of(topology: Topology) -> Rows:
    """Return what the rows of a machine's strains are."""
    machine = topology.machine
    members = 6 * len(topology.members)
    rigid = np.zeros(members + len(machine.rods), dtype=np.bool_)
    laws: list[tuple[Weighted, Law]] = []
    for at, hinge in enumerate(machine.hinges):
        laws += [(((6 * at + direction, 1.0),), law) for direction, law in hinge.laws.items()]
        if hinge.stiffness.ndim == 1:
            rigid[6 * at : 6 * at + 6] = np.isinf(hinge.stiffness)
    rods = np.zeros(len(machine.rods))
    for at, rod in enumerate(machine.rods):
        if rod.law is not None:
            laws.append((((members + at, 1.0),), rod.law))
        else:
            rigid[members + at] = np.isinf(rod.stiffness)
            rods[at] = 0.0 if np.isinf(rod.stiffness) else rod.stiffness
    rigid[[row for ((row, _),), _ in laws]] = False
    at_of = {hinge.name: at for at, hinge in enumerate(machine.hinges)}

    def places(part: Cross | Mesh) -> tuple[int, int]:
        first, second = (6 * at_of[name] + direction for name, direction in (part.first, part.second))
        return first, second

    laws += [(tuple(zip(places(mesh), mesh.weights, strict=True)), mesh.law) for mesh in machine.meshes]
    return Rows(rigid, tuple(laws), rods, tuple((places(cross), cross.added) for cross in machine.crosses))


def at_rest(topology: Topology, rows: Rows, poses: int) -> State:
    """Return the machine before it deforms."""
    turned = np.tile(np.eye(3), (poses, topology.bodies, 1, 1))
    return State(np.zeros((poses, topology.bodies, 3)), turned, np.zeros((poses, int(rows.rigid.sum()))))


def some(thing: Any, rows: Any) -> Any:
    """Return some of the states of a dataclass of arrays."""
    return type(thing)(*(getattr(thing, f.name)[rows] for f in fields(thing)))


def equilibrium(
    topology: Topology,
    layout: Layout,
    load: Load,
    situation: Situation,
    start: State,
    memory: tuple[Memory, ...],
    *,
    once: bool = False,
) -> Solved:
    """Return the equilibrium under weight and load, from a start that may be another load's equilibrium.

    With `once` Newton's method takes one step only: what a small change of a machine without memory does, to
    first order; what is unbalanced then is not looked at (NaN).

    Raises BeamstiffError when a state does not come to rest: the machine buckles or is a mechanism.
    """
    rows = rows_of(topology)
    state, still = _settle(topology, rows, layout, load, situation, start, memory, 1 if once else MOST)
    if once:
        return Solved(state, memory, np.full(len(still), np.nan))
    lost = np.flatnonzero(~still)
    if len(lost):  # from rest, with weight and load growing
        part, held = layout.at(lost), tuple(tuple(old[lost] for old in one) for one in memory)
        found, standing = at_rest(topology, rows, len(lost)), ~still[lost]
        for share in RAMP:
            light = dataclasses.replace(part, load=share * part.load, load_moment=share * part.load_moment)
            push = Load(load.body[lost], load.arm[lost], share * load.wrench[lost])
            found, standing = _settle(topology, rows, light, push, situation.at(lost), found, held)
        if not standing.all():
            raise BeamstiffError(
                f"{topology.machine.robot.name}: {int((~standing).sum())} of {len(still)} states of the true "
                "machine do not come to rest: it buckles or is a mechanism"
            )
        for old, new in zip((state.moved, state.turned, state.hold), fields(found), strict=True):
            old[lost] = getattr(found, new.name)
    strain = strain_of(topology, layout, state)
    force, _, after = _answer(rows, layout, strain, situation, memory)
    unbalanced = np.abs(_unbalanced(topology, rows, layout, load, state, strain, force)).max(axis=1)
    return Solved(state, after, unbalanced)


def _settle(
    topology: Topology,
    rows: Rows,
    layout: Layout,
    load: Load,
    situation: Situation,
    start: State,
    memory: tuple[Memory, ...],
    most: int = MOST,
) -> tuple[State, NDArray[np.bool_]]:
    """Return where Newton's method ends, and which states have come to rest there."""
    poses = len(start.moved)
    moved, turned, hold = start.moved.copy(), start.turned.copy(), start.hold.copy()
    active = np.arange(poses)
    last, pace = np.full(poses, np.inf), np.ones(poses)
    for iteration in range(most):
        state = State(moved[active], turned[active], hold[active])
        here, push = (layout.at(active), some(load, active)) if len(active) < poses else (layout, load)
        strain = strain_of(topology, here, state)
        kept = tuple(tuple(part[active] for part in old) for old in memory)
        force, tangent, _ = _answer(rows, here, strain, situation.at(active), kept)
        step_body, step_hold = _step(topology, rows, here, push, state, strain, force, tangent)
        size = np.abs(step_body).max(axis=(1, 2))
        if not np.isfinite(size).all() or size.max() > 1e3:
            break
        # where a law's corners make the steps swing to and fro, shorter ones settle
        swings = (size > 0.7 * last[active]) & (iteration > 6)
        pace[active] = np.where(
            swings, np.maximum(0.5 * pace[active], 0.1), np.minimum(2 * pace[active], 1.0)
        )
        part = pace[active][:, None, None] * np.minimum(1.0, 0.3 / np.maximum(size, 1e-300))[:, None, None]
        step_body = part * step_body
        moved[active] += step_body[..., :3]
        turned[active] = turn(step_body[..., 3:]) @ turned[active]
        hold[active] += part[:, :, 0] * step_hold
        # quadratic convergence: the next correction over the square of this one is what this one was over the
        # square of the last; corners of laws come without notice
        sure = (size < SMALL) & np.isfinite(last[active]) & (not rows.laws)
        done = (size <= STILL) | (sure & (size**3 < ROUNDING * last[active] ** 2))
        last[active] = size
        active = active[~done]
        if not len(active):
            break
    still = np.ones(poses, dtype=np.bool_)
    still[active] = False
    return State(moved, turned, hold), still


def _answer(
    rows: Rows, layout: Layout, strain: Strain, situation: Situation, memory: tuple[Memory, ...]
) -> tuple[Array, Tangent, tuple[Memory, ...]]:
    """Return forces (P, M), tangent and the laws' memories for given strains."""
    poses = len(strain.rows)
    tangent = Tangent(layout.stiffness.copy(), np.tile(rows.rods, (poses, 1)), [])
    for pair, added in rows.crosses:
        for i, j in np.ndindex(2, 2):
            tangent.add(pair[i], pair[j], float(added[i, j]))
    force = tangent.force(strain.rows)
    after = []
    for (weights, law), old in zip(rows.laws, memory, strict=True):
        weighted = [(row, weight(situation) if callable(weight) else weight) for row, weight in weights]
        total = sum((weight * strain.rows[:, row] for row, weight in weighted), np.zeros(poses))
        extra, slope, new = law.respond(total, situation, old)
        for row, weight in weighted:
            force[:, row] += weight * extra
            for other, its in weighted:
                tangent.add(row, other, weight * its * slope)
        after.append(new)
    return force, tangent, tuple(after)


def _unbalanced(
    topology: Topology, rows: Rows, layout: Layout, load: Load, state: State, strain: Strain, force: Array
) -> Array:
    """Return what is missing to equilibrium on every body but the ground, (P, 6 (B - 1))."""
    held = force.copy()
    held[:, rows.rigid] = state.hold
    acting = np.zeros((len(force), topology.bodies, 6))
    moments = cross(_turned(state, topology.loads, layout.load_arm), layout.load) + layout.load_moment
    for at, body in enumerate(topology.loads):
        acting[:, body, :3] += layout.load[:, at]
        acting[:, body, 3:] += moments[:, at]
    poses = np.arange(len(force))
    arm = (state.turned[poses, load.body] @ load.arm[..., None])[..., 0]
    acting[poses, load.body] += load.wrench
    acting[poses, load.body, 3:] += cross(arm, load.wrench[:, :3])
    missing: Array = acting.reshape(len(force), -1) - resisting(topology, strain, held)
    return missing[:, 6:]


def _turned(state: State, bodies: Integers, arms: Array) -> Array:
    return (state.turned[:, bodies] @ arms[..., None])[..., 0]


def _step(
    topology: Topology,
    rows: Rows,
    layout: Layout,
    load: Load,
    state: State,
    strain: Strain,
    force: Array,
    tangent: Tangent,
) -> tuple[Array, Array]:
    """Return Newton's corrections of the bodies (P, B, 6) and of the holding forces (P, C)."""
    poses, n = len(force), 6 * topology.bodies
    held = force.copy()
    held[:, rows.rigid] = state.hold
    count = int(rows.rigid.sum())
    system = np.zeros((poses, n + count, n + count))
    add_stiffness(system, topology, layout, state, strain, held, tangent)
    turning = cross_matrix(layout.load) @ cross_matrix(_turned(state, topology.loads, layout.load_arm))
    for at, body in enumerate(topology.loads):
        system[:, 6 * body + 3 : 6 * body + 6, 6 * body + 3 : 6 * body + 6] -= turning[:, at]
    every = np.arange(poses)
    arm = (state.turned[every, load.body] @ load.arm[..., None])[..., 0]
    spin = 6 * load.body[:, None] + np.arange(3, 6)
    turning = cross_matrix(load.wrench[:, :3]) @ cross_matrix(arm)
    system[every[:, None, None], spin[:, :, None], spin[:, None]] -= turning
    for body in np.flatnonzero(topology.locked):
        system[:, 6 * body + 3 : 6 * body + 6, 6 * body + 3 : 6 * body + 6] += HOLD_SCALE * np.eye(3)
    _add_holds(system, topology, rows, strain)
    right = np.concatenate(
        [
            _unbalanced(topology, rows, layout, load, state, strain, force),
            -HOLD_SCALE * strain.rows[:, rows.rigid],
        ],
        axis=1,
    )
    try:
        solution = np.linalg.solve(system[:, 6:, 6:], right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise BeamstiffError(f"{topology.machine.robot.name}: the true machine is a mechanism") from None
    moves = np.zeros((poses, topology.bodies, 6))
    moves[:, 1:] = solution[:, : n - 6].reshape(poses, -1, 6)
    return moves, HOLD_SCALE * solution[:, n - 6 :]


def _add_holds(system: Array, topology: Topology, rows: Rows, strain: Strain) -> None:
    """Add the rows and columns of the rigid directions, after the 6 B of the bodies."""
    n, members = 6 * topology.bodies, 6 * len(topology.members)
    rigid = np.flatnonzero(rows.rigid)
    of_member, of_rod = rigid[rigid < members], rigid[rigid >= members] - members
    ends = np.concatenate([topology.members[of_member // 6], topology.rods[of_rod]])
    rates = np.concatenate(
        [strain.rates[:, of_member // 6, of_member % 6], strain.rod_rates[:, of_rod]], axis=1
    )
    holding = np.arange(n, n + len(rigid))
    for body, some in zip(ends.T, np.split(HOLD_SCALE * rates, 2, axis=2), strict=True):
        system[:, holding[:, None], 6 * body[:, None] + np.arange(6)] += some
    system[:, :n, n:] = np.swapaxes(system[:, n:, :n], -1, -2)
    system[:, holding, holding] = -SLACK * HOLD_SCALE
