"""Closed forms of first order: what the tip of the arm does under a wrench, besides its drive."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from beamstiff.exam.campaign import Array
from beamstiff.exam.forms.author2.structure import strutted
from tests.exam.campaigns import LONG

FIRST_ORDER = 2e-4  # what rotations of 1e-4 rad add to the linear answer
TOOL = 1e-3  # likewise of a tool, which is softer
ORIGIN, X, Y, Z = np.zeros(3), *np.eye(3)
TIP = LONG * X

Parameters = Mapping[str, float]
Size = Callable[[Array], Array]


class ClosedForm(NamedTuple):
    """A form at the arm's component, with what is changed of its parameters, and the tip's motion."""

    effect: str
    form: str
    motion: Callable[[Parameters, Array], Array]
    changes: dict[str, float]
    axes: tuple[int, ...] = tuple(range(6))  # of the load
    tolerance: float = FIRST_ORDER


def soft_at(lever: Array, compliance: Array, wrench: Array) -> Array:
    """Return the tip's motion where springs (6,) or (6, 6) sit, from which the lever leads to the tip."""
    there = np.concatenate([wrench[:3], wrench[3:] + np.cross(lever, wrench[:3])])
    moved, turned = np.split((np.diag(compliance) if compliance.ndim == 1 else compliance) @ there, 2)
    return np.concatenate([moved + np.cross(turned, lever), turned])


def bent(
    a: Array, b: Array, wrench: Array, p: Parameters, size: Size = np.ones_like, share: float = 1.0
) -> Array:
    """Return the tip's motion from a beam a to b, stiff beyond, by Mohr's integrals."""
    x, w = np.polynomial.legendre.leggauss(60)
    x, length = 0.5 * (x + 1.0), float(np.linalg.norm(b - a))
    EI = share * p["EI"]
    GJ, EA = p["twist"] * EI, EI / p.get("slender", 0.12) ** 2
    t, moved, turned = (b - a) / length, np.zeros(3), np.zeros(3)
    for station, weight, scale in zip(x, 0.5 * w * length, size(x), strict=True):
        lever = TIP - (a + station * (b - a))
        M, F = wrench[3:] + np.cross(lever, wrench[:3]), wrench[:3]
        curved = (M - (t @ M) * t) / (EI * scale**4) + (t @ M) * t / (GJ * scale**4)
        turned = turned + weight * curved
        sheared = (F - (t @ F) * t) * p.get("shear_give", 0.0)
        moved = moved + weight * (np.cross(curved, lever) + ((t @ F) * t + sheared) / (EA * scale**2))
    return np.concatenate([moved, turned])


def feet(x: Array, y: Array, shares: Array, tilt: float) -> Array:
    """Return the compliance (6, 6) of upright springs under a stiff plate: z and the tilts alone."""
    rise = np.stack([np.ones_like(x), y, -x], axis=-1)
    k = shares / (tilt * np.sum(shares * y**2))
    C = np.zeros((6, 6))
    C[2:5, 2:5] = np.linalg.inv(rise.T @ (k[:, None] * rise))
    return C


def three_around(p: Parameters, name: str) -> Array:
    angles = p["first"] + 2.0 * np.pi / 3.0 * np.arange(3)
    shares = np.array([p[f"{name}{i}"] for i in range(3)])
    return feet(p["radius"] * np.cos(angles), p["radius"] * np.sin(angles), shares, p["tilt"])


def on_bolts(p: Parameters, wrench: Array) -> Array:
    x, y = 0.5 * p["span"] * np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    return soft_at(TIP, feet(x, y, np.array([p[f"bolt{i}"] for i in range(4)]), p["tilt"]), wrench)


def on_a_block(p: Parameters, wrench: Array) -> Array:
    about = np.array([1.0, p["about_y"], p["about_z"]])
    along = p["shift"] ** 2 * np.array([1.0, 0.8, 0.5])
    centre = np.array([p["x"], p["y"], p["z"]])
    return soft_at(TIP - centre, p["tilt"] * np.concatenate([along, about]), wrench)


def on_a_column(p: Parameters, wrench: Array) -> Array:
    beam = {"EI": p["height"] / p["tilt"], "twist": p["twist"], "slender": 0.15, "shear_give": 1.0 / 0.15}
    return bent(-p["height"] * Z, ORIGIN, wrench, beam, lambda x: (1.0 + p["taper"] * (0.5 - x)) ** 0.75)


