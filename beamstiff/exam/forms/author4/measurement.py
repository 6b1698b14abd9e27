"""Loads that are not as read, and what is wrong with the reading: frame, drift and bad rows."""

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, in_the_middle, nowhere, slender, vector
from beamstiff.exam.forms.author4.by_form import Form, effect_of, prefixed, way_of
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality, places_of
from beamstiff.exam.rotations import cross_matrix, turn, turned_by

PAUSE = 30.0  # s between rows where the campaign gives no time
TRACKER = 0.01  # an absolute range is this much better than the gain of a displacement
BALLS = np.array([[0.5, 0.3, 0.0], [-0.5, 0.3, 0.0], [0.0, -0.6, 0.0]])  # m: base marks


def times(campaign: SimulatedCampaign) -> Array:
    """Return the rows' times (N,), s, since the first."""
    time = np.where(np.isnan(campaign.time), PAUSE * np.arange(len(campaign)), campaign.time)
    return np.asarray(time - time.min())


def _hook(request: DrawRequest) -> dict[str, float]:
    return {"weight": request.sized(3.0, 200.0) / slender(request.robot)}


def _anchor(request: DrawRequest) -> dict[str, float]:
    return {"distance": request.sized(80.0, 3.0) / np.sqrt(slender(request.robot))}


