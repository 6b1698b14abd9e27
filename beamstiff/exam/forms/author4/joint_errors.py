"""Joints that stand elsewhere than they read, by angle or by the way they came; reflectors that slip."""

import dataclasses
from functools import partial

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import stroke
from beamstiff.exam.draws import PHASE, by_ratio, by_reach, direction, each, evenly, signed, sized, whole
from beamstiff.exam.effect import Seen, form, reading
from beamstiff.exam.forms.author4.measurement import times
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.placing import place, skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.exam.rotations import turn, turned_by

RIPPLE = 0.15  # of a scar's depth: of the teeth around it


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

    ``long-seal``: a seal that the shaft drags along turns round over a way. ``unequal``: at once, by another
    amount forward than back.
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
    campaign, robot = seen.campaign, seen.machine.robot
    column = [v.name for v in robot.actuated].index(str(seen.component))
    nodes, skeleton = {node.name: node for node in robot.nodes}, skeleton_of(robot)
    order = np.argsort(times(campaign), kind="stable")
    q, stays = np.array(campaign.q, dtype=np.float64), np.empty(len(campaign))
    stays[order] = dragged(q[order, column], form, p)
    q[:, column] -= p["half_width"] * stays
    here, there = place(skeleton, campaign.q), place(skeleton, q)
    points = [nodes[str(name)] for name in campaign.point]
    moved = [there.node(point)[row] - here.node(point)[row] for row, point in enumerate(points)]
    frame = nodes[robot.tcp].frame
    turned = there.rotations[frame] @ np.swapaxes(here.rotations[frame], -1, -2)
    rotation = turned_by(turned @ turn(values[:, 3:]))
    return np.concatenate([values[:, :3] + np.array(moved), rotation], axis=1)


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
        before = np.empty(rows)
        for pose in np.unique(campaign.pose):
            its = campaign.pose == pose
            first = slipped[its][np.argmin(turn_of[its])]
            before[its] = first if campaign.shared_unloaded else slipped[its]
        slipped = slipped - before
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


_START, _WIDTH, _SLIPS = evenly(-1.0, 1.0), sized(1e-5, 4e-4), direction(by_reach(sized(6e-5, 2.5e-3)))
FORMS = (
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
