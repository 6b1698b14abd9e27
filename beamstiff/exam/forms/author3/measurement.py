"""Third forms of wrong geometry and payload, loads and readings."""

from functools import partial

import numpy as np

from beamstiff.exam.added_parts import with_loose_mass
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import drive_of
from beamstiff.exam.draws import PHASE, SEED, always, around, direction, evenly, product, signed, sized, whole
from beamstiff.exam.effect import Reality, Seen, built, form, load, places_of, reading
from beamstiff.exam.forms.author1 import geometry as geometry1
from beamstiff.exam.forms.author1 import measurement as measurement1
from beamstiff.exam.laws import Curved, winding
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import Draw, DrawRequest, Parameters, between, named, vector
from beamstiff.exam.rotations import apply, turn
from beamstiff.robot.parts import FRAME_PARAMETERS

SMALL = 0.08  # of the named error's size: an oval wheel at a frame's drive
TOLERANCE = 0.03  # of the named error's size, one standard deviation: all other errors
GRAVITY = 9.81
FIRM = 1e-4  # of what it gives at first, that a loose thing gives at its bounds
DISCS = 6
ROPE = (0.02, 0.4)  # rad that a rope's way turns where the tool is as far from mid-range as its arm is long
SEEN = 4.0  # lens distortion over the frame's angle: the machine fills a quarter of the view
COLUMN = 1.5  # m: height that a column's drift is told at


def _size(component: str, size: float) -> float:
    angle = "." not in component or FRAME_PARAMETERS[component.rsplit(".", 1)[1]] == "angle"
    return between(size, *(geometry1.ANGLE if angle else geometry1.LENGTH))


def _draw_geometry(request: DrawRequest) -> dict[str, float]:
    component, robot = str(request.component), request.robot
    found = {"error": geometry1.draw_geometry(request)["error"]}
    if request.form == "oval":
        share = SMALL if "." in component else request.uniform(0.3, 0.7)  # an encoder's is larger
        return found | {"oval": share * request.sized(*geometry1.ANGLE), "phase": PHASE(request)}
    others = [name for name in map(str, geometry1.geometry_places(robot)) if name != component]
    if robot.loops:  # rigid loops would not close with lengths that do not fit
        others = [name for name in others if "." not in name]
    return found | {
        name: TOLERANCE * _size(name, request.size) * float(request.rng.standard_normal()) for name in others
    }


