"""The machine laid out at its poses: bodies with their arms, members with their axes and rest lengths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, Integers
from beamstiff.exam.machine import Machine, Profile
from beamstiff.exam.placing import Placed

SHIFTED = 0.1  # m, of two nodes of a joint: the most that errors of the geometry may move them apart


@dataclass(frozen=True, eq=False)
class Topology:
    """What does not depend on the pose."""

    machine: Machine
    body: Integers  # (N,): body of every node; 0 is the ground
    index: dict[str, int]  # of the nodes
    bodies: int  # number of bodies, the ground included
    members: Integers  # (E, 2): bodies of hinges, then bars
    rods: Integers  # (S, 2)
    locked: Array  # (B,): bodies that only rods hold: they do not turn
    loads: Integers  # (L,): bodies that carry masses and the weight of bars


@dataclass(frozen=True, eq=False)
class Layout:
    """The machine before it deforms, P poses, base frame, SI."""

    arms: Array  # (P, N, 3): nodes from the reference point of their body
    nodes: Array  # (P, N, 3)
    axes: Array  # (P, E, 3, 3): axes of hinges and bars as columns
    rest: Array  # (P, E, 3): from the first end of a member to the second
    first: Array  # (P, E, 3): arms of the first ends
    second: Array  # (P, E, 3)
    stiffness: Array  # (P, E, 6, 6): of hinges and bars; rows of rigid directions are zero
    bending: Array  # (P, bars, 6, 6): H of the bars, which follow the hinges: they shorten by ``e.H.e/2``
    rod: Array  # (P, S, 3)
    rod_first: Array  # (P, S, 3): arms
    rod_second: Array
    load_arm: Array  # (P, L, 3): of weights
    load: Array  # (P, L, 3)
    load_moment: Array  # (P, L, 3)


def topology_of(machine: Machine) -> Topology:
    """Return the bodies and members of a machine."""
    body_of = machine.bodies()
    index = {node.name: at for at, node in enumerate(machine.nodes)}

    body = np.array([body_of[node.name] for node in machine.nodes], dtype=np.int64)
    members, rods = _ends([*machine.hinges, *machine.bars], body_of), _ends(machine.rods, body_of)
    locked = np.ones(max(body_of.values()) + 1, dtype=np.bool_)
    locked[members.ravel()] = False
    joined = {name for _, nodes in machine.rigids for name in nodes}
    locked[[body_of[name] for name in joined]] = False
    carrying = [mass.node for mass in machine.masses] + [hose.node for hose in machine.hoses]
    carrying += [n for bar in machine.bars for n in bar.nodes]
    loads = np.array([body_of[name] for name in carrying], dtype=np.int64)
    return Topology(machine, body, index, len(locked), members, rods, locked.astype(np.float64), loads)


def lay_out(topology: Topology, placed: Placed) -> Layout:
    """Return the layout of a machine at the poses where it is placed."""
    machine, index = topology.machine, topology.index
    poses = len(next(iter(placed.origins.values())))
    nodes = np.stack([placed.node(node) for node in machine.nodes], axis=1)
    _rejoin(machine, index, nodes)
    first_of_body = {int(body): at for at, body in reversed(list(enumerate(topology.body)))}
    arms = nodes - nodes[:, [first_of_body[int(body)] for body in topology.body]]

    hinges, bars = machine.hinges, machine.bars
    ends, rod_ends = _ends([*hinges, *bars], index), _ends(machine.rods, index)
    axes = np.zeros((poses, len(ends), 3, 3))
    rest = np.zeros((poses, len(ends), 3))
    stiffness = np.zeros((poses, len(ends), 6, 6))
    bending = np.zeros((poses, len(bars), 6, 6))
    for at, hinge in enumerate(hinges):
        axes[:, at] = placed.rotations[hinge.frame] @ hinge.axes
        k = hinge.stiffness
        if k.ndim == 1:
            k = np.diag(np.where(np.isfinite(k), k, 0.0))
        lawless = np.array([float(direction not in hinge.laws) for direction in range(6)])
        stiffness[:, at] = k * lawless[:, None] * lawless
    for at, bar in enumerate(bars, start=len(hinges)):
        a, b = ends[at]
        rest[:, at] = nodes[:, b] - nodes[:, a]
        length = np.linalg.norm(rest[:, at], axis=1)
        up = None if bar.up is None else placed.rotations[machine.node(bar.nodes[0]).frame] @ bar.up
        axes[:, at] = _bar_axes(rest[:, at] / length[:, None], up)
        stiffness[:, at] = tip_stiffness(bar.profile, length)
        bending[:, at - len(hinges)] = _shortening(length)
    first, second = (arms[:, end] for end in ends.T)
    rod_first, rod_second = (arms[:, end] for end in rod_ends.T)
    rod = nodes[:, rod_ends[:, 1]] - nodes[:, rod_ends[:, 0]]
    weights = _weights(machine, index, placed, nodes, arms)
    return Layout(
        arms, nodes, axes, rest, first, second, stiffness, bending, rod, rod_first, rod_second, *weights
    )


def tip_stiffness(profile: Profile, length: Array) -> Array:
    """Return the stiffness (P, 6, 6) of beams' free ends: inverse of ``L sum of X^T c X`` over stations."""
    X = np.zeros((len(length), len(profile.stations), 6, 6))
    X[..., range(6), range(6)] = 1.0
    lever = length[:, None] * (1.0 - profile.stations)
    X[..., 4, 2], X[..., 5, 1] = -lever, lever
    flexibility = np.einsum("pgki,gk,pgkj->pij", X, profile.compliance, X) * length[:, None, None]
    k: Array = np.linalg.inv(flexibility)
    return 0.5 * (k + np.swapaxes(k, -1, -2))


