"""Further forms of soft structure: base, bearings and links."""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from beamstiff.exam.added_parts import on_pedestal
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, in_the_middle, nowhere, slender
from beamstiff.exam.forms.author1 import structure as author1
from beamstiff.exam.laws import Curve
from beamstiff.exam.layout import tip_stiffness
from beamstiff.exam.machine import Bar, Hinge, Profile, joints_of, tapered
from beamstiff.exam.reality import Reality
from beamstiff.exam.rotations import cross_matrix, turn

Curved = tuple[Array, Array]
STIFF = 1e12  # N/m or N m/rad: a full matrix knows no rigid directions


def _draw_base(request: DrawRequest) -> dict[str, float]:
    found = {"tilt": request.sized(*author1.BASE_TILT) * slender(request.robot)}
    if request.form == "three-feet":
        return (
            found
            | {f"foot{i}": request.uniform(0.3, 1.0) for i in range(3)}
            | {
                "first": request.uniform(0.0, 2.0 * math.pi),
                "radius": request.uniform(0.3, 0.6),
                "across": request.uniform(0.2, 0.6),
            }
        )
    if request.form == "column":
        return found | {
            "height": request.uniform(0.3, 1.2),
            "flat": request.uniform(0.5, 1.0),
            "twist": request.uniform(0.4, 0.8),
            "taper": request.uniform(0.0, 0.3),
            "turned": request.uniform(0.0, math.pi),
        }
    return found | {
        "about_y": request.uniform(0.5, 1.0),
        "about_z": request.uniform(0.1, 0.5),
        "lever": request.uniform(0.1, 0.3),  # m, of the translations
        "moment": 4e3 * request.uniform(0.5, 2.0) / slender(request.robot) ** 2,
        "more": request.uniform(0.8, 2.5),  # stiffness gained
    }


