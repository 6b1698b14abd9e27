"""`tool-offset`: the load acts, or the target sits, elsewhere than at the nominal TCP.

A load off by p adds the moment ``p x F``; a target off by p moves by ``r x p`` more, and its absolute
position is off by p, constant in the tool's frame. What a load hangs on turns after it: its point is then
``p + P F / |F|``, P constant in the tool's or in the base frame. What is attached anew in every posture,
or for every direction there, is off by ``p + p_k`` in the k-th.

A wrong lever may load a drive that nothing else turns, as that of the last axis where all forces act on it.
How soft that is no row tells then: what the lever does there is free.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, Term, named
from beamstiff.diagnosis.effects.external import (
    anew,
    by_setup,
    each_by_each,
    shift_alone,
    tool_axes,
    turn_alone,
)
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, drives
from beamstiff.diagnosis.residual.baseline import Baseline, own_direction, tcp_response
from beamstiff.diagnosis.residual.internal_wrench import find_places
from beamstiff.se3 import Array

OFFSET = 0.03  # m
FAR = 0.1  # m
PLACED = 5e-4  # m, of a target whose place was measured
TURNED = 1e-3  # rad
FAINT = 0.1  # of the noise, which a drive that nothing turns moves at most


LOADS = named("load_point", "m", OFFSET)


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    robot, rows = baseline.nominal, baseline.rows
    axes = tool_axes(baseline)
    loaded = np.where((rows.load_point == robot.tcp)[:, None, None], axes, 0.0)
    marked = np.where((rows.point == robot.tcp)[:, None, None], axes, 0.0)
    load = _acting(baseline.response, loaded, rows.wrench[:, :3])
    shapes = _of_positions if baseline.absolute else _of_displacements
    return [
        *shapes(baseline, (load, LOADS), loaded, marked),
        *_hung(baseline, (load, LOADS), loaded),
        *anew("load, per-posture offset", baseline, load, LOADS),
        *anew("load, per-direction offset", baseline, load, LOADS, by_setup),
    ]


def _acting(response: Array, at: Array, force: Array) -> Array:
    """Return what a force (N, 3) moves more where it acts off by unit levers (N, 3, k), (N, 6, k)."""
    return response @ turn_alone(np.cross(at, force[:, :, None], axis=1))


def _hung(baseline: Baseline, load: Term, loaded: Array) -> list[Shape]:
    """Return the shapes of a load that hangs on something which turns, or stays, as the tool does not."""
    rows = baseline.rows
    axes, force = tool_axes(baseline), rows.wrench[:, :3]
    still = np.broadcast_to(np.eye(3), axes.shape)
    here = (rows.load_point == baseline.nominal.tcp)[:, None, None]
    beside = (
        _acting(baseline.response, np.where(here, still, 0.0), force),
        named("load_point_base", "m", OFFSET),
    )
    following = tuple(Quantity(f"load_point_{a}_by_{b}", "m", OFFSET) for a in "xyz" for b in "xyz")

    def after(frame: Array) -> Term:
        return _acting(baseline.response, _following(frame, loaded, force), force), following

    name, keeps = "load that turns after its direction", "load that keeps its side in the"
    return [
        Shape.of(f"{keeps} base frame", beside, weight=0.5),
        Shape.of(f"{keeps} tool and in the base frame", load, beside, weight=0.5),
        Shape.of(name, load, after(axes), weight=0.5),
        Shape.of(f"{name}, in the base frame", load, after(still), weight=0.5),
    ]


def _of_positions(baseline: Baseline, load: Term, loaded: Array, marked: Array) -> list[Shape]:
    robot, axes = baseline.nominal, tool_axes(baseline)
    mass = sum(item.mass for item in robot.masses if item.node == robot.tcp)
    weight = np.broadcast_to(mass * np.array(robot.gravity), (len(axes), 3))
    payload = _acting(tcp_response(baseline), axes, weight)
    seat = (shift_alone(marked), named("target", "m", PLACED))
    turn = (turn_alone(axes), named("turn", "rad", TURNED))
    # of a target whose unloaded place is known, the lever is left: what the tool turns moves it
    moved = np.cross(baseline.predicted[:, 3:, None], marked, axis=1)
    lever = (shift_alone(moved), named("target_lever", "m", OFFSET))
    return [
        Shape.of("target", seat),
        Shape.of("target and its turn", seat, turn),
        Shape.of("load", load, weight=0.5),
        Shape("load with the payload", load[0] + payload, LOADS, weight=0.5),
        Shape.of("load and target", load, seat, weight=0.5),
        Shape.of("target and its lever", seat, lever, weight=0.5),
        Shape.of("load, target and its lever", load, seat, lever, weight=0.5),
        *_turning(baseline, loaded, {"load": [load]}),
    ]


def _of_displacements(baseline: Baseline, load: Term, loaded: Array, marked: Array) -> list[Shape]:
    # the rotation as measured holds what the offset itself adds to it
    turned = np.where(baseline.used[:, 3:], baseline.measured[:, 3:], baseline.predicted[:, 3:])
    seen = (shift_alone(np.cross(turned[:, :, None], marked, axis=1)), named("target", "m", OFFSET))
    far: list[Shape] = []
    unread = np.logical_not(baseline.used[:, 3:].any(axis=1))
    # whatever the rows at hand read: an effect that was fitted has to be found again on others
    needed = baseline.stated is not None or not baseline.fit.used[:, 3:].any(axis=1).all()
    if needed:  # what a load that is far off turns, moves a target that is far off
        moved = np.cross(load[0][:, 3:, :, None], marked[:, :, None, :], axis=1).reshape(len(marked), 3, 9)
        moved = shift_alone(np.where(unread[:, None, None], moved, 0.0))
        products = tuple(Quantity(f"load_{i}_target_{j}", "m^2", FAR * OFFSET) for i in "xyz" for j in "xyz")
        far = [Shape.of("load and target, far off", load, seen, (moved, products), weight=0.5)]
    return [
        Shape.of("load", load),
        Shape.of("target", seen),
        Shape("load and target together", load[0] + seen[0], named("tool", "m", OFFSET)),
        Shape.of("load and target", load, seen, weight=0.5),
        *far,
        *_turning(baseline, loaded, {"load": [load], "load and target": [load, seen]}),
    ]


def _turning(baseline: Baseline, loaded: Array, shapes: Mapping[str, list[Term]]) -> list[Shape]:
    """Return shapes with what their levers turn where nothing else does, if there is such a drive."""
    turned = _where_nothing_else_turns(baseline, loaded)
    if turned is None:
        return []
    return [
        Shape.of(f"{name}, turning what nothing else does", *terms, turned, weight=0.5)
        for name, terms in shapes.items()
    ]


def _where_nothing_else_turns(baseline: Baseline, loaded: Array) -> Term | None:
    """Return what levers (N, 3, 3) of the load turn at drives whose stiffness shows in no row, if any.

    A drive of compliance c turns by ``c q^T w``, q the torque about it per unit wrench w at the load: by
    reciprocity what a turn of it moves there. Of a robot that states the effect, every drive.
    """
    rows = baseline.rows
    drives_here = [(str(name), axis_at(baseline, str(name))) for name in drives(baseline)]
    if baseline.stated is None:
        drives_here = [one for one in drives_here if _is_insensitive(baseline.fit, one[1])]
    if not drives_here:
        return None
    there = baseline
    if (rows.point != rows.load_point).any():
        there = replace(baseline, places=find_places(baseline.robot, replace(rows, point=rows.load_point)))
    moment = np.cross(loaded, rows.wrench[:, :3, None], axis=1)  # (N, 3, 3)
    columns: list[Array] = []
    quantities: list[Quantity] = []
    for name, axis in drives_here:
        torque = np.einsum("na,nak->nk", axis_at(there, name).shift[:, 3:], moment)
        columns.append(axis.shift[:, :, None] * (torque / axis.stiffness)[:, None, :])
        quantities += named("load_point", "m", OFFSET, [f"{k}_at_{name}" for k in "xyz"])
    return np.concatenate(columns, -1), tuple(quantities)


def _is_insensitive(fit: Baseline, axis: Axis) -> bool:
    """Return whether a drive was fitted, and moves nothing by more than rounding, however soft it is."""
    name = f"{axis.joint.name}.{own_direction(fit.nominal, axis.joint.name)}"
    if name not in fit.fitted:
        return False
    moved = fit.tangent[..., fit.fitted.index(name)] / axis.stiffness / fit.sigma
    return float(np.abs(moved[fit.used]).max(initial=0.0)) < FAINT


def _following(frame: Array, loaded: Array, force: Array) -> Array:
    """Return how the point (N, 3, 9) on which a force (N, 3) acts moves with its direction in a frame."""
    size = np.linalg.norm(force, axis=1, keepdims=True)
    moved = each_by_each(frame, force / np.where(size > 0, size, 1.0))
    here = np.abs(loaded).max(axis=(1, 2), keepdims=True) > 0
    return np.where(here, moved, 0.0)


EFFECT = Effect(
    name="tool-offset",
    family="measurement",
    meaning="The load acts, or the target is mounted, at another point than the nominal TCP.",
    components=lambda baseline: [None],
    shapes=_shapes,
    separation="apply the same force at two points of the tool; add a second target",
    look_alikes=("tool-compliance", "load-error"),
    sources="5 to 50 mm, engineering estimate",
    place="tool point",
)
