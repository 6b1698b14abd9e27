"""Further forms of wrong geometry and payload, loads and readings."""

import numpy as np

from beamstiff.exam.added_parts import with_loose_mass
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import drive_of
from beamstiff.exam.draws import PHASE, around, direction, each, evenly, product, signed, sized
from beamstiff.exam.effect import Reality, Seen, built, form, load, reading
from beamstiff.exam.forms.author1 import geometry as geometry1
from beamstiff.exam.forms.author1 import measurement as measurement1
from beamstiff.exam.machine import Hose, Machine, stroke
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.rotations import turn
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS

BESIDE = 0.08  # of the named error's size: others that come with it
HEIGHT = 1.5  # m: the size of a hose is what hangs from there
GRAVITY = 9.81
FURTHEST = 0.12  # m that a loose part slides under its weight
MOMENT_ARM = 0.5  # m: a moment misread by a force, for a gain of 1
SMALL = 50.0  # N about which a load cell's gain changes from push to pull
SHORTEST = 0.1  # m of a link that grows
HEAD = evenly(0.8, 1.8)  # m: height of a tracker
STAND = 3.0  # m from where drift is told to where a stand tilts


def _draw_geometry(request: DrawRequest) -> dict[str, float]:
    component = str(request.component)
    plain = geometry1.draw_geometry(request)
    angle, length = (BESIDE * request.sized(*r) for r in (geometry1.ANGLE, geometry1.LENGTH))
    if "." not in component:  # an encoder: its zero is off, and so is its track or its gear
        size = abs(plain["error"])
        if request.form == "eccentric":
            return plain | {"runout": size * request.uniform(0.3, 0.8), "phase": PHASE(request)}
        return plain | {"scale": size * request.sign() * request.uniform(0.1, 0.4)}
    if request.robot.loops:  # a rigid loop would not close with other errors
        return plain
    if request.form == "eccentric":
        return plain | {"runout": angle, "phase": PHASE(request)}
    own = component.rsplit(".", 1)[1]
    for parameter in ("d", "r", "alpha", "beta"):
        if parameter != own:
            kind = FRAME_PARAMETERS[parameter]
            plain[parameter] = request.sign() * (angle if kind == "angle" else length)
    return plain


def _geometry(truth: Truth, reality: Reality) -> Reality:
    component, p = str(truth.component), truth.parameters
    others = {f"{component.rsplit('.', 1)[0]}.{n}": p[n] for n in ("d", "r", "alpha", "beta") if n in p}
    reality = reality.with_errors({component: p["error"]} | others)
    robot = reality.machine.robot
    drive = drive_of(robot, component)
    if drive is None or not {"runout", "scale"} & set(p):
        return reality
    middle, _ = stroke(robot, drive)

    def encoder(q: Array) -> Array:
        return p.get("runout", 0.0) * np.sin(q + p.get("phase", 0.0)) + p.get("scale", 0.0) * (q - middle)

    return reality.with_encoder(drive, encoder)


