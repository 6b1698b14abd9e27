"""Equilibrium of the deformed machine: Newton's method on displacements, rotations and holding forces.

One multiplier holds a rigid direction. Rotations are updated on the rotation group; the tangent lacks terms
of second order in the relative rotation of a spring only.
"""

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, Integers, some
from beamstiff.exam.laws import Law, Memory, Situation
from beamstiff.exam.layout import Layout, Topology
from beamstiff.exam.machine import Cross, Mesh, Weight
from beamstiff.exam.rotations import apply, cross, cross_matrix, turn
from beamstiff.exam.strain import State, Strain, Tangent, add_stiffness, resisting, row_rates, strain_of

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
class Problem:
    """A machine in P states: where it stands, what acts on it, and what its laws remember."""

    topology: Topology
    rows: Rows
    layout: Layout
    load: Load
    situation: Situation
    memory: tuple[Memory, ...] = ()

    def at(self, states: Any) -> Self:
        """Return some of the states."""
        names = ("layout", "load", "situation", "memory")
        return replace(self, **{name: some(getattr(self, name), states) for name in names})

    def lighter(self, share: float) -> Self:
        """Return the machine under a share of its weight and load."""
        layout, load = self.layout, self.load
        weight = replace(layout, load=share * layout.load, load_moment=share * layout.load_moment)
        return replace(self, layout=weight, load=replace(load, wrench=share * load.wrench))

    def at_rest(self) -> State:
        """Return the machine before it deforms."""
        poses, bodies = len(self.load.body), self.topology.bodies
        turned = np.tile(np.eye(3), (poses, bodies, 1, 1))
        return State(np.zeros((poses, bodies, 3)), turned, np.zeros((poses, int(self.rows.rigid.sum()))))


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


def equilibrium(problem: Problem, start: State, *, once: bool = False) -> Solved:
    """Return the equilibrium under weight and load, from a start that may be another load's equilibrium.

    With `once` Newton's method takes one step: to first order; what is unbalanced is not looked at (NaN).

    Raises BeamstiffError when a state does not come to rest: the machine buckles or is a mechanism.
    """
    state, still = _settle(problem, start, 1 if once else MOST)
    if once:
        return Solved(state, problem.memory, np.full(len(still), np.nan))
    lost = np.flatnonzero(~still)
    if len(lost):  # from rest, with weight and load growing
        part = problem.at(lost)
        found, standing = part.at_rest(), ~still[lost]
        for share in RAMP:
            found, standing = _settle(part.lighter(share), found)
        if not standing.all():
            raise BeamstiffError(
                f"{problem.topology.machine.robot.name}: {int((~standing).sum())} of {len(still)} states of "
                "the true machine do not come to rest: it buckles or is a mechanism"
            )
        for field in fields(found):
            getattr(state, field.name)[lost] = getattr(found, field.name)
    strain = strain_of(problem.topology, problem.layout, state)
    force, _, after = _answer(problem, strain)
    return Solved(state, after, np.abs(_unbalanced(problem, state, strain, force)).max(axis=1))


def _settle(problem: Problem, start: State, most: int = MOST) -> tuple[State, NDArray[np.bool_]]:
    """Return where Newton's method ends, and which states have come to rest there."""
    poses = len(start.moved)
    moved, turned, hold = start.moved.copy(), start.turned.copy(), start.hold.copy()
    active = np.arange(poses)
    last, pace = np.full(poses, np.inf), np.ones(poses)
    for iteration in range(most):
        here = problem.at(active) if len(active) < poses else problem
        step_body, step_hold = _step(here, State(moved[active], turned[active], hold[active]))
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
        sure = (size < SMALL) & np.isfinite(last[active]) & (not problem.rows.laws)
        done = (size <= STILL) | (sure & (size**3 < ROUNDING * last[active] ** 2))
        last[active] = size
        active = active[~done]
        if not len(active):
            break
    still = np.ones(poses, dtype=np.bool_)
    still[active] = False
    return State(moved, turned, hold), still