def _load(truth: Truth, reality: Reality) -> Reality:
    p, robot = truth.parameters, reality.machine.robot
    down = np.array(robot.gravity, dtype=np.float64)
    down = down / np.linalg.norm(down) if np.linalg.norm(down) > 0.0 else np.array([0.0, 0.0, -1.0])
    start = in_the_middle(robot).node(reality.machine.node(robot.tcp))[0]

    def change(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        size = np.linalg.norm(wrench[:, :3], axis=1)
        force = wrench[:, :3].copy()
        if truth.form == "untared-hook":  # hangs wherever a load does
            force += np.where(size > 0.0, p["weight"], 0.0)[:, None] * down
        else:  # the rope runs to where it was anchored for the middle posture
            here = places_of(reality.machine, campaign.load_point, placed)
            rope = start - here + p["distance"] * force / np.maximum(size, 1e-12)[:, None]
            force = size[:, None] * rope / np.linalg.norm(rope, axis=1, keepdims=True)
        return np.concatenate([force, wrench[:, 3:]], axis=1)

    return reality.with_load(change)


def _sight(request: DrawRequest) -> dict[str, float]:
    turned = request.sized(1.5e-3, 6e-2) * request.sign()
    return {
        "turned": turned,
        "gain": turned * request.uniform(0.3, 1.0) * request.sign(),
        "bearing": request.uniform(0.0, 2.0 * np.pi),
        "distance": request.uniform(3.0, 9.0),
    }


def _marks(request: DrawRequest) -> dict[str, float]:
    size = request.sized(8e-4, 3e-2)
    drawn = request.rng.standard_normal(9)
    return {f"{axis}{at}": size * float(drawn[3 * at + i]) for at in range(3) for i, axis in enumerate("xyz")}


def by_marks(errors: Array) -> tuple[Array, Array]:
    """Return the rotation vector and the shift (3,) that fit errors (3, 3) of the three base marks best."""
    rows = np.concatenate([np.concatenate([-cross_matrix(mark), np.eye(3)], axis=1) for mark in BALLS])
    found = np.linalg.lstsq(rows, errors.reshape(-1), rcond=None)[0]
    return found[:3], found[3:]


def _frame(truth: Truth, reality: Reality) -> Reality:
    p, robot = truth.parameters, reality.machine.robot
    tcp = next(node for node in robot.nodes if node.name == robot.tcp)
    middle = in_the_middle(robot).node(tcp)[0]

    def change(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        place, absolute = values[:, :3], campaign.kind == "absolute"
        if truth.form == "base-marks":
            vector_, shift = by_marks(np.array([[p[f"{axis}{at}"] for axis in "xyz"] for at in range(3)]))
            R = turn(vector_)
            place = place @ R.T + (shift if absolute else 0.0)
        else:  # an instrument on a stand: its azimuth and its range
            R = turn(np.array([0.0, 0.0, p["turned"]]))
            way = np.array([np.cos(p["bearing"]), np.sin(p["bearing"]), 0.0])
            stand = middle + p["distance"] * way
            if absolute:
                seen = place - stand
                far = np.linalg.norm(seen, axis=1, keepdims=True)
                # bent air: the range errs with its square
                place = stand + (seen * (1.0 + TRACKER * p["gain"] * far / p["distance"])) @ R.T
            else:
                place = (place + p["gain"] * (place @ way)[:, None] * way) @ R.T
        turned = turned_by(R @ turn(values[:, 3:])) if absolute else values[:, 3:] @ R.T
        return np.concatenate([place, turned], axis=1)

    return reality.with_reading(change)


def _two_warmings(request: DrawRequest) -> dict[str, float]:
    quick = request.sized(6e-6, 3e-4)
    slow = request.sized(6e-6, 3e-4) * request.log_uniform(0.5, 2.0)
    return {
        "quick": request.log_uniform(250.0, 900.0),
        "slow": request.log_uniform(3600.0, 10800.0),
        **way_of(request, quick, "quick_"),
        **way_of(request, slow, "slow_"),
    }


def _hall(request: DrawRequest) -> dict[str, float]:
    return {
        "period": request.log_uniform(900.0, 3600.0),
        "phase": request.uniform(0.0, 1.0),
        "open": request.uniform(0.2, 0.45),
        **request.direction(request.sized(8e-6, 4e-4)),
    }


def hall(time: Array, period: float, phase: float, open_: float) -> Array:
    """Return how far a hall has cooled (0 to 1) that a gate cools and heaters warm in turn, periodically.

    Both exponentially, with a fifth of the period as time constant.
    """
    part = np.mod(time / period + phase, 1.0)
    rate = 5.0
    down, up = np.exp(-rate * open_), np.exp(-rate * (1.0 - open_))
    low = (1.0 - down) * up / (1.0 - down * up)  # where a cooling starts, in the steady cycle
    cooled = 1.0 - (1.0 - low) * np.exp(-rate * np.minimum(part, open_))
    return np.asarray(cooled * np.exp(-rate * np.maximum(part - open_, 0.0)))


def _drift(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters

    def at(time: Array) -> Array:
        if truth.form == "hall-gate":
            return hall(time, p["period"], p["phase"], p["open"])[:, None] * vector(p)
        quick, slow = (-np.expm1(-time / p[name])[:, None] for name in ("quick", "slow"))
        return np.asarray(quick * prefixed(p, "quick_") + slow * prefixed(p, "slow_"))

    def change(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        time = times(campaign)
        zero = np.zeros_like(time)
        if campaign.kind == "displacement" and campaign.shared_unloaded:  # read anew before every pose
            first = {pose: time[campaign.pose == pose].min() for pose in np.unique(campaign.pose)}
            zero = np.maximum(np.array([first[pose] for pose in campaign.pose]) - PAUSE, 0.0)
        moved = at(time) - at(zero)
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    return reality.with_reading(change)


def _burst(request: DrawRequest) -> dict[str, float]:
    return {
        "seed": request.integer(0, 2**31),
        "share": request.uniform(0.03, 0.08),
        "scatter": request.uniform(0.1, 0.4),
        **request.direction(request.sized(6e-5, 3e-3)),
    }


def _revolution(request: DrawRequest) -> dict[str, float]:
    return {
        "seed": request.integer(0, 2**31),
        "share": request.uniform(0.03, 0.08),
        "revolution": request.sized(5e-5, 2e-3),
    }


def _bad(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters

    def change(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        rng, rows = np.random.default_rng(int(p["seed"])), len(values)
        count = max(1, round(p["share"] * rows))
        off = np.zeros((rows, 3))
        if truth.form == "burst":  # someone leans on the stand for a few rows
            at = (int(rng.integers(rows)) + np.arange(count)) % rows
            near = rng.standard_normal((count, 3))
            off[at] = vector(p) + p["scatter"] * np.linalg.norm(vector(p)) * near
        else:  # the small hand of a dial misread
            at = rng.choice(rows, count, replace=False)
            turns = rng.choice([-1.0, 1.0, 2.0], count, p=[0.4, 0.4, 0.2])
            off[at, rng.integers(3, size=count)] = turns * p["revolution"]
        return np.concatenate([values[:, :3] + off, values[:, 3:]], axis=1)

    return reality.with_reading(change)


EFFECTS = (
    effect_of(
        "load-error", nowhere, {"untared-hook": Form(_hook, _load), "fixed-anchor": Form(_anchor, _load)}
    ),
    effect_of(
        "frame-misalignment",
        nowhere,
        {"line-of-sight": Form(_sight, _frame), "base-marks": Form(_marks, _frame)},
    ),
    effect_of(
        "thermal-drift",
        nowhere,
        {"two-warmings": Form(_two_warmings, _drift), "hall-gate": Form(_hall, _drift)},
    ),
    effect_of("outliers", nowhere, {"burst": Form(_burst, _bad), "revolution": Form(_revolution, _bad)}),
)
