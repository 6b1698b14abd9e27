"""Further forms of soft structure: base, bearings and links."""

import dataclasses
import math
from functools import partial

import numpy as np

from beamstiff.exam.added_parts import about_x, ends_of, on_pedestal
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import slender
from beamstiff.exam.draws import evenly, whole
from beamstiff.exam.effect import built
from beamstiff.exam.forms.author1 import structure as author1
from beamstiff.exam.laws import Curved, curved
from beamstiff.exam.layout import tip_stiffness
from beamstiff.exam.machine import Bar, Hinge, Machine, Profile, joints_of, tapered
from beamstiff.exam.parameters import Parameters
from beamstiff.exam.rotations import cross_matrix, turn

STIFF = author1.STIFF


def _three_feet(p: Parameters, machine: Machine, _: str) -> Machine:
    angles = p["first"] + 2.0 * math.pi / 3.0 * np.arange(3)
    feet = p["radius"] * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
    shares = np.array([p[f"foot{i}"] for i in range(3)])
    k = 1.0 / (p["tilt"] * float(shares @ feet[:, 1] ** 2))
    K = np.zeros((6, 6))
    for foot, share in zip(feet, shares, strict=True):
        X = np.concatenate([np.eye(3), -cross_matrix(foot)], axis=1)  # what the foot moves by
        K += X.T @ np.diag(k * share * np.array([p["across"], p["across"], 1.0])) @ X
    return on_pedestal(machine, K)


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


def _pairs(p: Parameters, machine: Machine, component: str) -> Machine:
    for name, own in joints_of(machine.robot, component):
        machine = machine.with_hinge(_pair(machine.hinge(name), own, p))
    return machine


def _pair(hinge: Hinge, own: int, p: Parameters) -> Hinge:
    """Return the joint held by two bearings a span apart, in series with what it had.

    `uneven`: second bearing's stiffness over the first's.
    """
    k = 2.0 / (p["tilt"] * p["span"] ** 2)
    K = np.diag([1.0 / p["axial"], 0.0, 0.0, STIFF, 0.0, 0.0])
    for place, each in ((0.5, k), (-0.5, p["uneven"] * k)):
        z = p["shift"] + place * p["span"]
        for moved, turned, way in ((1, 5, z), (2, 4, -z)):
            row = np.zeros(6)
            row[moved], row[turned] = 1.0, way
            K += each * (1.0 if moved == 1 else p["other"]) * np.outer(row, row)
    held = [d for d in range(6) if d != own and hinge.stiffness[d] > 0.0]
    before = np.where(np.isinf(hinge.stiffness), STIFF, hinge.stiffness)
    result = np.diag(before)
    soft = np.linalg.inv(K[np.ix_(held, held)]) + np.diag(1.0 / before[held])
    result[np.ix_(held, held)] = np.linalg.inv(soft)
    axes = hinge.axes @ about_x(p["turned"])
    return dataclasses.replace(hinge, axes=axes, stiffness=0.5 * (result + result.T))


def _hollow(p: Parameters, machine: Machine, name: str) -> Machine:
    """Return the machine with a thin-walled conical link; `shear`: over E A, what stands against it."""
    if "softer" in p:
        return machine.with_profile(name, lambda was: _thinner(p, was))
    nodes = dict(machine.rigids)[name]
    machine = machine.without(name)
    EI, EA = p["EI"], p["EI"] / 0.12**2
    rigidity = np.array([EA, p["shear"] * EA, p["shear"] * EA, p["twist"] * EI, p["flat"] * EI, EI])
    profile = tapered(rigidity, lambda x: 1.0 - p["narrower"] * x, 3.0)  # a thin wall of one thickness
    placed, a, b = ends_of(machine, nodes)
    axes = placed.rotations[machine.node(nodes[0]).frame][0]
    along = axes.T @ (b - a) / np.linalg.norm(b - a)
    up = turn(p["skew"] * along) @ author1.up_of(machine, nodes)
    return machine.plus(bars=(Bar(name, nodes, profile, up),))


def _thinner(p: Parameters, was: Profile) -> Profile:
    swell = (1.0 - p["narrower"] * was.stations) ** -3
    swell = 1.0 + (p["softer"] - 1.0) * swell / np.average(swell, weights=was.compliance[:, 0])
    share = np.array([0.5, 1.0, 1.0, 1.0, 1.0, 1.0])  # walls that buckle bend more than they stretch
    return Profile(was.stations, was.compliance * (1.0 + share * (swell[:, None] - 1.0)))


def _bolted(p: Parameters, machine: Machine, name: str) -> Machine:
    """Return the machine with a link that is bolted at one `end`, a `joint` that `opens` about one axis.

    `joint`: its share of the bending.
    """
    if "softer" in p:
        more = p["softer"] - 1.0
        return machine.with_profile(name, lambda was: _with_joint(p, was, more * was.compliance.sum(axis=0)))
    nodes = dict(machine.rigids)[name]
    machine = machine.without(name)
    EI, EA = p["EI"], p["EI"] / 0.12**2
    rigidity = np.array([EA, np.inf, np.inf, p["twist"] * EI, p["flat"] * EI, EI])
    even = tapered(rigidity, lambda x: np.ones_like(x))
    rest = Profile(even.stations, (1.0 - p["joint"]) * even.compliance)
    profile = _with_joint(p, rest, p["joint"] * (1.0 / rigidity))
    return machine.plus(bars=(Bar(name, nodes, profile, author1.up_of(machine, nodes)),))


def _with_joint(p: Parameters, was: Profile, soft: Array) -> Profile:
    joint = soft * np.array([0.0, 0.0, 0.0, 0.5, p["opens"], 1.0])
    return Profile(np.append(was.stations, p["end"]), np.concatenate([was.compliance, joint[None]]))


FORMS = (
    built("base-compliance", "three-feet", _three_feet,
          tilt=author1.TILT, **{f"foot{i}": evenly(0.3, 1.0) for i in range(3)},
          first=evenly(0.0, 2.0 * math.pi), radius=evenly(0.3, 0.6), across=evenly(0.2, 0.6)),
    built("base-compliance", "column", _column,
          tilt=author1.TILT, height=evenly(0.3, 1.2), flat=evenly(0.5, 1.0), twist=evenly(0.4, 0.8),
          taper=evenly(0.0, 0.3), turned=evenly(0.0, math.pi)),
    built("base-compliance", "mounts", _mounts,
          tilt=author1.TILT, about_y=evenly(0.5, 1.0), about_z=evenly(0.1, 0.5), lever=evenly(0.1, 0.3),
          moment=lambda request: 4e3 * request.uniform(0.5, 2.0) / slender(request.robot) ** 2,
          more=evenly(0.8, 2.5)),
    built("bearing-tilt", "hertz", partial(author1.with_tilting, _hertz),
          author1.draw_bearing, moment=lambda request: 2e3 * request.uniform(0.3, 1.5)),
    built("bearing-tilt", "pair", _pairs,
          author1.draw_bearing, span=evenly(0.1, 0.3), uneven=evenly(0.4, 1.0), shift=evenly(-0.1, 0.1)),
    built("link-bending", "hollow", _hollow,
          author1.draw_link, shear=evenly(0.1, 0.25), skew=evenly(0.0, math.pi), narrower=evenly(0.1, 0.5)),
    built("link-bending", "bolted", _bolted,
          author1.draw_link, end=whole(0, 2), joint=evenly(0.3, 0.6), opens=evenly(0.3, 0.8)),
)  # fmt: skip