def _answer(problem: Problem, strain: Strain) -> tuple[Array, Tangent, tuple[Memory, ...]]:
    """Return forces (P, M), tangent and the laws' memories for given strains."""
    rows, poses = problem.rows, len(strain.rows)
    tangent = Tangent(problem.layout.stiffness.copy(), np.tile(rows.rods, (poses, 1)), [])
    for pair, added in rows.crosses:
        for i, j in np.ndindex(2, 2):
            tangent.add(pair[i], pair[j], float(added[i, j]))
    force = tangent.force(strain.rows)
    after = []
    for (weights, law), old in zip(rows.laws, problem.memory, strict=True):
        weighted = [
            (row, weight(problem.situation) if callable(weight) else weight) for row, weight in weights
        ]
        total = sum((weight * strain.rows[:, row] for row, weight in weighted), np.zeros(poses))
        extra, slope, new = law.respond(total, problem.situation, old)
        for row, weight in weighted:
            force[:, row] += weight * extra
            for other, its in weighted:
                tangent.add(row, other, weight * its * slope)
        after.append(new)
    return force, tangent, tuple(after)


def _unbalanced(problem: Problem, state: State, strain: Strain, force: Array) -> Array:
    """Return what is missing to equilibrium on every body but the ground, (P, 6 (B - 1))."""
    topology, layout, load = problem.topology, problem.layout, problem.load
    held = force.copy()
    held[:, problem.rows.rigid] = state.hold
    acting = np.zeros((len(force), topology.bodies, 6))
    arms = apply(state.turned[:, topology.loads], layout.load_arm)
    moments = cross(arms, layout.load) + layout.load_moment
    for at, body in enumerate(topology.loads):
        acting[:, body, :3] += layout.load[:, at]
        acting[:, body, 3:] += moments[:, at]
    poses = np.arange(len(force))
    arm = apply(state.turned[poses, load.body], load.arm)
    acting[poses, load.body] += load.wrench
    acting[poses, load.body, 3:] += cross(arm, load.wrench[:, :3])
    missing: Array = acting.reshape(len(force), -1) - resisting(topology, strain, held)
    return missing[:, 6:]


def _step(problem: Problem, state: State) -> tuple[Array, Array]:
    """Return Newton's corrections of the bodies (P, B, 6) and of the holding forces (P, C)."""
    topology, layout, load, rigid = problem.topology, problem.layout, problem.load, problem.rows.rigid
    strain = strain_of(topology, layout, state)
    force, tangent, _ = _answer(problem, strain)
    poses, n = len(force), 6 * topology.bodies
    held = force.copy()
    held[:, rigid] = state.hold
    count = int(rigid.sum())
    system = np.zeros((poses, n + count, n + count))
    add_stiffness(system, topology, layout, strain, held, tangent)
    arms = apply(state.turned[:, topology.loads], layout.load_arm)
    turning = cross_matrix(layout.load) @ cross_matrix(arms)
    for at, body in enumerate(topology.loads):
        system[:, 6 * body + 3 : 6 * body + 6, 6 * body + 3 : 6 * body + 6] -= turning[:, at]
    every = np.arange(poses)
    arm = apply(state.turned[every, load.body], load.arm)
    spin = 6 * load.body[:, None] + np.arange(3, 6)
    turning = cross_matrix(load.wrench[:, :3]) @ cross_matrix(arm)
    system[every[:, None, None], spin[:, :, None], spin[:, None]] -= turning
    for body in np.flatnonzero(topology.locked):
        system[:, 6 * body + 3 : 6 * body + 6, 6 * body + 3 : 6 * body + 6] += HOLD_SCALE * np.eye(3)
    # the rows and columns of the rigid directions follow the 6 B of the bodies
    system[:, n:, :n] = HOLD_SCALE * row_rates(topology, strain, np.flatnonzero(rigid))
    system[:, :n, n:] = np.swapaxes(system[:, n:, :n], -1, -2)
    system[:, n:, n:] = -SLACK * HOLD_SCALE * np.eye(count)
    unbalanced = _unbalanced(problem, state, strain, force)
    right = np.concatenate([unbalanced, -HOLD_SCALE * strain.rows[:, rigid]], axis=1)
    try:
        solution = np.linalg.solve(system[:, 6:, 6:], right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise BeamstiffError(f"{topology.machine.robot.name}: the true machine is a mechanism") from None
    moves = np.zeros((poses, topology.bodies, 6))
    moves[:, 1:] = solution[:, : n - 6].reshape(poses, -1, 6)
    return moves, HOLD_SCALE * solution[:, n - 6 :]
