"""Further forms at the tool: a load cell on struts, a flange that opens, a load that finds its own place."""

import math
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, sprung
from beamstiff.exam.campaign import Array
from beamstiff.exam.draws import PHASE, by_ratio, direction, each, evenly, sized
from beamstiff.exam.effect import Seen, built, load
from beamstiff.exam.forms.author1 import tool as author1
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import curved
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import Draw, Parameters, vector

NARROW = 0.05  # share of a force across a ring below which its eye does not settle at the rim


def strutted(p: Parameters) -> Array:
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


def _struts(p: Parameters, machine: Machine, _: str) -> Machine:
    return sprung(*behind_flange(machine), -p["behind"] * UP, strutted(p))


def _opening(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a flange that opens from a moment, N m, about x, and a `later` one about y."""
    k = author1.sprung_about(author1.about_tool(p))
    ends = {3: p["opens"] / k[3], 4: p["later"] * p["opens"] / k[4]}
    laws = {
        d: curved(partial(slackening, k=float(k[d]), loose=p["loose"], at=end)) for d, end in ends.items()
    }
    return sprung(*behind_flange(machine), -p["behind"] * UP, k, laws)


def _shackle(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads in a shackle, whose eye slides to where the ring about the TCP is nearest them."""
    force, normal = wrench[:, :3], seen.tool_axes @ vector(p)
    flat = force - np.sum(normal * force, axis=1, keepdims=True) * normal
    size = np.sum(flat**2, axis=1) + NARROW**2 * np.sum(force**2, axis=1)
    return seen.with_arm(wrench, p["away"] * flat / np.sqrt(np.maximum(size, 1e-12))[:, None])


def _strap(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads that hang below the tool whichever way that is turned."""
    g = np.array(seen.machine.robot.gravity)
    down = g / np.linalg.norm(g) if g.any() else np.array([0.0, 0.0, -1.0])
    return seen.with_arm(wrench, np.broadcast_to(p["away"] * down, (len(wrench), 3)))


_SOFT: dict[str, Draw] = {"tilt": sized(*author1.TURN), "behind": evenly(0.02, 0.12)}
_AWAY = each(away=sized(*author1.AWAY))
FORMS = (
    built("tool-compliance", "struts", _struts, **_SOFT,
          **{f"strut{i}": evenly(0.6, 1.0) for i in range(6)},
          lower=evenly(0.04, 0.06), upper=evenly(0.02, 0.04), height=evenly(0.03, 0.06), first=PHASE),
    built("tool-compliance", "opening", _opening, **_SOFT,
          other=evenly(0.6, 1.0), about=evenly(0.3, 1.0), opens=by_ratio(20.0, 200.0),
          later=evenly(1.0, 2.5), loose=evenly(0.25, 0.6)),
    load("tool-offset", "shackle", _shackle, _AWAY, direction()),
    load("tool-offset", "strap", _strap, _AWAY),
)  # fmt: skip
