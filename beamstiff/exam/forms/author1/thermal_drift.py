"""Readings that drift with time or temperature."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality, places_of

DRIFT = (8e-6, 2e-3)  # m, over the campaign
PAUSE = 30.0  # s


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the whole drift, m, its direction, and its lag as a share of the campaign's time."""
    found = {"drift": request.sized(*DRIFT), "lag": request.uniform(0.1, 0.7)}
    found |= request.direction()
    found["turn"] = request.uniform(0.0, 0.3)  # rad per metre of drift
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with readings that drift.

    All drift counts from the start of the campaign, but where the rows of a pose share one unloaded reading,
    from that reading.
    """
    p = truth.parameters
    along = vector(p)

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        share = since_rest(campaign, _course(truth.form, campaign, p["lag"]))
        if truth.form == "growth":  # the machine grows: away from its base
            reach = places_of(reality.machine, campaign, placed)
            ways = reach / np.maximum(np.linalg.norm(reach, axis=1, keepdims=True), 1e-9)
        else:
            ways = np.broadcast_to(along, (len(values), 3))
        drift = p["drift"] * share[:, None] * ways
        turned = p["turn"] * p["drift"] * share[:, None] * np.roll(along, 1)
        return np.asarray(values + np.concatenate([drift, turned], axis=1))

    return reality.with_reading(read)


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
    since: Array = time - time.min()
    return since


def since_rest(campaign: SimulatedCampaign, share: Array) -> Array:
    """Return the share (N,) of a drift less that at the unloaded reading, where a pose's rows share one.

    That reading is taken with the pose's first row.
    """
    if not (campaign.shared_unloaded and campaign.kind == "displacement"):
        return share
    order = np.lexsort((campaign.step, campaign.pose))
    _, first, back = np.unique(campaign.pose[order], return_index=True, return_inverse=True)
    result = np.empty(len(share))
    result[order] = share[order][first][back.reshape(-1)]
    return np.asarray(share - result)


EFFECT = Effect("thermal-drift", ("lagged-time", "lagged-temperature", "growth"), nowhere, draw, impose)
