"""Geometry, tools and payloads that are off; joints that err by angle or by way; reflectors that slip."""

import dataclasses
from functools import partial
from typing import Any

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import slender
from beamstiff.exam.draws import (
    PHASE,
    always,
    around,
    by_ratio,
    by_reach,
    direction,
    each,
    evenly,
    product,
    signed,
    sized,
    whole,
)
from beamstiff.exam.effect import Reality, Seen, built, form, load, places_of, reading
from beamstiff.exam.forms.author1 import geometry as geometry1
from beamstiff.exam.forms.author1.measurement import since_rest
from beamstiff.exam.forms.author4.measurement import times
from beamstiff.exam.machine import Machine, stroke
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.exam.rotations import turn, turned_by
from beamstiff.robot.parts import Mass

MOST = 0.25  # of the main error: each of those beside it
MARKED = 0.02  # of a tool's offset: where positions are read, the tool was measured with more care
ROUND = 0.05  # of a force: sidelong pulls at a pin, between its two ends
STILL = ("still_x", "still_y", "still_z")
RIPPLE = 0.15  # of a scar's depth: of the teeth around it


def _amount(request: DrawRequest) -> float:
    length = geometry1.kind_of(request.robot, str(request.component)) == "length"
    return request.sign() * (request.sized(6e-5, 3e-3) if length else request.sized(5e-5, 2.5e-3))


def _bent(request: DrawRequest) -> dict[str, float]:
    """Draw an error, and smaller ones of the same frame, of either kind: 1 mrad goes with 1 mm."""
    main = _amount(request)
    frame, _, parameter = str(request.component).partition(".")
    shares = [request.sign() * request.uniform(0.05, 0.2) for _ in range(2)]
    found = {"main": main}
    if parameter and not request.robot.loops:
        others = [name for name in ("alpha", "d", "r") if name != parameter]
        found |= {f"{frame}.{n}": share * main for n, share in zip(others, shares, strict=True)}
    return found


def _stacked(request: DrawRequest) -> dict[str, float]:
    """Draw an error, and those of all inner encoders' zeros beside it, mostly small, some not."""
    main = _amount(request)
    inner = [v.name for v in request.robot.actuated[1:-1] if v.name != request.component]
    shares = np.clip(request.rng.laplace(0.0, 0.06, len(inner)), -MOST, MOST)
    return {"main": main} | {n: main * float(s) for n, s in zip(inner, shares, strict=True)}


def _geometry(truth: Truth, reality: Reality) -> Reality:
    main = str(truth.component)
    return reality.with_errors({main if n == "main" else n: error for n, error in truth.parameters.items()})


