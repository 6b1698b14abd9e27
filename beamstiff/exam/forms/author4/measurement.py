"""Loads that are not as read, and what is wrong with the reading: frame, drift and bad rows."""

from collections.abc import Callable
from functools import partial

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign
from beamstiff.exam.components import slender
from beamstiff.exam.draws import PHASE, SEED, by_ratio, by_reach, direction, each, evenly, sized
from beamstiff.exam.effect import Seen, load, places_of, reading
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.rotations import cross_matrix, turn, turned_by

QUICK, SLOW = ([f"{name}_{axis}" for axis in "xyz"] for name in ("quick", "slow"))
MARKS = [f"{axis}{at}" for at in range(3) for axis in "xyz"]
PAUSE = 30.0  # s between rows where the campaign gives no time
TRACKER = 0.01  # an absolute range is this much better than the gain of a displacement
BALLS = np.array([[0.5, 0.3, 0.0], [-0.5, 0.3, 0.0], [0.0, -0.6, 0.0]])  # m: base marks


def times(campaign: SimulatedCampaign) -> Array:
    """Return the rows' times (N,), s, since the first."""
    time = np.where(np.isnan(campaign.time), PAUSE * np.arange(len(campaign)), campaign.time)
    return np.asarray(time - time.min())


def _hook(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads with a hook that was not tared: it hangs wherever a load does."""
    down = np.array(seen.machine.robot.gravity, dtype=np.float64)
    down = down / np.linalg.norm(down) if np.linalg.norm(down) > 0.0 else np.array([0.0, 0.0, -1.0])
    hangs = np.linalg.norm(wrench[:, :3], axis=1) > 0.0
    return np.concatenate(
        [wrench[:, :3] + np.where(hangs, p["weight"], 0.0)[:, None] * down, wrench[:, 3:]], axis=1
    )


def _anchor(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads by a rope that runs to where it was anchored for the middle posture."""
    size = np.linalg.norm(wrench[:, :3], axis=1)
    machine, campaign = seen.machine, seen.campaign
    away = machine.places(machine.tcp) - places_of(machine, campaign.load_point, seen.placed)
    rope = away + p["distance"] * wrench[:, :3] / np.maximum(size, 1e-12)[:, None]
    force = size[:, None] * rope / np.linalg.norm(rope, axis=1, keepdims=True)
    return np.concatenate([force, wrench[:, 3:]], axis=1)


def _draw_sight(request: DrawRequest) -> dict[str, float]:
    turned = request.sized(1.5e-3, 6e-2) * request.sign()
    gain = turned * request.uniform(0.3, 1.0) * request.sign()
    return {"turned": turned, "gain": gain} | request.drawn(bearing=PHASE, distance=evenly(3.0, 9.0))


def by_marks(errors: Array) -> tuple[Array, Array]:
    """Return the rotation vector and the shift (3,) that fit errors (3, 3) of the three base marks best."""
    rows = np.concatenate([np.concatenate([-cross_matrix(mark), np.eye(3)], axis=1) for mark in BALLS])
    found = np.linalg.lstsq(rows, errors.reshape(-1), rcond=None)[0]
    return found[:3], found[3:]


def _turned(R: Array, seen: Seen, values: Array) -> Array:
    return turned_by(R @ turn(values[:, 3:])) if seen.absolute else values[:, 3:] @ R.T


def _base_marks(p: Parameters, seen: Seen, values: Array) -> Array:
    vector_, shift = by_marks(vector(p, MARKS).reshape(3, 3))
    R = turn(vector_)
    place = values[:, :3] @ R.T + (shift if seen.absolute else 0.0)
    return np.concatenate([place, _turned(R, seen, values)], axis=1)


def _sight(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values of an instrument on a stand, whose azimuth and range are wrong."""
    place, R = values[:, :3], turn(np.array([0.0, 0.0, p["turned"]]))
    way = np.array([np.cos(p["bearing"]), np.sin(p["bearing"]), 0.0])
    if seen.absolute:
        stand = seen.machine.places(seen.machine.tcp) + p["distance"] * way
        far = np.linalg.norm(place - stand, axis=1, keepdims=True)
        # bent air: the range errs with its square
        place = stand + ((place - stand) * (1.0 + TRACKER * p["gain"] * far / p["distance"])) @ R.T
    else:
        place = (place + p["gain"] * (place @ way)[:, None] * way) @ R.T
    return np.concatenate([place, _turned(R, seen, values)], axis=1)


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


def _two_warmings(p: Parameters, time: Array) -> Array:
    quick, slow = (-np.expm1(-time / p[name])[:, None] for name in ("quick", "slow"))
    return np.asarray(quick * vector(p, QUICK) + slow * vector(p, SLOW))


def _draw_warmings(request: DrawRequest) -> dict[str, float]:
    quick = request.sized(6e-6, 3e-4)
    slow = request.sized(6e-6, 3e-4) * by_ratio(0.5, 2.0)(request)
    found = request.drawn(quick=by_ratio(250.0, 900.0), slow=by_ratio(3600.0, 10800.0))
    return found | request.direction(quick, QUICK) | request.direction(slow, SLOW)


def _drift(at: Callable[[Parameters, Array], Array], p: Parameters, seen: Seen, values: Array) -> Array:
    time, pose = times(seen.campaign), seen.campaign.pose
    zero = np.zeros_like(time)
    if not seen.absolute and seen.campaign.shared_unloaded:  # read anew before every pose
        first = {one: time[pose == one].min() for one in np.unique(pose)}
        zero = np.maximum(np.array([first[one] for one in pose]) - PAUSE, 0.0)
    return np.concatenate([values[:, :3] + (at(p, time) - at(p, zero)), values[:, 3:]], axis=1)


def _bad(burst: bool, p: Parameters, seen: Seen, values: Array) -> Array:
    rng, rows = np.random.default_rng(int(p["seed"])), len(values)
    count = max(1, round(p["share"] * rows))
    off = np.zeros((rows, 3))
    if burst:  # someone leans on the stand for a few rows
        at = (int(rng.integers(rows)) + np.arange(count)) % rows
        near = rng.standard_normal((count, 3))
        off[at] = vector(p) + p["scatter"] * np.linalg.norm(vector(p)) * near
    else:  # the small hand of a dial misread
        at = rng.choice(rows, count, replace=False)
        turns = rng.choice([-1.0, 1.0, 2.0], count, p=[0.4, 0.4, 0.2])
        off[at, rng.integers(3, size=count)] = turns * p["revolution"]
    return np.concatenate([values[:, :3] + off, values[:, 3:]], axis=1)


_SHARE = evenly(0.03, 0.08)
FORMS = (
    load("load-error", "untared-hook", _hook, weight=lambda r: r.sized(3.0, 200.0) / slender(r.robot)),
    load("load-error", "fixed-anchor", _anchor, distance=by_reach(sized(80.0, 3.0))),
    reading("frame-misalignment", "line-of-sight", _sight, _draw_sight),
    reading("frame-misalignment", "base-marks", _base_marks,
            **dict.fromkeys(MARKS, lambda r: r.sized(8e-4, 3e-2) * r.rng.standard_normal())),
    reading("thermal-drift", "two-warmings", partial(_drift, _two_warmings), _draw_warmings),
    reading("thermal-drift", "hall-gate",
            partial(_drift, lambda p, t: hall(t, p["period"], p["phase"], p["open"])[:, None] * vector(p)),
            each(period=by_ratio(900.0, 3600.0), phase=evenly(0.0, 1.0), open=evenly(0.2, 0.45)),
            direction(sized(8e-6, 4e-4))),
    reading("outliers", "burst", partial(_bad, True),
            each(seed=SEED, share=_SHARE, scatter=evenly(0.1, 0.4)), direction(sized(6e-5, 3e-3))),
    reading("outliers", "revolution", partial(_bad, False),
            seed=SEED, share=_SHARE, revolution=sized(5e-5, 2e-3)),
)  # fmt: skip
