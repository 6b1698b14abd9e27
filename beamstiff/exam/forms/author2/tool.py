"""Further forms at the tool: a load cell on struts, a flange that opens, a load that finds its own place."""

import math
from collections.abc import Mapping

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, sprung
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, vector
from beamstiff.exam.forms.author1 import tool as author1
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import Curve
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality

NARROW = 0.05  # share of a force across a ring below which its eye does not settle at the rim


def _draw_soft(request: DrawRequest) -> dict[str, float]:
    found = {"tilt": request.sized(*author1.TURN), "behind": request.uniform(0.02, 0.12)}
    if request.form == "struts":
        return (
            found
            | {f"strut{i}": request.uniform(0.6, 1.0) for i in range(6)}
            | {
                "lower": request.uniform(0.04, 0.06),  # m, radii and height
                "upper": request.uniform(0.02, 0.04),
                "height": request.uniform(0.03, 0.06),
                "first": request.uniform(0.0, 2.0 * math.pi),
            }
        )
    return found | {
        "other": request.uniform(0.6, 1.0),
        "about": request.uniform(0.3, 1.0),
        "opens": request.log_uniform(20.0, 200.0),  # N m about x
        "later": request.uniform(1.0, 2.5),  # moment about y at which it opens, over that about x
        "loose": request.uniform(0.25, 0.6),  # stiffness left
    }


def strutted(p: Mapping[str, float]) -> Array:
    """Return the stiffness (6, 6) of a load cell on six struts, about its middle height."""
    K = np.zeros((6, 6))
    for i in range(6):
        # two struts from either end of a foot's pair lean towards the same place above
        low = p["first"] + math.pi / 3.0 * (i - i % 2) + (0.2 if i % 2 else -0.2)
        high = p["first"] + math.pi / 3.0 * (i - i % 2) + math.pi / 3.0 * (1 if i % 2 else -1)
        a = np.array([p["lower"] * math.cos(low), p["lower"] * math.sin(low), -0.5 * p["height"]])
        b = np.array([p["upper"] * math.cos(high), p["upper"] * math.sin(high), 0.5 * p["height"]])
        along = (b - a) / np.linalg.norm(b - a)
        row = np.concatenate([along, np.cross(a, along)])
        K += p[f"strut{i}"] * np.outer(row, row)
    return np.asarray(K * np.linalg.inv(K)[3, 3] / p["tilt"])


def _soft(truth: Truth, reality: Reality) -> Reality:
    p, (machine, flange) = truth.parameters, behind_flange(reality.machine)
    at = -p["behind"] * UP
    if truth.form == "struts":
        return reality.with_machine(sprung(machine, flange, at, strutted(p)))
    about = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    k = np.concatenate([1.0 / (about * 0.05**2), 1.0 / about])
    ends = {3: p["opens"] / k[3], 4: p["later"] * p["opens"] / k[4]}
    laws = {
        d: Curve(lambda e, d=d, end=end: slackening(e, float(k[d]), p["loose"], end))  # type: ignore[misc]
        for d, end in ends.items()
    }
    return reality.with_machine(sprung(machine, flange, at, k, laws))


def _draw_offset(request: DrawRequest) -> dict[str, float]:
    found = {"away": request.sized(*author1.AWAY)}
    if request.form == "shackle":
        found |= request.direction()
    return found


def _offset(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a load that hangs beside the TCP.

    In a shackle, its eye slides to where the ring about the TCP is nearest the load; in a strap, it hangs
    below the tool whichever way that is turned.
    """
    p, machine = truth.parameters, reality.machine
    g = np.array(machine.robot.gravity)
    down = g / np.linalg.norm(g) if g.any() else np.array([0.0, 0.0, -1.0])

    def beside(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        force = wrench[:, :3]
        if truth.form == "shackle":
            axes = placed.rotations[machine.node(machine.tcp).frame]
            normal = axes @ vector(p)
            flat = force - np.sum(normal * force, axis=1, keepdims=True) * normal
            size = np.sum(flat**2, axis=1) + NARROW**2 * np.sum(force**2, axis=1)
            arm = p["away"] * flat / np.sqrt(np.maximum(size, 1e-12))[:, None]
        else:
            arm = np.broadcast_to(p["away"] * down, force.shape)
        moment = np.where((campaign.load_point == machine.tcp)[:, None], np.cross(arm, force), 0.0)
        return np.concatenate([force, wrench[:, 3:] + moment], axis=1)

    return reality.with_load(beside)


EFFECTS = (
    Effect("tool-compliance", ("struts", "opening"), nowhere, _draw_soft, _soft),
    Effect("tool-offset", ("shackle", "strap"), nowhere, _draw_offset, _offset),
)