def _ends(parts: Sequence[Any], of_node: Mapping[str, int]) -> Integers:
    """Return what both nodes of every part are, (parts, 2)."""
    found = [[of_node[name] for name in part.nodes] for part in parts]
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _rejoin(machine: Machine, index: dict[str, int], nodes: Array) -> None:
    """Put the nodes of a joint together again where an error of the geometry has moved one of them."""
    for hinge in machine.hinges:
        a, b = (index[name] for name in hinge.nodes)
        apart = float(np.abs(nodes[:, a] - nodes[:, b]).max())
        if apart > SHIFTED:
            raise BeamstiffError(f"joint {hinge.name!r}: its nodes are {apart:.3g} m apart")
        own = machine.node(hinge.nodes[0]).frame == hinge.frame
        kept, moved = (a, b) if own else (b, a)
        nodes[:, moved] = nodes[:, kept]


def _bar_axes(x: Array, up: Array | None) -> Array:
    if up is None:
        up = np.eye(3)[np.argmin(np.abs(x), axis=1)]
    z = np.cross(x, up)
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _shortening(length: Array) -> Array:
    """Return H, of the shortening ``int(v'^2 + w'^2)/2 = e.H.e/2`` of a cubic clamped at one end."""
    H = np.zeros((len(length), 6, 6))
    for v, r, sign in ((1, 5, -1.0), (2, 4, 1.0)):
        H[:, v, v] = 1.2 / length
        H[:, v, r] = H[:, r, v] = 0.1 * sign
        H[:, r, r] = 2.0 * length / 15.0
    return H


def _weights(
    machine: Machine, index: dict[str, int], placed: Placed, nodes: Array, arms: Array
) -> tuple[Array, Array, Array]:
    """Return arms, forces and moments of masses and hoses, then of either end of every bar."""
    g = np.array(machine.robot.gravity)
    found: list[tuple[Array, Array, Array]] = []
    for mass in machine.masses:
        arm = arms[:, index[mass.node]] + placed.rotations[machine.node(mass.node).frame] @ np.array(mass.at)
        force = np.broadcast_to(mass.mass * g, arm.shape)
        found.append((arm, force, np.zeros_like(arm)))
    for hose in machine.hoses:
        height = -nodes[:, index[hose.node]] @ g / (float(np.linalg.norm(g)) or 1.0)
        kilograms = hose.per_metre * np.maximum(height - hose.low, 0.0)
        force = kilograms[:, None] * g
        found.append((arms[:, index[hose.node]], force, np.zeros_like(force)))
    for bar in machine.bars:
        a, b = (index[name] for name in bar.nodes)
        along = nodes[:, b] - nodes[:, a]
        weight = bar.weight * np.linalg.norm(along, axis=1, keepdims=True) * g
        couple = np.cross(along, weight) / 12.0
        found += [(arms[:, a], 0.5 * weight, couple), (arms[:, b], 0.5 * weight, -couple)]
    if not found:
        none = np.zeros((len(nodes), 0, 3))
        return none, none, none
    arm, force, moment = (np.stack(parts, axis=1) for parts in zip(*found, strict=True))
    return arm, force, moment
