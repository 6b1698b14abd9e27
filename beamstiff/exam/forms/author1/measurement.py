"""Loads that are not what the table says, and readings: a wrong frame, drift, a few bad rows."""

from functools import partial

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign
from beamstiff.exam.draws import SEED, always, direction, each, evenly, product, signed, sized
from beamstiff.exam.effect import Seen, load, reading
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.rotations import turn, turned_by

GAIN = (0.008, 0.25)
LOAD_ANGLE = (4e-3, 0.2)  # rad
FRAME_ANGLE = (2e-3, 0.2)  # rad
REGISTERED = 0.01  # share that remains where the frame was fitted to absolute positions
DRIFT = (8e-6, 2e-3)  # m, over the campaign
PAUSE = 30.0  # s
SIZE = (1e-4, 3e-3)  # m
USUAL = 1500.0  # N, at which a gain that grows with the load is told


def _along(p: Parameters, seen: Seen, wrench: Array) -> Array:
    turned = turn(vector(p))
    return np.concatenate([wrench[:, :3] @ turned.T, wrench[:, 3:] @ turned.T], axis=1)


def matrix_of(p: Parameters) -> Array:
    """Return the matrix (3, 3) of parameters ``xx``, ``xy``, ..."""
    return np.array([[p[f"{a}{b}"] for b in "xyz"] for a in "xyz"])


def by_pairs(matrix: Array) -> dict[str, float]:
    """Return a matrix (3, 3) as such parameters."""
    return {f"{a}{b}": float(matrix[i, j]) for i, a in enumerate("xyz") for j, b in enumerate("xyz")}


def _draw_sensor(request: DrawRequest) -> dict[str, float]:
    gain, error = request.sized(*GAIN), request.rng.standard_normal((3, 3))
    error -= np.eye(3) * np.trace(error) / 3.0  # an equal gain of all would be a softer machine
    error *= gain / np.linalg.norm(error, 2)
    return by_pairs(error)


def _sensor(p: Parameters, seen: Seen, wrench: Array) -> Array:
    axes = seen.load_axes
    wrong = axes @ matrix_of(p) @ np.swapaxes(axes, -1, -2)
    more = [(wrong @ part[..., None])[..., 0] for part in (wrench[:, :3], wrench[:, 3:])]
    return np.asarray(wrench + np.concatenate(more, axis=1))


def _quadratic(p: Parameters, seen: Seen, wrench: Array) -> Array:
    size = np.linalg.norm(wrench[:, :3], axis=1, keepdims=True)
    return np.asarray(wrench * (1.0 + p["gain"] * size / p["reference"]))


def _pulley(p: Parameters, seen: Seen, wrench: Array) -> Array:
    return wrench * (1.0 - p["gain"] * _growing(seen.campaign, wrench))[:, None]


def _growing(campaign: SimulatedCampaign, wrench: Array) -> Array:
    """Return 1 where the load grew since the state before in its pose, -1 where it shrank, (N,)."""
    first, state_of, _, turn = campaign.states()
    size = np.linalg.norm(wrench[first], axis=1)
    way = np.where(turn == 0, 1.0, np.sign(np.diff(size, prepend=0.0)))
    last = np.maximum.accumulate(np.where(way == 0.0, 0, np.arange(len(way))))  # a load that stays: as before
    return np.asarray(way[last][state_of])


