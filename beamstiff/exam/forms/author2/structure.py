"""Further forms of soft structure, base to tool, a load that finds its own place, and a tether."""

import dataclasses
import math
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import UP, about_x, behind_flange, on_pedestal, sprung, tied_to_ground
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender
from beamstiff.exam.draws import PHASE, by_ratio, direction, each, evenly, sized, whole
from beamstiff.exam.effect import Seen, built, built_at_joints, load
from beamstiff.exam.forms.author1 import structure as structure1
from beamstiff.exam.forms.author1 import tool as tool1
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import Curved, curved
from beamstiff.exam.layout import tip_stiffness
from beamstiff.exam.machine import Bar, Machine, Profile, tapered
from beamstiff.exam.parameters import Draw, Parameters, vector
from beamstiff.exam.rotations import turn

STIFF = structure1.STIFF
NARROW = 0.05  # share of a force across a ring below which its eye does not settle at the rim


def _three_feet(p: Parameters, machine: Machine, _: str) -> Machine:
    angles = p["first"] + 2.0 * math.pi / 3.0 * np.arange(3)
    feet = p["radius"] * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
    shares = np.array([p[f"foot{i}"] for i in range(3)])
    k = 1.0 / (p["tilt"] * float(shares @ feet[:, 1] ** 2))
    return structure1.on_feet(machine, feet, shares * k, p["across"])


def _rubber(stiffness: float, p: Parameters, e: Array) -> Curved:
    x = np.abs(e) * stiffness / p["moment"]
    share = x / (1.0 + x)
    slope = stiffness * (1.0 + p["more"] * (share + x / (1.0 + x) ** 2))
    return stiffness * e * (1.0 + p["more"] * share), slope