def _geometry(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with wrong kinematics.

    ``oval``: an encoder errs twice a turn besides its zero; a frame's error comes with a little of it.
    ``tolerances``: one error stands out of all others, as an earlier calibration leaves them.
    """
    component, p = str(truth.component), truth.parameters
    errors = {name: p[name] for name in p if name not in ("error", "oval", "phase")}
    reality = reality.with_errors({component: p["error"]} | errors)
    robot = reality.machine.robot
    drive = drive_of(robot, component)
    if drive is None or "oval" not in p or geometry1.kind_of(robot, drive) != "angle":
        return reality
    return reality.with_encoder(drive, lambda q: p["oval"] * np.sin(2.0 * q + p["phase"]))


def _payload(ways: tuple[int, ...], p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with something at the tool that the model lacks, and that moves within bounds.

    ``rolling``: a part loose in a groove. ``liquid``: in an open vessel, to its low side, up to the wall.
    `half`: m to either side. `tilt`: share of the weight along its way with which it has gone most of it.
    """
    turning = p["tilt"] * p["mass"] * GRAVITY

    def bounded(force: Array) -> Curved:
        x = force / turning
        root = np.hypot(1.0, x)
        firm = FIRM * p["half"] / turning
        return p["half"] * x / root + firm * force, p["half"] / (turning * root**3) + firm

    laws = dict.fromkeys(ways, winding(bounded, turning / (FIRM * p["half"])))
    return with_loose_mass(machine, vector(p), p["along"], p["mass"], np.full(6, np.inf), laws)


_LOOSE: dict[str, Draw] = {
    "mass": sized(*geometry1.MASS), "along": signed(evenly(0.0, 0.1)), "half": evenly(0.03, 0.12)
}  # fmt: skip


def _stations(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values of a tracker that is moved once, either station aligned by itself, each wrongly."""
    share, pose = measurement1.REGISTERED if seen.absolute else 1.0, seen.campaign.pose
    poses = np.unique(pose)
    later = np.searchsorted(poses, pose) >= p["after"] * len(poses)
    R = np.where(later[:, None, None], turn(share * vector(p, "uvw")), turn(share * vector(p)))
    moved = (R @ values[:, :3, None])[..., 0]
    return np.concatenate([moved, measurement1.seen_turned(R, seen, values)], axis=1)


def distorted(points: Array, camera: Array, barrel: float) -> Array:
    """Return where a camera that looks at the base sees points (N, 3): stretched with the angle squared."""
    view = -camera / np.linalg.norm(camera)
    seen = points - camera
    depth = seen @ view
    across = seen - depth[:, None] * view
    wide = np.sum(across**2, axis=1) / depth**2
    return np.asarray(points + barrel * wide[:, None] * across)


def _lens(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values of a camera whose axes are turned, with barrel distortion (D. C. Brown, 1966)."""
    share = measurement1.REGISTERED if seen.absolute else 1.0
    camera, barrel, moved = vector(p, "uvw"), share * p["barrel"], values[:, :3]
    if seen.absolute:
        moved = distorted(moved, camera, barrel)
    else:
        moved = distorted(seen.places + moved, camera, barrel) - distorted(seen.places, camera, barrel)
    R = np.broadcast_to(turn(share * vector(p)), (len(values), 3, 3))
    return np.concatenate([(R @ moved[..., None])[..., 0], measurement1.seen_turned(R, seen, values)], axis=1)


def _draw_rope(request: DrawRequest) -> dict[str, float]:
    missed = vector(request.direction()) * request.uniform(0.0, 0.3)  # of the arm's length
    return {"angle": request.sized(*ROPE)} | named(missed)


def _rope(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads by a rope to a pulley that stays where it was set out, for the middle of the range."""
    machine, nodes = seen.machine, seen.campaign.load_point
    reach = float(np.linalg.norm(machine.places(machine.tcp)))
    aside = places_of(machine, nodes, seen.placed) - machine.places(*nodes.tolist()) - reach * vector(p)
    force = wrench[:, :3]
    size = np.linalg.norm(force, axis=1, keepdims=True)
    way = force / np.where(size > 0.0, size, np.inf)
    true = way * reach / p["angle"] - aside
    true = true / np.linalg.norm(true, axis=1, keepdims=True)
    axis = np.cross(way, true)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, np.sum(way * true, axis=1, keepdims=True))
    spin = np.where(size > 0.0, axis * angle / np.where(sine > 1e-12, sine, np.inf), 0.0)
    R = turn(spin)
    return np.concatenate([apply(R, force), apply(R, wrench[:, 3:])], axis=1)


def _draw_discs(request: DrawRequest) -> dict[str, float]:
    gain, wrong = 1.3 * request.sized(*measurement1.GAIN), request.rng.standard_normal(DISCS)
    wrong -= 0.5 * wrong.mean()  # an equal error of all would be a softer machine
    wrong *= gain / np.sqrt(np.mean(wrong**2))
    return {f"disc{i}": float(error) for i, error in enumerate(wrong)}


def _discs(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads by a stack of a workshop's discs, whose true weights differ from their labels."""
    size = np.linalg.norm(wrench[:, :3], axis=1)
    each = (float(size.max()) or 1.0) / DISCS
    laid = np.clip(size[:, None] / each - np.arange(DISCS), 0.0, 1.0)
    more = each * laid @ np.array([p[f"disc{i}"] for i in range(DISCS)])
    return np.asarray(wrench * (1.0 + more / np.where(size > 0.0, size, np.inf))[:, None])


def heated(part: Array, on: float, lag: float) -> Array:
    """Return the warmth, from 0 to 1, of what is heated `on` of each period, at times in periods."""
    kept_on, kept_off = np.exp(-on / lag), np.exp(-(1.0 - on) / lag)
    high = (1.0 - kept_on) / (1.0 - kept_on * kept_off)
    low = high * kept_off
    part = part % 1.0
    rising = 1.0 - (1.0 - low) * np.exp(-part / lag)
    falling = high * np.exp(-(part - on) / lag)
    return np.asarray((np.where(part < on, rising, falling) - low) / (high - low))


def _thermostat(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values in a hall whose heating goes on and off (ISO 230-3); `period`: s; `on`, `lag`: shares."""
    part = p["start"] + measurement1.since_start(seen.campaign) / p["period"]
    share = heated(part, p["on"], p["lag"]) - heated(np.array(p["start"]), p["on"], p["lag"])
    moved = p["drift"] * measurement1.since_rest(seen.campaign, share)[:, None] * vector(p)
    return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)


def _sun(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values on a column that leans into the shade, and the sun moves on; `sweep`: rad, of hours."""
    time = measurement1.since_start(seen.campaign)
    bearing = p["from"] + p["sweep"] * time / (float(time.max()) or 1.0)
    lean = np.zeros((len(values), 3))
    for axis, part in ((0, np.cos), (1, np.sin)):
        lean[:, axis] = measurement1.since_rest(seen.campaign, part(bearing) - part(p["from"]))
    lean *= p["drift"] / (2.0 * np.sin(0.5 * abs(p["sweep"])))
    turned = np.cross([0.0, 0.0, 1.0], lean) / COLUMN
    return np.asarray(values + np.concatenate([np.cross(turned, seen.places), turned], axis=1))


def _run(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values with bad rows one after the other, off by the same, until someone sees it."""
    rng = np.random.default_rng(int(p["seed"]))
    order = np.lexsort((seen.campaign.step, seen.campaign.pose))
    length = min(int(p["length"]), max(1, len(values) // 8))  # a few rows, of a short campaign too
    values = values.copy()
    for _ in range(max(1, round(p["share"] * len(values) / length))):
        first = int(rng.integers(len(values) - length + 1))
        shift = p["size"] * rng.uniform(0.5, 1.5) * rng.choice([-1.0, 1.0]) * vector(p)
        values[order[first : first + length], :3] += shift
    return values


_ANGLE, _DRIFT = sized(*measurement1.FRAME_ANGLE), sized(*measurement1.DRIFT)


FORMS = (
    form("geometry-error", "oval", _geometry, _draw_geometry),
    form("geometry-error", "tolerances", _geometry, _draw_geometry),
    built("payload-error", "rolling", partial(_payload, (0,)),
          direction(), **_LOOSE, tilt=evenly(0.03, 0.12)),
    built("payload-error", "liquid", partial(_payload, (1, 2)),
          direction(), **_LOOSE, tilt=evenly(0.3, 0.8)),
    reading("frame-misalignment", "lens", _lens, direction(_ANGLE), around(evenly(3.0, 5.0)),
            w=evenly(0.8, 1.8), barrel=signed(product(always(SEEN), _ANGLE, evenly(0.5, 1.0)))),
    reading("frame-misalignment", "stations", _stations,
            direction(_ANGLE), direction(_ANGLE, "uvw"), after=evenly(0.3, 0.7)),
    load("load-error", "rope", _rope, _draw_rope),
    load("load-error", "discs", _discs, _draw_discs),
    reading("thermal-drift", "thermostat", _thermostat, direction(),
            drift=_DRIFT, period=evenly(600.0, 2400.0), on=evenly(0.25, 0.6), lag=evenly(0.15, 0.6),
            start=lambda request: request.rng.uniform()),
    reading("thermal-drift", "sun", _sun, drift=_DRIFT,
            **{"from": PHASE, "sweep": signed(evenly(1.0, 2.5))}),
    reading("outliers", "run", _run, direction(),
            size=sized(*measurement1.SIZE), length=whole(2, 7), share=evenly(0.01, 0.05), seed=SEED),
)  # fmt: skip