def _frame(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values in a frame that is turned, and scaled or sheared: its axes are not square."""
    share = REGISTERED if seen.absolute else 1.0
    shear = np.eye(3)
    for name, (i, j) in {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}.items():
        shear[i, j] += share * p.get(name, 0.0)
    R = turn(share * vector(p))
    matrix = (1.0 + share * p.get("scale", 0.0)) * R @ shear
    return np.concatenate([values[:, :3] @ matrix.T, seen_turned(R, seen, values)], axis=1)


def seen_turned(R: Array, seen: Seen, values: Array) -> Array:
    """Return the rotations (N, 3) of values seen in a frame that is turned by R."""
    turned = R @ turn(values[:, 3:])
    return turned_by(turned if seen.absolute else turned @ np.swapaxes(R, -1, -2))


def _drift(form: str, p: Parameters, seen: Seen, values: Array) -> Array:
    """Return readings that drift; `lag`: share of the campaign's time; `turn`: rad per metre of drift."""
    along = vector(p)
    share = since_rest(seen.campaign, _course(form, seen.campaign, p["lag"]))
    ways = np.broadcast_to(along, (len(values), 3))
    if form == "growth":  # the machine grows: away from its base
        ways = seen.places / np.maximum(np.linalg.norm(seen.places, axis=1, keepdims=True), 1e-9)
    drift = p["drift"] * share[:, None] * ways
    turned = p["turn"] * p["drift"] * share[:, None] * np.roll(along, 1)
    return np.asarray(values + np.concatenate([drift, turned], axis=1))


def _course(form: str, campaign: SimulatedCampaign, lag: float) -> Array:
    """Return how much of the drift has happened in each row, (N,), 0 at the start."""
    time = since_start(campaign)
    whole = float(time.max()) or 1.0
    if form != "lagged-temperature" or np.isnan(campaign.temperature).any():
        return np.asarray((1.0 - np.exp(-time / (lag * whole))) / (1.0 - np.exp(-1.0 / lag)))
    order = np.argsort(time, kind="stable")
    heat = campaign.temperature[order]
    felt = np.empty(len(order))
    felt[0] = heat[0]
    for at in range(1, len(order)):
        fade = np.exp(-(time[order[at]] - time[order[at - 1]]) / (0.3 * lag * whole))
        felt[at] = heat[at] + (felt[at - 1] - heat[at]) * fade
    span = float(np.abs(felt - felt[0]).max()) or 1.0
    share = np.empty(len(order))
    share[order] = (felt - felt[0]) / span
    return share


def since_start(campaign: SimulatedCampaign) -> Array:
    """Return the time of each row from the first one, (N,), s; even where the campaign gives none."""
    rows = np.lexsort((campaign.step, campaign.pose))
    clock = np.empty(len(rows))
    clock[rows] = PAUSE * np.arange(len(rows))
    time = np.where(np.isnan(campaign.time), clock, campaign.time)
    return np.asarray(time - time.min())


def part_of(campaign: SimulatedCampaign) -> Array:
    """Return which part of the campaign's time has passed in each row, (N,)."""
    time = since_start(campaign)
    return np.asarray(time / (float(time.max()) or 1.0))


def since_rest(campaign: SimulatedCampaign, share: Array) -> Array:
    """Return a drift (N,) less that at the pose's first row, where its rows share that unloaded reading."""
    if not (campaign.shared_unloaded and campaign.kind == "displacement"):
        return share
    first, state_of, _, turn = campaign.states()
    start = np.arange(len(turn)) - turn  # each pose's first state
    return np.asarray(share - share[first[start][state_of]])


def _outliers(spikes: bool, p: Parameters, seen: Seen, values: Array) -> Array:
    rng = np.random.default_rng(int(p["seed"]))
    count = max(1, round(p["share"] * len(values)))
    rows = rng.choice(len(values), size=count, replace=False)
    values = values.copy()
    if spikes:  # one component each
        values[rows, rng.integers(3, size=count)] += p["size"] * rng.choice([-1.0, 1.0], size=count)
    else:  # the reflector was touched, or the beam broken
        jump = rng.standard_normal((count, 6)) * np.repeat([p["size"], 2.0 * p["size"]], 3) / np.sqrt(3.0)
        values[rows] += jump * rng.uniform(0.5, 1.5, size=(count, 1))
    return values


_ANGLE = sized(*FRAME_ANGLE)
_GAIN, _SIZE, _SHARE = sized(*GAIN), sized(*SIZE), evenly(0.01, 0.05)
FORMS = (
    load("load-error", "direction", _along, direction(sized(*LOAD_ANGLE))),
    load("load-error", "sensor", _sensor, _draw_sensor),
    load("load-error", "quadratic", _quadratic,
         gain=signed(_GAIN), reference=always(USUAL)),
    load("load-error", "pulley", _pulley, gain=_GAIN),
    reading("frame-misalignment", "turned", _frame, direction(_ANGLE)),
    reading("frame-misalignment", "scaled", _frame,
            direction(_ANGLE), scale=product(_ANGLE, evenly(-0.3, 0.3))),
    reading("frame-misalignment", "sheared", _frame,
            direction(_ANGLE), **dict.fromkeys(("xy", "xz", "yz"), product(_ANGLE, evenly(-0.5, 0.5)))),
    *(reading("thermal-drift", name, partial(_drift, name),
              each(drift=sized(*DRIFT), lag=evenly(0.1, 0.7)), direction(), turn=evenly(0.0, 0.3))
      for name in ("lagged-time", "lagged-temperature", "growth")),
    reading("outliers", "spikes", partial(_outliers, True), size=_SIZE, share=_SHARE, seed=SEED),
    reading("outliers", "jumps", partial(_outliers, False), size=_SIZE, share=_SHARE, seed=SEED),
)  # fmt: skip