def on_a_carriage(p: Parameters, wrench: Array) -> Array:
    """Return what four blocks on rails do: in the rails' axes, about their middle, nothing is coupled."""
    k = 1.0 / (4.0 * p["tilt"] * p["wide"] ** 2)
    moved = [1.0 / (p["rack"] * k), 1.0 / (4.0 * p["across"] * k), 1.0 / (4.0 * k)]
    turned = [p["tilt"], 1.0 / (4.0 * k * p["long"] ** 2), 1.0 / (4.0 * p["across"] * k * p["long"] ** 2)]
    rails = np.kron(np.eye(2), Rotation.from_rotvec(p["turned"] * Z).as_matrix())
    return soft_at(TIP + p["low"] * Z, rails @ np.diag([*moved, *turned]) @ rails.T, wrench)


def crossed(p: Parameters) -> tuple[Array, Array]:
    """Return the two directions across the vertical that the bearing's axes are turned to."""
    c, s = np.cos(p["turned"]), np.sin(p["turned"])
    return c * Y - s * X, -c * X - s * Y


def in_a_bearing(p: Parameters, wrench: Array) -> Array:
    one, two = (np.outer(way, way) for way in crossed(p))
    C = np.zeros((6, 6))
    C[:3, :3] = p["radial"] * (one + two) + p["axial"] * np.outer(Z, Z)
    C[3:, 3:] = p["tilt"] * (one + p["other"] * two)
    return soft_at(TIP - p.get("offset", 0.0) * Z, C, wrench)


def in_two_bearings(p: Parameters, wrench: Array) -> Array:
    """Return what two bearings a span apart do, each of which carries its share by the lever rule."""
    heights = p["shift"] + p["span"] * np.array([0.5, -0.5])
    k = 2.0 / (p["tilt"] * p["span"] ** 2) * np.array([1.0, p["uneven"]])
    moment = wrench[3:] + np.cross(TIP, wrench[:3])
    moved, turned = p["axial"] * wrench[2] * Z, np.zeros(3)
    for way, share in zip(crossed(p), (1.0, p["other"]), strict=True):
        about = np.cross(Z, way)  # the rotation that moves the shaft this way above the joint
        carried = np.linalg.solve(np.stack([np.ones(2), heights]), [way @ wrench[:3], about @ moment])
        above, below = carried / (share * k)
        slope = (above - below) / p["span"]
        moved = moved + (above - slope * heights[0]) * way
        turned = turned + slope * about
    return np.concatenate([moved + np.cross(turned, TIP), turned])


def elbow(p: Parameters, wrench: Array) -> Array:
    # the corner lies beside the middle: across is x cross y, then x cross that
    corner = 0.5 * TIP + p["offset"] * LONG * (np.cos(p["side"]) * Z - np.sin(p["side"]) * Y)
    first = bent(ORIGIN, corner, wrench, p, lambda x: 1.1 - 0.2 * x)
    return first + bent(corner, TIP, wrench, p, lambda x: 0.9 - 0.2 * x)


def pieces(p: Parameters, share: float) -> Array:
    """Return the compliance of a share of the arm's length, in one place."""
    EI = p["EI"]
    return share * LONG / np.array([EI / 0.12**2, np.inf, np.inf, p["twist"] * EI, EI, EI])


def two_hinges(p: Parameters, wrench: Array) -> Array:
    first = soft_at((1.0 - p["first"]) * TIP, pieces(p, 0.6), wrench)
    return first + soft_at((1.0 - p["second"]) * TIP, pieces(p, 0.4), wrench)


def hollow(p: Parameters, wrench: Array) -> Array:
    beam = {**p, "shear_give": 1.0 / p["shear"]}
    return bent(ORIGIN, TIP, wrench, beam, lambda x: (1.0 - p["narrower"] * x) ** 0.75)


def bolted(p: Parameters, wrench: Array) -> Array:
    opens = pieces(p, p["joint"]) * np.array([0.0, 0.0, 0.0, 0.5, 1.0, 1.0])
    whole = (1.0 - p["joint"]) * bent(ORIGIN, TIP, wrench, p)
    return whole + soft_at((1.0 - p["end"]) * TIP, opens, wrench)


