"""`tool-offset`: the load acts, or the target sits, elsewhere than at the nominal TCP.

A load off by p adds the moment ``p x F``; a target off by p moves by ``r x p`` more, and its absolute
position is off by p, constant in the tool's frame. What a load hangs on turns after it: its point is then
``p + P F / |F|``, P constant in the tool's or in the base frame. What is attached anew in every posture,
or for every direction there, is off by ``p + p_k`` in the k-th.

A wrong lever may load a drive that nothing else turns, as that of the last axis where all forces act on it.
How soft that is no row tells then: what the lever does there is free.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.external import anew, by_setup, each_by_each, tool_axes
from beamstiff.diagnosis.effects.torque_laws import Axis, axis_at, drives
from beamstiff.diagnosis.residual.baseline import Baseline, own_direction, tcp_response
from beamstiff.diagnosis.residual.internal_wrench import find_places
from beamstiff.se3 import Array

OFFSET = 0.03  # m
FAR = 0.1  # m
PLACED = 5e-4  # m, of a target whose place was measured
TURNED = 1e-3  # rad
FAINT = 0.1  # of the noise, which a drive that nothing turns moves at most


LOADS = tuple(Quantity(f"load_point_{axis}", "m", OFFSET) for axis in "xyz")


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    robot, rows = baseline.nominal, baseline.rows
    axes = tool_axes(baseline)
    loaded = np.where((rows.load_point == robot.tcp)[:, None, None], axes, 0.0)
    marked = np.where((rows.point == robot.tcp)[:, None, None], axes, 0.0)
    load = _acting(baseline.response, loaded, rows.wrench[:, :3])
    shapes = _of_positions if baseline.absolute else _of_displacements
    return [
        *shapes(baseline, load, loaded, marked),
        *_hung(baseline, load, loaded),
        *anew("load, per-posture offset", baseline, load, LOADS),
        *anew("load, per-direction offset", baseline, load, LOADS, by_setup),
    ]


def _acting(response: Array, at: Array, force: Array) -> Array:
    """Return what a force (N, 3) moves more where it acts off by unit levers (N, 3, k), (N, 6, k)."""
    moment = np.cross(at, force[:, :, None], axis=1)
    result: Array = response @ np.concatenate([np.zeros_like(moment), moment], 1)
    return result


def _hung(baseline: Baseline, load: Array, loaded: Array) -> list[Shape]:
    """Return the shapes of a load that hangs on something which turns, or stays, as the tool does not."""
    rows = baseline.rows
    axes, force = tool_axes(baseline), rows.wrench[:, :3]
    still = np.broadcast_to(np.eye(3), axes.shape)
    here = (rows.load_point == baseline.nominal.tcp)[:, None, None]
    beside = _acting(baseline.response, np.where(here, still, 0.0), force)
    besides = tuple(Quantity(f"load_point_base_{axis}", "m", OFFSET) for axis in "xyz")
    following = tuple(Quantity(f"load_point_{a}_by_{b}", "m", OFFSET) for a in "xyz" for b in "xyz")

    def after(frame: Array) -> Array:
        turning = _acting(baseline.response, _following(frame, loaded, force), force)
        return np.concatenate([load, turning], -1)

    name = "load that turns after its direction"
    return [
        Shape("load that keeps its side in the base frame", beside, besides, weight=0.5),
        Shape(
            "load that keeps its side in the tool and in the base frame",
            np.concatenate([load, beside], -1),
            (*LOADS, *besides),
            weight=0.5,
        ),
        Shape(name, after(axes), (*LOADS, *following), weight=0.5),
        Shape(f"{name}, in the base frame", after(still), (*LOADS, *following), weight=0.5),
    ]


def _of_positions(baseline: Baseline, load: Array, loaded: Array, marked: Array) -> list[Shape]:
    robot, rows, axes = baseline.nominal, baseline.rows, tool_axes(baseline)
    nothing = np.zeros_like(axes)
    mass = sum(item.mass for item in robot.masses if item.node == robot.tcp)
    weight = np.broadcast_to(mass * np.array(robot.gravity), (len(rows), 3))
    payload = _acting(tcp_response(baseline), axes, weight)
    seat = np.concatenate([marked, nothing], 1)
    turn = np.concatenate([nothing, axes], 1)
    # of a target whose unloaded place is known, the lever is left: what the tool turns moves it
    tilt = np.concatenate([np.cross(baseline.predicted[:, 3:, None], marked, axis=1), nothing], 1)
    levers = tuple(Quantity(f"target_lever_{axis}", "m", OFFSET) for axis in "xyz")
    places = tuple(Quantity(f"target_{axis}", "m", PLACED) for axis in "xyz")
    turns = tuple(Quantity(f"turn_{axis}", "rad", TURNED) for axis in "xyz")
    return [
        Shape("target", seat, places),
        Shape("target and its turn", np.concatenate([seat, turn], -1), (*places, *turns)),
        Shape("load", load, LOADS, weight=0.5),
        Shape("load with the payload", load + payload, LOADS, weight=0.5),
        Shape("load and target", np.concatenate([load, seat], -1), (*LOADS, *places), weight=0.5),
        Shape("target and its lever", np.concatenate([seat, tilt], -1), (*places, *levers), weight=0.5),
        Shape(
            "load, target and its lever",
            np.concatenate([load, seat, tilt], -1),
            (*LOADS, *places, *levers),
            weight=0.5,
        ),
        *_turning(baseline, loaded, {"load": (load, LOADS)}),
    ]


def _of_displacements(baseline: Baseline, load: Array, loaded: Array, marked: Array) -> list[Shape]:
    nothing = np.zeros_like(marked)
    # the rotation as measured holds what the offset itself adds to it
    turned = np.where(baseline.used[:, 3:], baseline.measured[:, 3:], baseline.predicted[:, 3:])
    seen = np.concatenate([np.cross(turned[:, :, None], marked, axis=1), nothing], 1)
    targets = tuple(Quantity(f"target_{axis}", "m", OFFSET) for axis in "xyz")
    both = tuple(Quantity(f"tool_{axis}", "m", OFFSET) for axis in "xyz")
    together = np.concatenate([load, seen], -1)
    far: list[Shape] = []
    unread = np.logical_not(baseline.used[:, 3:].any(axis=1))
    # whatever the rows at hand read: an effect that was fitted has to be found again on others
    needed = baseline.stated is not None or not baseline.fit.used[:, 3:].any(axis=1).all()
    if needed:  # what a load that is far off turns, moves a target that is far off
        moved = np.cross(load[:, 3:, :, None], marked[:, :, None, :], axis=1).reshape(len(marked), 3, 9)
        moved = np.concatenate([np.where(unread[:, None, None], moved, 0.0), np.zeros_like(moved)], 1)
        products = tuple(Quantity(f"load_{i}_target_{j}", "m^2", FAR * OFFSET) for i in "xyz" for j in "xyz")
        columns = np.concatenate([together, moved], -1)
        far = [Shape("load and target, far off", columns, (*LOADS, *targets, *products), weight=0.5)]
    return [
        Shape("load", load, LOADS),
        Shape("target", seen, targets),
        Shape("load and target together", load + seen, both),
        Shape("load and target", together, (*LOADS, *targets), weight=0.5),
        *far,
        *_turning(
            baseline, loaded, {"load": (load, LOADS), "load and target": (together, (*LOADS, *targets))}
        ),
    ]


def _turning(
    baseline: Baseline, loaded: Array, shapes: Mapping[str, tuple[Array, tuple[Quantity, ...]]]
) -> list[Shape]:
    """Return shapes with what their levers turn where nothing else does, if there is such a drive."""
    turned, unknown = _where_nothing_else_turns(baseline, loaded)
    if not unknown:
        return []
    return [
        Shape(
            f"{name}, turning what nothing else does",
            np.concatenate([columns, turned], -1),
            (*quantities, *unknown),
            weight=0.5,
        )
        for name, (columns, quantities) in shapes.items()
    ]


def _where_nothing_else_turns(baseline: Baseline, loaded: Array) -> tuple[Array, tuple[Quantity, ...]]:
    """Return what levers (N, 3, 3) of the load turn at drives whose stiffness shows in no row, (N, 6, 3 d).

    A drive of compliance c turns by ``c q^T w``, q the torque about it per unit wrench w at the load: by
    reciprocity what a turn of it moves there. Of a robot that states the effect, every drive.
    """
    rows = baseline.rows
    drives_here = [(str(name), axis_at(baseline, str(name))) for name in drives(baseline)]
    if baseline.stated is None:
        drives_here = [one for one in drives_here if _is_insensitive(baseline.fit, one[1])]
    if not drives_here:
        return np.zeros((len(rows), 6, 0)), ()
    there = baseline
    if (rows.point != rows.load_point).any():
        there = replace(baseline, places=find_places(baseline.robot, replace(rows, point=rows.load_point)))
    moment = np.cross(loaded, rows.wrench[:, :3, None], axis=1)  # (N, 3, 3)
    columns, quantities = [], []
    for name, axis in drives_here:
        torque = np.einsum("na,nak->nk", axis_at(there, name).shift[:, 3:], moment)
        columns.append(axis.shift[:, :, None] * (torque / axis.stiffness)[:, None, :])
        quantities += [Quantity(f"load_point_{k}_at_{name}", "m", OFFSET) for k in "xyz"]
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
    result: Array = np.where(here, moved, 0.0)
    return result


EFFECT = Effect(
    name="tool-offset",
    family="measurement",
    meaning="The load acts, or the target sits, elsewhere than at the nominal TCP.",
    components=lambda baseline: [None],
    shapes=_shapes,
    separation="apply the same force at two points of the tool; add a second target",
    look_alikes=("tool-compliance", "load-error"),
    sources="5 to 50 mm, engineering estimate",
    place="tool point",
)