def _loose(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a part of the payload that sits loose along an axis."""
    held = np.full(6, np.inf)
    held[0] = p["mass"] * GRAVITY / p["slides"]
    return with_loose_mass(machine, vector(p), p["away"], p["mass"], held)


def _frame(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values by a turned tracker, or by a camera that misjudges depth more than what lies across."""
    place, share = vector(p, "uvw"), measurement1.REGISTERED if seen.absolute else 1.0
    R = turn(share * vector(p))
    view = place / np.linalg.norm(place)
    matrix = R @ (np.eye(3) + share * p.get("deeper", 0.0) * np.outer(view, view))
    about = place if seen.absolute and "deeper" not in p else np.zeros(3)
    moved = about + (values[:, :3] - about) @ matrix.T
    return np.concatenate([moved, measurement1.seen_turned(R, seen, values)], axis=1)


def _hanger(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads with a hanger that is not counted in."""
    size = np.linalg.norm(wrench[:, :3], axis=1, keepdims=True)
    return np.asarray(wrench * (1.0 + p["tare"] / np.where(size > 0.0, size, np.inf)))


def _push_pull(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return the loads that a cell misreads whose gain differs from push to pull."""
    axes = seen.load_axes
    own = np.einsum("nji,nj->ni", axes, wrench[:, :3])
    more = np.einsum("nij,nj->ni", axes, own * vector(p) * np.tanh(own / SMALL))
    return np.concatenate([wrench[:, :3] + more, wrench[:, 3:]], axis=1)


def _draw_crosstalk(request: DrawRequest) -> dict[str, float]:
    gain, mixed = request.sized(*measurement1.GAIN), request.rng.standard_normal((3, 3))
    mixed = mixed + mixed.T  # its odd part would be a load beside the tool
    mixed -= np.eye(3) * np.trace(mixed) / 3.0
    mixed *= MOMENT_ARM * gain / np.linalg.norm(mixed, 2)
    return measurement1.by_pairs(mixed)


def _crosstalk(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return the loads of a cell that takes forces for moments."""
    axes = seen.load_axes
    moment = np.einsum("nij,jk,nlk,nl->ni", axes, measurement1.matrix_of(p), axes, wrench[:, :3])
    return np.concatenate([wrench[:, :3], wrench[:, 3:] + moment], axis=1)


def links(robot: Robot) -> list[tuple[str, str]]:
    """Return the ends of the links that may grow, or of all where they all are short."""
    found = [part.nodes for part in robot.rigids] + [part.nodes for part in robot.beams]
    nodes = {node.name: node for node in robot.nodes}
    long = [
        pair
        for pair in found
        if nodes[pair[0]].frame != nodes[pair[1]].frame
        or np.linalg.norm(np.subtract(nodes[pair[0]].at, nodes[pair[1]].at)) > SHORTEST
    ]
    return long or found


def _drifted(p: Parameters, seen: Seen, values: Array, share: Array, moved: Array, turned: Array) -> Array:
    share = p["drift"] * measurement1.since_rest(seen.campaign, np.asarray(share))[:, None]
    return np.asarray(values + share * np.concatenate([moved, turned], axis=1))


def _link(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return readings of a machine of which a link grows, promptly and slowly."""
    part, machine, placed = measurement1.part_of(seen.campaign), seen.machine, seen.placed
    share = -p["prompt"] * np.expm1(-part / p["fast"])
    share = share - (1.0 - p["prompt"]) * np.expm1(-part / p["slow"])
    a, b = links(machine.robot)[int(p["link"])]
    ways = placed.node(machine.node(b)) - placed.node(machine.node(a))
    size = np.linalg.norm(ways, axis=1, keepdims=True)
    moved = ways / np.where(size > 1e-9, size, np.inf)
    return _drifted(p, seen, values, share, moved, np.zeros_like(moved))


def _swing(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return readings in a hall whose temperature swings."""
    turns = 2.0 * np.pi / p["period"]
    share = 0.5 * (np.sin(turns * measurement1.part_of(seen.campaign) + p["phase"]) - np.sin(p["phase"]))
    moved = np.tile(vector(p), (len(values), 1))
    return _drifted(p, seen, values, share, moved, np.zeros_like(moved))


def _stand(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return readings from a stand that tilts."""
    share = np.expm1(-measurement1.part_of(seen.campaign) / p["slow"]) / np.expm1(-1.0 / p["slow"])
    turned = np.tile(vector(p) / STAND, (len(values), 1))
    return _drifted(p, seen, values, share, np.cross(turned, seen.places - vector(p, "uvw")), turned)


_ANGLE, _DRIFT, _GAIN = (
    sized(*size) for size in (measurement1.FRAME_ANGLE, measurement1.DRIFT, measurement1.GAIN)
)
_STANDS = around(evenly(3.0, 6.0))  # m: where a tracker stands, base frame
FORMS = (
    form("geometry-error", "eccentric", _geometry, _draw_geometry),
    form("geometry-error", "crooked", _geometry, _draw_geometry),
    built("payload-error", "hose",
          lambda p, machine, _: machine.plus(hoses=(Hose(machine.tcp, p["per_metre"], p["low"]),)),
          per_metre=lambda request: request.sized(*geometry1.MASS) / HEIGHT, low=evenly(-0.3, 0.3)),
    built("payload-error", "loose", _loose, direction(),
          mass=sized(*geometry1.MASS), slides=lambda request: FURTHEST * request.uniform(0.3, 1.0),
          away=evenly(0.0, 0.1)),
    reading("frame-misalignment", "tracker", _frame, direction(_ANGLE), _STANDS, w=HEAD),
    reading("frame-misalignment", "depth", _frame,
            direction(_ANGLE), _STANDS, w=HEAD, deeper=signed(product(_ANGLE, evenly(0.3, 0.8)))),
    load("load-error", "hanger", _hanger, tare=lambda request: _GAIN(request) * measurement1.USUAL),
    load("load-error", "push-pull", _push_pull, direction(lambda request: _GAIN(request) * np.sqrt(3.0))),
    load("load-error", "crosstalk", _crosstalk, _draw_crosstalk),
    reading("thermal-drift", "link", _link,
            drift=_DRIFT, link=lambda request: request.rng.integers(len(links(request.robot))),
            fast=evenly(0.02, 0.15), slow=evenly(0.4, 1.5), prompt=evenly(0.3, 0.7)),
    reading("thermal-drift", "swing", _swing,
            each(drift=_DRIFT), direction(), period=evenly(0.4, 1.5), phase=PHASE),
    reading("thermal-drift", "stand", _stand,
            each(drift=_DRIFT), direction(), _STANDS, w=HEAD, slow=evenly(0.2, 1.5)),
)  # fmt: skip