def beside(share: float) -> Array:
    return share * LONG * np.cross(X, Y)


def fork(p: Parameters, wrench: Array) -> Array:
    K = np.zeros((6, 6))
    for way, share in ((1.0, 1.0), (-1.0, p["uneven"])):
        away = beside(way * p["beside"])
        columns = [bent(away, TIP + away, load, p, share=share / (1.0 + p["uneven"])) for load in np.eye(6)]
        K += np.linalg.inv(np.stack(columns, axis=1))
    return np.linalg.solve(K, wrench)


def series(p: Parameters, wrench: Array) -> Array:
    about = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    soft = np.concatenate([0.05**2 * about, about])
    places = ((p["share"], p["behind"]), (1.0 - p["share"], 0.4 * p["behind"]))
    return sum((soft_at(behind * Z, share * soft, wrench) for share, behind in places), np.zeros(6))


def cantilever(p: Parameters, wrench: Array) -> Array:
    length = 2.0 * p["behind"]
    beam = {"EI": length / p["tilt"], "twist": 1.0 / p["about"], "slender": 0.03}
    return bent(TIP - length * Z, TIP, wrench, beam, lambda x: 1.15 - 0.3 * x)


def remote_centre(p: Parameters, wrench: Array) -> Array:
    about = p["tilt"] * np.array([1.0, p["other"], p["about"]])
    across = about[:2] * p["reach"] ** 2
    return soft_at(-p["ahead"] * Z, np.concatenate([across, [across[0] / 20.0], about]), wrench)


def on_three_feet(p: Parameters, wrench: Array) -> Array:
    return soft_at(TIP, three_around(p, "foot"), wrench)


def on_three_balls(p: Parameters, wrench: Array) -> Array:
    return soft_at(p["behind"] * Z, three_around(p, "ball"), wrench)


def on_struts(p: Parameters, wrench: Array) -> Array:
    return soft_at(p["behind"] * Z, np.linalg.inv(strutted(p)), wrench)


def tapered(p: Parameters, wrench: Array) -> Array:
    return bent(ORIGIN, TIP, wrench, p, lambda x: 1.0 - p["taper"] * x)


def channel(p: Parameters, wrench: Array) -> Array:
    return bent(beside(p["beside"]), TIP + beside(p["beside"]), wrench, p)


UPRIGHT = (2, 3, 4)  # what upright springs alone answer
LINK = {"flat": 1.0}
CLOSED_FORMS = [
    ClosedForm("base-compliance", "block", on_a_block, {}),
    ClosedForm("base-compliance", "bolts", on_bolts, {}, UPRIGHT),
    ClosedForm("base-compliance", "three-feet", on_three_feet, {}, UPRIGHT),
    ClosedForm("base-compliance", "column", on_a_column, LINK),
    ClosedForm("base-compliance", "carriage", on_a_carriage, {}),
    ClosedForm("bearing-tilt", "anisotropic", in_a_bearing, {}),
    ClosedForm("bearing-tilt", "off-centre", in_a_bearing, {}),
    ClosedForm("bearing-tilt", "pair", in_two_bearings, {}),
    ClosedForm("link-bending", "tapered", tapered, LINK),
    ClosedForm("link-bending", "elbow", elbow, LINK),
    ClosedForm("link-bending", "hinged", two_hinges, LINK),
    ClosedForm("link-bending", "hollow", hollow, LINK),
    ClosedForm("link-bending", "bolted", bolted, LINK | {"opens": 1.0, "end": 0.0}),
    ClosedForm("link-bending", "bolted", bolted, LINK | {"opens": 1.0, "end": 1.0}),
    ClosedForm("link-bending", "channel", channel, LINK | {"side": 0.0}),
    ClosedForm("link-bending", "fork", fork, LINK | {"side": 0.0}),
    ClosedForm("tool-compliance", "series", series, {}, tolerance=TOOL),
    ClosedForm("tool-compliance", "cantilever", cantilever, {}, tolerance=TOOL),
    ClosedForm("tool-compliance", "struts", on_struts, {}, tolerance=TOOL),
    ClosedForm("tool-compliance", "remote-centre", remote_centre, {}, tolerance=TOOL),
    ClosedForm("tool-compliance", "balls", on_three_balls, {"clamped": 1e9}, UPRIGHT, TOOL),
]
