"""Joints that stand elsewhere than they read, by angle or by the way they came; reflectors that slip."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, nowhere, slender, stroke, turning_drives, vector
from beamstiff.exam.forms.author4.by_form import Form, effect_of
from beamstiff.exam.forms.author4.measurement import times
from beamstiff.exam.placing import Placed, place, skeleton_of
from beamstiff.exam.reality import Reality
from beamstiff.exam.rotations import turn, turned_by
from beamstiff.robot.description import Robot

RIPPLE = 0.15  # of a scar's depth: of the teeth around it


def open_drives(robot: Robot) -> list[str | None]:
    """Return the turning drives of robots without loops."""
    return [] if robot.loops else turning_drives(robot)


def cardan(angle: Array, tilt: float, phase: float) -> Array:
    """Return how far a shaft behind a universal joint is ahead, rad; `tilt`: between the two shafts."""
    turned = angle - phase
    ahead = np.arctan2(np.sin(turned), np.cos(tilt) * np.cos(turned)) - turned
    return np.asarray(ahead - 2.0 * np.pi * np.round(ahead / (2.0 * np.pi)))


def _cardan(request: DrawRequest) -> dict[str, float]:
    return {
        "tilt": request.sized(0.012, 0.06),
        "phase": request.uniform(0.0, np.pi),
        "once": request.uniform(0.1, 0.5),
        "once_phase": request.uniform(0.0, 2.0 * np.pi),
    }


def _scar(request: DrawRequest) -> dict[str, float]:
    middle, half = stroke(request.robot, request.component)
    return {
        "depth": request.sign() * request.sized(3e-5, 1.2e-3),
        "at": middle + request.uniform(-0.5, 0.5) * half,
        "width": request.uniform(0.15, 0.45),
        "teeth": request.integer(20, 60),
    }


def _curve(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters

    def error(angle: Array) -> Array:
        if truth.form == "cardan":
            once = 0.25 * p["tilt"] ** 2 * p["once"] * np.sin(angle - p["once_phase"])
            return np.asarray(cardan(angle, p["tilt"], p["phase"]) + once)
        near = np.exp(-0.5 * ((angle - p["at"]) / p["width"]) ** 2)
        return np.asarray(p["depth"] * near * (1.0 + RIPPLE * np.sin(p["teeth"] * angle)))

    return reality.with_encoder(str(truth.component), error)


def _worn(request: DrawRequest) -> dict[str, float]:
    return {
        "half_width": request.sized(1e-5, 4e-4),
        "way": request.log_uniform(0.02, 0.4),
        "start": request.uniform(-1.0, 1.0),
    }


def _forward(request: DrawRequest) -> dict[str, float]:
    return {
        "half_width": request.sized(1e-5, 4e-4),
        "forward": request.uniform(0.3, 1.0),
        "back": request.uniform(0.3, 1.0),
        "start": request.uniform(-1.0, 1.0),
    }


def dragged(angle: Array, form: str, p: dict[str, float]) -> Array:
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


def _approach(truth: Truth, reality: Reality) -> Reality:
    p, robot = dict(truth.parameters), reality.machine.robot
    column = [v.name for v in robot.actuated].index(str(truth.component))
    nodes = {node.name: node for node in robot.nodes}
    skeleton = skeleton_of(robot)

    def change(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        if campaign.kind == "displacement":  # loaded and unloaded state came the same way
            return values
        order = np.argsort(times(campaign), kind="stable")
        q, stays = np.array(campaign.q, dtype=np.float64), np.empty(len(campaign))
        stays[order] = dragged(q[order, column], truth.form, p)
        q[:, column] -= p["half_width"] * stays
        here, there = place(skeleton, campaign.q), place(skeleton, q)
        points = [nodes[str(name)] for name in campaign.point]
        moved = [there.node(point)[row] - here.node(point)[row] for row, point in enumerate(points)]
        frame = nodes[robot.tcp].frame
        turned = there.rotations[frame] @ np.swapaxes(here.rotations[frame], -1, -2)
        rotation = turned_by(turned @ turn(values[:, 3:]))
        return np.concatenate([values[:, :3] + np.array(moved), rotation], axis=1)

    return reality.with_reading(change)


def _twice(request: DrawRequest) -> dict[str, float]:
    small = np.sqrt(slender(request.robot))
    return {
        "from": request.uniform(0.15, 0.5),
        "again": request.uniform(0.55, 0.85),
        "share": request.uniform(0.3, 0.8),
        **request.direction(request.sized(6e-5, 2.5e-3) / small),
    }


def _crawl(request: DrawRequest) -> dict[str, float]:
    small = np.sqrt(slender(request.robot))
    return {
        "from": request.uniform(0.2, 0.7),
        "share": request.uniform(0.5, 0.9),
        "rows": request.log_uniform(2.0, 15.0),
        **request.direction(request.sized(6e-5, 2.5e-3) / small),
    }


def _share(form: str, p: Mapping[str, float], turn_of: Array, rows: int) -> Array:
    """Return which share of its whole way a reflector has slipped when it is a row's turn, of so many."""
    since = turn_of - round(p["from"] * rows)
    slipped = np.where(since >= 0.0, p["share"], 0.0)
    if form == "two-slips":
        slipped += np.where(turn_of >= round(p["again"] * rows), 1.0 - p["share"], 0.0)
    else:  # a magnet that was knocked crawls on
        slipped += np.where(since >= 0.0, -(1.0 - p["share"]) * np.expm1(-since / p["rows"]), 0.0)
    return slipped


def _slip(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    node = machine.node(machine.tcp if truth.component is None else truth.component)

    def change(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        rows = len(campaign)
        order = np.argsort(times(campaign), kind="stable")
        turn_of = np.empty(rows)
        turn_of[order] = np.arange(rows)
        slipped = _share(truth.form, p, turn_of, rows)
        if campaign.kind == "displacement":  # from where it was before the pose, or the row
            before = np.empty(rows)
            for pose in np.unique(campaign.pose):
                its = campaign.pose == pose
                first = slipped[its][np.argmin(turn_of[its])]
                before[its] = first if campaign.shared_unloaded else slipped[its]
            slipped = slipped - before
        away = placed.rotations[node.frame] @ vector(p) * slipped[:, None]
        away = np.where((campaign.point == node.name)[:, None], away, 0.0)
        return np.concatenate([values[:, :3] + away, values[:, 3:]], axis=1)

    return reality.with_reading(change)


def came_to_rest(truth: Truth, rows: int) -> Truth:
    """Return the slip as a later campaign finds it: where the last of so many rows left it."""
    p = truth.parameters
    reached = float(_share(truth.form, p, np.array([rows - 1.0]), rows)[0])
    end = {**p, **{name: reached * p[name] for name in "xyz"}, "from": 0.0, "share": 1.0}
    if truth.form == "two-slips":
        end["again"] = 0.0
    return dataclasses.replace(truth, parameters=end)


EFFECTS = (
    effect_of("angle-curve", open_drives, {"cardan": Form(_cardan, _curve), "scar": Form(_scar, _curve)}),
    effect_of(
        "approach-direction",
        open_drives,
        {"long-seal": Form(_worn, _approach), "unequal": Form(_forward, _approach)},
    ),
    effect_of("target-slip", nowhere, {"two-slips": Form(_twice, _slip), "crawl": Form(_crawl, _slip)}),
)