def _mounts(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine on rubber, which stiffens where it is squeezed; `lever`: m, of the translations."""
    about = p["tilt"] * np.array([1.0, p["about_y"], p["about_z"]])
    springs = np.concatenate([1.0 / (about * p["lever"] ** 2), 1.0 / about])
    laws = {d: curved(partial(_rubber, float(springs[d]), p)) for d in (3, 4)}
    return on_pedestal(machine, springs, laws)


def _column(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine on an upright hollow column that is clamped below."""
    EI = p["height"] / p["tilt"]
    EA = EI / 0.15**2
    rigidity = np.array([EA, 0.15 * EA, 0.15 * EA, p["twist"] * EI, EI * p["flat"], EI])
    profile = tapered(rigidity, lambda x: 1.0 + p["taper"] * (0.5 - x), 3.0)
    K = tip_stiffness(profile, np.array([p["height"]]))[0]
    c, s = math.cos(p["turned"]), math.sin(p["turned"])
    turned = np.kron(np.eye(2), np.array([[0.0, c, -s], [0.0, s, c], [1.0, 0.0, 0.0]]))
    return on_pedestal(machine, turned @ K @ turned.T)


def _hertz(p: Parameters, k: float, e: Array) -> Curved:
    """Balls on a ring: as each one's force grows with its approach's power 3/2, past a light preload."""
    strain = p["moment"] * p["tilt"]
    root = np.sqrt(1.0 + np.abs(e) / strain)
    return 0.8 * k * e * root, 0.8 * k * (root + 0.5 * np.abs(e) / strain / root)


def _pair(p: Parameters, machine: Machine, joint: str, own: int) -> Machine:
    """Return a joint held by two bearings a span apart; `uneven`: the second's stiffness over the first."""
    k = 2.0 / (p["tilt"] * p["span"] ** 2)
    K = np.diag([1.0 / p["axial"], 0.0, 0.0, STIFF, 0.0, 0.0])
    for place, stiffness in ((0.5, k), (-0.5, p["uneven"] * k)):
        z = p["shift"] + place * p["span"]
        for moved, turned, way in ((1, 5, z), (2, 4, -z)):
            row = np.zeros(6)
            row[moved], row[turned] = 1.0, way
            K += stiffness * (1.0 if moved == 1 else p["other"]) * np.outer(row, row)
    hinge = machine.hinge(joint)
    held = [d for d in range(6) if d != own and hinge.stiffness[d] > 0.0]
    before = np.where(np.isinf(hinge.stiffness), STIFF, hinge.stiffness)
    result = np.diag(before)
    soft = np.linalg.inv(K[np.ix_(held, held)]) + np.diag(1.0 / before[held])
    result[np.ix_(held, held)] = np.linalg.inv(soft)
    axes = hinge.axes @ about_x(p["turned"])
    changed = dataclasses.replace(hinge, axes=axes, stiffness=0.5 * (result + result.T))
    return machine.with_hinge(changed)


def _hollow(p: Parameters, machine: Machine, name: str) -> Machine:
    """Return the machine with a thin-walled conical link; `shear`: over E A, what stands against it."""
    if "softer" in p:
        return machine.with_profile(name, lambda was: _thinner(p, was))
    nodes = dict(machine.rigids)[name]
    machine = machine.without(name)
    EI, EA = p["EI"], p["EI"] / 0.12**2
    rigidity = np.array([EA, p["shear"] * EA, p["shear"] * EA, p["twist"] * EI, p["flat"] * EI, EI])
    profile = tapered(rigidity, lambda x: 1.0 - p["narrower"] * x, 3.0)  # a thin wall of one thickness
    a, b = machine.places(*nodes)
    along = machine.seen_from(nodes[0], b - a) / np.linalg.norm(b - a)
    up = turn(p["skew"] * along) @ structure1.up_of(machine, nodes)
    return machine.plus(bars=(Bar(name, nodes, profile, up),))


def _thinner(p: Parameters, was: Profile) -> Profile:
    swell = (1.0 - p["narrower"] * was.stations) ** -3
    swell = 1.0 + (p["softer"] - 1.0) * swell / np.average(swell, weights=was.compliance[:, 0])
    share = np.array([0.5, 1.0, 1.0, 1.0, 1.0, 1.0])  # walls that buckle bend more than they stretch
    return Profile(was.stations, was.compliance * (1.0 + share * (swell[:, None] - 1.0)))


def _bolted(p: Parameters, machine: Machine, name: str) -> Machine:
    """Return the machine with a link bolted at one `end`: a `joint`, by its share, that `opens` one way."""
    if "softer" in p:
        more = p["softer"] - 1.0
        return machine.with_profile(name, lambda was: _with_joint(p, was, more * was.compliance.sum(axis=0)))
    nodes = dict(machine.rigids)[name]
    machine = machine.without(name)
    EI, EA = p["EI"], p["EI"] / 0.12**2
    rigidity = np.array([EA, np.inf, np.inf, p["twist"] * EI, p["flat"] * EI, EI])
    even = tapered(rigidity, np.ones_like)
    rest = Profile(even.stations, (1.0 - p["joint"]) * even.compliance)
    profile = _with_joint(p, rest, p["joint"] * (1.0 / rigidity))
    return machine.plus(bars=(Bar(name, nodes, profile, structure1.up_of(machine, nodes)),))


def _with_joint(p: Parameters, was: Profile, soft: Array) -> Profile:
    joint = soft * np.array([0.0, 0.0, 0.0, 0.5, p["opens"], 1.0])
    return Profile(np.append(was.stations, p["end"]), np.concatenate([was.compliance, joint[None]]))


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


def _opening(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a flange that opens from a moment, N m, about x, and a `later` one about y."""
    k = tool1.sprung_about(tool1.about_tool(p))
    ends = {3: p["opens"] / k[3], 4: p["later"] * p["opens"] / k[4]}
    loose = {d: {"loose": p["loose"], "from": end} for d, end in ends.items()}
    laws = {d: curved(partial(slackening, pair, float(k[d]))) for d, pair in loose.items()}
    return sprung(*behind_flange(machine), -p["behind"] * UP, k, laws)


def _tether(p: Parameters, machine: Machine, _: str) -> Machine:
    """Something elastic that ties the tool to the ground one way, a taut cable or a steady."""
    return tied_to_ground(machine, "tether", vector(p), np.array([p["stiffness"], 0.0, 0.0, 0.0, 0.0, 0.0]))


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


_SOFT: dict[str, Draw] = {"tilt": sized(*tool1.TURN), "behind": evenly(0.02, 0.12)}
_AWAY = each(away=sized(*tool1.AWAY))


FORMS = (
    built("base-compliance", "three-feet", _three_feet,
          tilt=structure1.TILT, **{f"foot{i}": evenly(0.3, 1.0) for i in range(3)},
          first=evenly(0.0, 2.0 * math.pi), radius=evenly(0.3, 0.6), across=evenly(0.2, 0.6)),
    built("base-compliance", "column", _column,
          tilt=structure1.TILT, height=evenly(0.3, 1.2), flat=evenly(0.5, 1.0), twist=evenly(0.4, 0.8),
          taper=evenly(0.0, 0.3), turned=evenly(0.0, math.pi)),
    built("base-compliance", "mounts", _mounts,
          tilt=structure1.TILT, about_y=evenly(0.5, 1.0), about_z=evenly(0.1, 0.5), lever=evenly(0.1, 0.3),
          moment=lambda request: 4e3 * request.uniform(0.5, 2.0) / slender(request.robot) ** 2,
          more=evenly(0.8, 2.5)),
    built_at_joints("bearing-tilt", "hertz", partial(structure1.with_tilting, _hertz),
                    structure1.draw_bearing, moment=lambda request: 2e3 * request.uniform(0.3, 1.5)),
    built_at_joints("bearing-tilt", "pair", _pair, structure1.draw_bearing,
                    span=evenly(0.1, 0.3), uneven=evenly(0.4, 1.0), shift=evenly(-0.1, 0.1)),
    built("link-bending", "hollow", _hollow, structure1.draw_link,
          shear=evenly(0.1, 0.25), skew=evenly(0.0, math.pi), narrower=evenly(0.1, 0.5)),
    built("link-bending", "bolted", _bolted,
          structure1.draw_link, end=whole(0, 2), joint=evenly(0.3, 0.6), opens=evenly(0.3, 0.8)),
    built("tool-compliance", "struts",
          lambda p, machine, _: sprung(*behind_flange(machine), -p["behind"] * UP, strutted(p)), **_SOFT,
          **{f"strut{i}": evenly(0.6, 1.0) for i in range(6)},
          lower=evenly(0.04, 0.06), upper=evenly(0.02, 0.04), height=evenly(0.03, 0.06), first=PHASE),
    built("tool-compliance", "opening", _opening, **_SOFT,
          other=evenly(0.6, 1.0), about=evenly(0.3, 1.0), opens=by_ratio(20.0, 200.0),
          later=evenly(1.0, 2.5), loose=evenly(0.25, 0.6)),
    load("tool-offset", "shackle", _shackle, _AWAY, direction()),
    load("tool-offset", "strap", _strap, _AWAY),
    built("tether", "straight", _tether, direction(), stiffness=sized(2e4, 4e6)),
)  # fmt: skip