def _turned(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a tool turned on its flange by dowels with play: all on it goes round."""
    p = truth.parameters
    before, after = p["way"], p["way"] + p["turned"]
    move = p["off"] * np.array([np.cos(after) - np.cos(before), np.sin(after) - np.sin(before), 0.0])
    share = {"lever": 1.0, "target": 1.0, "marked": MARKED}
    there: dict[str, Any] = {n: tuple((getattr(reality, n) + k * move).tolist()) for n, k in share.items()}
    return dataclasses.replace(reality, **there)


def _pin(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads of which a pull sits at one end of a pin in its clevis, a push at the other."""
    half, axes, force = vector(p), seen.tool_axes, wrench[:, :3]
    pull = np.einsum("pij,j,pi->p", axes, half / np.linalg.norm(half), force)
    end = np.tanh(pull / np.maximum(ROUND * np.linalg.norm(force, axis=1), 1e-12))
    return seen.with_arm(wrench, (axes @ (vector(p, STILL) + end[:, None] * half)[..., None])[..., 0])


def _capacity(request: DrawRequest) -> float:
    """Return the payload that the model has, or that such a robot usually carries, kg."""
    carried = sum(mass.mass for mass in request.robot.masses if mass.node == request.robot.tcp)
    return float(carried or 100.0 / slender(request.robot) ** 2)


def _half_empty(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine whose payload is fuller or emptier, and whose centre moves with the filling."""

    def filled(mass: Mass) -> Mass:
        centre = np.array(mass.at) + p["share"] * vector(p)
        changed = {"mass": mass.mass * (1.0 + p["share"]), "at": tuple(map(float, centre))}
        return mass.model_copy(update=changed)

    masses = [filled(mass) if mass.node == machine.tcp else mass for mass in machine.masses]
    if all(mass.node != machine.tcp for mass in masses):
        at = (p["x"], p["y"], p["z"])
        masses.append(Mass(node=machine.tcp, mass=abs(p["share"]) * p["usual"], at=at))
    return dataclasses.replace(machine, masses=tuple(masses))


def cardan(angle: Array, tilt: float, phase: float) -> Array:
    """Return how far a shaft behind a universal joint is ahead, rad; `tilt`: between the two shafts."""
    turned = angle - phase
    ahead = np.arctan2(np.sin(turned), np.cos(tilt) * np.cos(turned)) - turned
    return np.asarray(ahead - 2.0 * np.pi * np.round(ahead / (2.0 * np.pi)))


def _place(request: DrawRequest) -> float:
    middle, half = stroke(request.robot, request.component)
    return middle + request.uniform(-0.5, 0.5) * half


def _curve(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters

    def error(angle: Array) -> Array:
        if truth.form == "cardan":
            once = 0.25 * p["tilt"] ** 2 * p["once"] * np.sin(angle - p["once_phase"])
            return np.asarray(cardan(angle, p["tilt"], p["phase"]) + once)
        near = np.exp(-0.5 * ((angle - p["at"]) / p["width"]) ** 2)
        return np.asarray(p["depth"] * near * (1.0 + RIPPLE * np.sin(p["teeth"] * angle)))

    return reality.with_encoder(str(truth.component), error)


def dragged(angle: Array, form: str, p: Parameters) -> Array:
    """Return where a joint stays within its friction, (N,) in [-1, 1], from its angles in order.

    ``long-seal``: it turns round over a way. ``unequal``: at once, by another amount forward than back.
    """
    state, found = p["start"], np.empty(len(angle))
    for at, move in enumerate(np.diff(angle, prepend=angle[:1])):
        if abs(move) > 1e-9:
            side = np.sign(move)
            if form == "long-seal":
                state = side + (state - side) * np.exp(-abs(move) / p["way"])
            else:
                state = p["forward"] if side > 0.0 else -p["back"]
        found[at] = state
    return found


def _approach(form: str, p: Parameters, seen: Seen, values: Array) -> Array:
    if not seen.absolute:  # loaded and unloaded state came the same way
        return values
    campaign, machine, robot = seen.campaign, seen.machine, seen.machine.robot
    column, skeleton = [v.name for v in robot.actuated].index(str(seen.component)), skeleton_of(robot)
    order = np.argsort(times(campaign), kind="stable")
    q, stays = np.array(campaign.q, dtype=np.float64), np.empty(len(campaign))
    stays[order] = dragged(q[order, column], form, p)
    q[:, column] -= p["half_width"] * stays
    here, there = place(skeleton, campaign.q), place(skeleton, q)
    moved = places_of(machine, campaign.point, there) - places_of(machine, campaign.point, here)
    frame = machine.node(robot.tcp).frame
    turned = there.rotations[frame] @ np.swapaxes(here.rotations[frame], -1, -2)
    rotation = turned_by(turned @ turn(values[:, 3:]))
    return np.concatenate([values[:, :3] + moved, rotation], axis=1)


def _share(form: str, p: Parameters, turn_of: Array, rows: int) -> Array:
    """Return which share of its whole way a reflector has slipped when it is a row's turn, of so many."""
    since = turn_of - round(p["from"] * rows)
    slipped = np.where(since >= 0.0, p["share"], 0.0)
    if form == "two-slips":
        slipped += np.where(turn_of >= round(p["again"] * rows), 1.0 - p["share"], 0.0)
    else:  # a magnet that was knocked crawls on
        slipped += np.where(since >= 0.0, -(1.0 - p["share"]) * np.expm1(-since / p["rows"]), 0.0)
    return slipped


def _slip(form: str, p: Parameters, seen: Seen, values: Array) -> Array:
    campaign, rows = seen.campaign, len(values)
    node = seen.machine.node(seen.component or seen.machine.tcp)
    turn_of = np.empty(rows)
    turn_of[np.argsort(times(campaign), kind="stable")] = np.arange(rows)
    slipped = _share(form, p, turn_of, rows)
    if not seen.absolute:  # from where it was before the pose, or the row
        slipped = since_rest(campaign, slipped) if campaign.shared_unloaded else np.zeros(rows)
    away = seen.placed.rotations[node.frame] @ vector(p) * slipped[:, None]
    away = np.where((campaign.point == node.name)[:, None], away, 0.0)
    return np.concatenate([values[:, :3] + away, values[:, 3:]], axis=1)


def came_to_rest(truth: Truth, rows: int) -> Truth:
    """Return the slip as a later campaign finds it: where the last of so many rows left it."""
    p = truth.parameters
    reached = float(_share(truth.form, p, np.array([rows - 1.0]), rows)[0])
    end = {**p, **{name: reached * p[name] for name in "xyz"}, "from": 0.0, "share": 1.0}
    if truth.form == "two-slips":
        end["again"] = 0.0
    return dataclasses.replace(truth, parameters=end)


_LONG = by_reach(sized(3e-3, 0.15))  # half a pin
_START, _WIDTH, _SLIPS = evenly(-1.0, 1.0), sized(1e-5, 4e-4), direction(by_reach(sized(6e-5, 2.5e-3)))


FORMS = (
    form("geometry-error", "bent-link", _geometry, _bent),
    form("geometry-error", "stacked-zeros", _geometry, _stacked),
    form("tool-offset", "turned-on-flange", _turned,
         off=by_reach(evenly(0.06, 0.25)), way=PHASE, turned=signed(sized(0.015, 0.8))),
    load("tool-offset", "pin-in-clevis", _pin,
         direction(_LONG), direction(product(_LONG, evenly(0.1, 0.4)), STILL)),
    built("payload-error", "half-empty", _half_empty, each(share=signed(sized(0.015, 0.7))),
          direction(by_reach(evenly(0.05, 0.2))), usual=_capacity),
    built("payload-error", "box-beside", lambda p, machine, _: machine.plus(
              masses=(Mass(node=machine.tcp, mass=p["mass"], at=(p["x"], p["y"], p["z"])),)),
          around(by_reach(evenly(0.12, 0.4)), "xy"), mass=product(sized(0.01, 0.4), _capacity),
          z=product(always(-1.0), by_reach(evenly(0.02, 0.3)))),
    form("angle-curve", "cardan", _curve,
         tilt=sized(0.012, 0.06), phase=evenly(0.0, np.pi), once=evenly(0.1, 0.5), once_phase=PHASE),
    form("angle-curve", "scar", _curve,
         depth=signed(sized(3e-5, 1.2e-3)), at=_place, width=evenly(0.15, 0.45), teeth=whole(20, 60)),
    reading("approach-direction", "long-seal", partial(_approach, "long-seal"),
            half_width=_WIDTH, way=by_ratio(0.02, 0.4), start=_START),
    reading("approach-direction", "unequal", partial(_approach, "unequal"),
            half_width=_WIDTH, forward=evenly(0.3, 1.0), back=evenly(0.3, 1.0), start=_START),
    reading("target-slip", "two-slips", partial(_slip, "two-slips"),
            each(**{"from": evenly(0.15, 0.5), "again": evenly(0.55, 0.85), "share": evenly(0.3, 0.8)}),
            _SLIPS),
    reading("target-slip", "crawl", partial(_slip, "crawl"),
            each(**{"from": evenly(0.2, 0.7), "share": evenly(0.5, 0.9), "rows": by_ratio(2.0, 15.0)}),
            _SLIPS),
)  # fmt: skip