def _base(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    if truth.form == "three-feet":
        angles = p["first"] + 2.0 * math.pi / 3.0 * np.arange(3)
        feet = p["radius"] * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
        shares = np.array([p[f"foot{i}"] for i in range(3)])
        k = 1.0 / (p["tilt"] * float(shares @ feet[:, 1] ** 2))
        K = np.zeros((6, 6))
        for foot, share in zip(feet, shares, strict=True):
            X = np.concatenate([np.eye(3), -cross_matrix(foot)], axis=1)  # what the foot moves by
            K += X.T @ np.diag(k * share * np.array([p["across"], p["across"], 1.0])) @ X
        return reality.with_machine(on_pedestal(machine, K))
    if truth.form == "column":
        return reality.with_machine(on_pedestal(machine, _column(p)))

    # rubber under the feet: it stiffens where it is squeezed
    about = p["tilt"] * np.array([1.0, p["about_y"], p["about_z"]])
    springs = np.concatenate([1.0 / (about * p["lever"] ** 2), 1.0 / about])

    def rubber(e: Array, stiffness: float) -> Curved:
        x = np.abs(e) * stiffness / p["moment"]
        share = x / (1.0 + x)
        slope = stiffness * (1.0 + p["more"] * (share + x / (1.0 + x) ** 2))
        return stiffness * e * (1.0 + p["more"] * share), slope

    laws = {d: Curve(lambda e, d=d: rubber(e, float(springs[d]))) for d in (3, 4)}  # type: ignore[misc]
    return reality.with_machine(on_pedestal(machine, springs, laws))


def _column(p: Mapping[str, float]) -> Array:
    """Return the stiffness, base axes, of the top of an upright hollow column that is clamped below."""
    EI = p["height"] / p["tilt"]
    EA = EI / 0.15**2
    rigidity = np.array([EA, 0.15 * EA, 0.15 * EA, p["twist"] * EI, EI * p["flat"], EI])
    profile = tapered(rigidity, lambda x: 1.0 + p["taper"] * (0.5 - x), 3.0)
    K = tip_stiffness(profile, np.array([p["height"]]))[0]
    c, s = math.cos(p["turned"]), math.sin(p["turned"])
    axes = np.array([[0.0, c, -s], [0.0, s, c], [1.0, 0.0, 0.0]])
    turned = np.kron(np.eye(2), axes)
    return np.asarray(turned @ K @ turned.T)


def _draw_bearing(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_bearing(request)
    if request.form == "hertz":
        return found | {"moment": 2e3 * request.uniform(0.3, 1.5)}
    return found | {
        "span": request.uniform(0.1, 0.3),
        "uneven": request.uniform(0.4, 1.0),  # second bearing's stiffness over the first's
        "shift": request.uniform(-0.1, 0.1),
    }


def _bearing(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    if truth.form == "hertz":
        return author1.with_tilting(truth, reality, lambda e, k: _hertz(e, k, p["moment"] * p["tilt"]))
    machine = reality.machine
    for name, own in joints_of(machine.robot, str(truth.component)):
        machine = machine.with_hinge(_pair(machine.hinge(name), own, p))
    return reality.with_machine(machine)


def _hertz(e: Array, k: float, strain: float) -> Curved:
    """Balls on a ring: as each one's force grows with its approach's power 3/2, past a light preload."""
    root = np.sqrt(1.0 + np.abs(e) / strain)
    return 0.8 * k * e * root, 0.8 * k * (root + 0.5 * np.abs(e) / strain / root)


def _pair(hinge: Hinge, own: int, p: Mapping[str, float]) -> Hinge:
    """Return the joint held by two bearings a span apart, in series with what it had."""
    c, s = math.cos(p["turned"]), math.sin(p["turned"])
    axes = hinge.axes @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
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
    return dataclasses.replace(hinge, axes=axes, stiffness=0.5 * (result + result.T))


def _draw_link(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_link(request)
    if request.form == "hollow":
        found |= {
            "shear": request.uniform(0.1, 0.25),  # G A over E A, what of it stands against shear
            "skew": request.uniform(0.0, math.pi),
            "narrower": request.uniform(0.1, 0.5),
        }
    else:
        found |= {
            "end": request.integer(0, 2),
            "joint": request.uniform(0.3, 0.6),  # share of the bolted joint in the bending
            "opens": request.uniform(0.3, 0.8),  # its give about the other axis
        }
    return found


def _link(truth: Truth, reality: Reality) -> Reality:
    machine, p = reality.machine, truth.parameters
    if "softer" in p:
        bars = tuple(_softer(bar, truth) if bar.name == truth.component else bar for bar in machine.bars)
        return reality.with_machine(dataclasses.replace(machine, bars=bars))
    nodes = next(nodes for name, nodes in machine.rigids if name == truth.component)
    machine = machine.without(str(truth.component))
    up = author1.up_of(machine, nodes)
    EI, EA = p["EI"], p["EI"] / 0.12**2
    if truth.form == "hollow":
        rigidity = np.array([EA, p["shear"] * EA, p["shear"] * EA, p["twist"] * EI, p["flat"] * EI, EI])
        profile = tapered(rigidity, lambda x: 1.0 - p["narrower"] * x, 3.0)  # a thin wall of one thickness
        placed_up = _skewed(reality, nodes, up, p["skew"])
        bar = Bar(str(truth.component), nodes, profile, placed_up)
    else:
        rigidity = np.array([EA, np.inf, np.inf, p["twist"] * EI, p["flat"] * EI, EI])
        even = tapered(rigidity, lambda x: np.ones_like(x))
        bar = Bar(str(truth.component), nodes, _bolted(even, 1.0 / rigidity, p), up)
    return reality.with_machine(machine.plus(bars=(bar,)))


def _skewed(reality: Reality, nodes: tuple[str, str], up: Array, angle: float) -> Array:
    """Return a direction across a link, turned about it by an angle; the frame of its first node."""
    machine = reality.machine
    placed = in_the_middle(machine.robot)
    a, b = (placed.node(machine.node(n))[0] for n in nodes)
    axes = placed.rotations[machine.node(nodes[0]).frame][0]
    along = axes.T @ (b - a) / np.linalg.norm(b - a)
    return np.asarray(turn(angle * along) @ up)


def _bolted(even: Profile, soft: Array, p: Mapping[str, float]) -> Profile:
    """Return a beam's profile with part of its bending in a joint at one end, that opens about one axis."""
    joint = p["joint"] * soft * np.array([0.0, 0.0, 0.0, 0.5, p["opens"], 1.0])
    rest = (1.0 - p["joint"]) * even.compliance
    return Profile(np.append(even.stations, p["end"]), np.concatenate([rest, joint[None]]))


def _softer(bar: Bar, truth: Truth) -> Bar:
    """Return a beam of the model that is softer than it says: thin-walled and conical, or bolted."""
    p, was = truth.parameters, bar.profile
    if truth.form == "hollow":
        swell = (1.0 - p["narrower"] * was.stations) ** -3
        swell = 1.0 + (p["softer"] - 1.0) * swell / np.average(swell, weights=was.compliance[:, 0])
        share = np.array([0.5, 1.0, 1.0, 1.0, 1.0, 1.0])  # walls that buckle bend more than they stretch
        more = 1.0 + share * (swell[:, None] - 1.0)
        return dataclasses.replace(bar, profile=Profile(was.stations, was.compliance * more))
    whole = was.compliance.sum(axis=0)
    joint = (p["softer"] - 1.0) * whole * np.array([0.0, 0.0, 0.0, 0.5, p["opens"], 1.0])
    stations = np.append(was.stations, p["end"])
    return dataclasses.replace(bar, profile=Profile(stations, np.concatenate([was.compliance, joint[None]])))


EFFECTS = (
    Effect("base-compliance", ("three-feet", "column", "mounts"), nowhere, _draw_base, _base),
    Effect("bearing-tilt", ("hertz", "pair"), author1.bearings, _draw_bearing, _bearing),
    Effect("link-bending", ("hollow", "bolted"), author1.links, _draw_link, _link),
)
