"""Third forms of wrong loads and readings."""

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, in_the_middle, named, nowhere, vector
from beamstiff.exam.forms.author1 import measurement as author1
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality, places_of
from beamstiff.exam.rotations import turn, turned_by

DISCS = 6
ROPE = (0.02, 0.4)  # rad that a rope's way turns where the tool is as far from mid-range as its arm is long
SEEN = 4.0  # lens distortion over the frame's angle: the machine fills a quarter of the view
COLUMN = 1.5  # m: height that a column's drift is told at


def _draw_frame(request: DrawRequest) -> dict[str, float]:
    rng, angle = request.rng, request.sized(*author1.FRAME_ANGLE)
    found = request.direction(angle)
    if request.form == "stations":
        return found | request.direction(angle, "uvw") | {"after": request.uniform(0.3, 0.7)}
    around, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(3.0, 5.0)
    place = np.array([away * np.cos(around), away * np.sin(around), rng.uniform(0.8, 1.8)])
    return found | named(place, "uvw") | {"barrel": SEEN * angle * request.sign() * request.uniform(0.5, 1.0)}


def distorted(points: Array, camera: Array, barrel: float) -> Array:
    """Return where a camera sees points (N, 3) whose lens stretches its picture with the angle squared.

    It looks at the base frame's origin, and knows the depth.
    """
    view = -camera / np.linalg.norm(camera)
    seen = points - camera
    depth = seen @ view
    across = seen - depth[:, None] * view
    wide = np.sum(across**2, axis=1) / depth**2
    return np.asarray(points + barrel * wide[:, None] * across)


def _frame(truth: Truth, reality: Reality) -> Reality:
    """Return the reality read in a wrong frame.

    ``lens``: a camera whose axes are turned, and whose lens is not calibrated to the rim, so that its scale
    changes across its view (barrel distortion, D. C. Brown, 1966). The size is an engineering estimate.

    ``stations``: the tracker is moved once, and either station is aligned by itself, each wrongly. Common
    practice where the arm hides the reflector.
    """
    p, machine = truth.parameters, reality.machine

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        displaced = campaign.kind == "displacement"
        share = 1.0 if displaced else author1.REGISTERED
        first = turn(share * vector(p))
        R = np.broadcast_to(first, (len(values), 3, 3))
        moved = values[:, :3]
        if truth.form == "stations":
            poses = np.unique(campaign.pose)
            later = np.searchsorted(poses, campaign.pose) >= p["after"] * len(poses)
            R = np.where(later[:, None, None], turn(share * vector(p, "uvw")), first)
        else:
            camera, barrel = vector(p, "uvw"), share * p["barrel"]
            if displaced:
                at = places_of(machine, campaign.point, placed)
                moved = distorted(at + moved, camera, barrel) - distorted(at, camera, barrel)
            else:
                moved = distorted(moved, camera, barrel)
        turned = turn(values[:, 3:])
        turned = R @ turned @ np.swapaxes(R, -1, -2) if displaced else R @ turned
        return np.concatenate([(R @ moved[..., None])[..., 0], turned_by(turned)], axis=1)

    return reality.with_reading(read)


def _draw_load(request: DrawRequest) -> dict[str, float]:
    if request.form == "rope":
        missed = vector(request.direction()) * request.uniform(0.0, 0.3)  # of the arm's length
        return {"angle": request.sized(*ROPE)} | named(missed)
    gain = 1.3 * request.sized(*author1.GAIN)
    wrong = request.rng.standard_normal(DISCS)
    wrong -= 0.5 * wrong.mean()  # an equal error of all would be a softer machine
    wrong *= gain / np.sqrt(np.mean(wrong**2))
    return {f"disc{i}": float(error) for i, error in enumerate(wrong)}


def _load(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with loads misread.

    ``rope``: the rope runs to a pulley in the room, which is set out for about the middle of the range and
    stays where it is, so that the pull turns as the tool moves aside. Common practice.

    ``discs``: the load is a stack of discs whose true weights differ from their labels, so that its error has
    a slope of its own from disc to disc. Weights of commercial classes err less, those of a workshop so much;
    engineering estimate.
    """
    p, machine = truth.parameters, reality.machine

    def rope(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        middle = in_the_middle(machine.robot)
        changed = wrench.copy()
        for name in np.unique(campaign.load_point):
            rows, node = campaign.load_point == name, machine.node(str(name))
            reach = float(np.linalg.norm(middle.node(machine.node(machine.tcp))))
            aside = placed.node(node)[rows] - middle.node(node) - reach * vector(p)
            force = wrench[rows, :3]
            size = np.linalg.norm(force, axis=1, keepdims=True)
            way = force / np.where(size > 0.0, size, np.inf)
            true = way * reach / p["angle"] - aside
            true = true / np.linalg.norm(true, axis=1, keepdims=True)
            axis = np.cross(way, true)
            sine = np.linalg.norm(axis, axis=1, keepdims=True)
            angle = np.arctan2(sine, np.sum(way * true, axis=1, keepdims=True))
            spin = np.where(size > 0.0, axis * angle / np.where(sine > 1e-12, sine, np.inf), 0.0)
            R = turn(spin)
            parts = [(R @ part[..., None])[..., 0] for part in (force, wrench[rows, 3:])]
            changed[rows] = np.concatenate(parts, axis=1)
        return changed

    def discs(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        size = np.linalg.norm(wrench[:, :3], axis=1)
        each = (float(size.max()) or 1.0) / DISCS
        laid = np.clip(size[:, None] / each - np.arange(DISCS), 0.0, 1.0)
        more = each * laid @ np.array([p[f"disc{i}"] for i in range(DISCS)])
        return np.asarray(wrench * (1.0 + more / np.where(size > 0.0, size, np.inf))[:, None])

    return reality.with_load(rope if truth.form == "rope" else discs)


def _draw_drift(request: DrawRequest) -> dict[str, float]:
    found = {"drift": request.sized(*author1.DRIFT)}
    if request.form == "thermostat":
        return (
            found
            | request.direction()
            | {
                "period": request.uniform(600.0, 2400.0),  # s
                "on": request.uniform(0.25, 0.6),  # share of the period
                "lag": request.uniform(0.15, 0.6),  # likewise
                "start": float(request.rng.uniform()),
            }
        )
    return found | {
        "from": request.uniform(0.0, 2.0 * np.pi),
        "sweep": request.sign() * request.uniform(1.0, 2.5),  # rad over the campaign
    }


def heated(part: Array, on: float, lag: float) -> Array:
    """Return the warmth, from 0 to 1, of what is heated `on` of each period, at times in periods."""
    kept_on, kept_off = np.exp(-on / lag), np.exp(-(1.0 - on) / lag)
    high = (1.0 - kept_on) / (1.0 - kept_on * kept_off)
    low = high * kept_off
    part = part % 1.0
    rising = 1.0 - (1.0 - low) * np.exp(-part / lag)
    falling = high * np.exp(-(part - on) / lag)
    return np.asarray((np.where(part < on, rising, falling) - low) / (high - low))


def _drift(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with readings that drift.

    ``thermostat``: the hall's heating or cooling goes on and off, and what carries the tracker follows with a
    lag, in minutes. Known in every machine hall (ISO 230-3 asks for its record).

    ``sun``: a column, warmer on the sunlit side, leans into the shade, and the sun moves on. Known of large
    machine tools; the angle it sweeps is that of some hours.
    """
    p, machine = truth.parameters, reality.machine

    def thermostat(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        part = p["start"] + author1.since_start(campaign) / p["period"]
        share = heated(part, p["on"], p["lag"]) - heated(np.array(p["start"]), p["on"], p["lag"])
        moved = p["drift"] * author1.since_rest(campaign, share)[:, None] * vector(p)
        return np.concatenate([values[:, :3] + moved, values[:, 3:]], axis=1)

    def sun(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        time = author1.since_start(campaign)
        bearing = p["from"] + p["sweep"] * time / (float(time.max()) or 1.0)
        lean = np.zeros((len(values), 3))
        for axis, part in ((0, np.cos), (1, np.sin)):
            lean[:, axis] = author1.since_rest(campaign, part(bearing) - part(p["from"]))
        lean *= p["drift"] / (2.0 * np.sin(0.5 * abs(p["sweep"])))
        turned = np.cross([0.0, 0.0, 1.0], lean) / COLUMN
        moved = np.cross(turned, places_of(machine, campaign.point, placed))
        return np.asarray(values + np.concatenate([moved, turned], axis=1))

    return reality.with_reading(thermostat if truth.form == "thermostat" else sun)


def _draw_outliers(request: DrawRequest) -> dict[str, float]:
    return request.direction() | {
        "size": request.sized(*author1.SIZE),
        "length": request.integer(2, 7),
        "share": request.uniform(0.01, 0.05),
        "seed": request.integer(0, 2**31),
    }


def _outliers(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with bad rows.

    ``run``: the beam is broken and caught again at a wrong distance, or the reflector sits askew on a chip,
    until someone sees it and sets it right: a few rows one after the other are off by the same. Known of
    interferometers and of magnetic nests; engineering estimate.
    """
    p = truth.parameters

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        rng = np.random.default_rng(int(p["seed"]))
        order = np.lexsort((campaign.step, campaign.pose))
        length = min(int(p["length"]), max(1, len(values) // 8))  # a few rows, of a short campaign too
        values = values.copy()
        for _ in range(max(1, round(p["share"] * len(values) / length))):
            first = int(rng.integers(len(values) - length + 1))
            shift = p["size"] * rng.uniform(0.5, 1.5) * rng.choice([-1.0, 1.0]) * vector(p)
            values[order[first : first + length], :3] += shift
        return values

    return reality.with_reading(read)


EFFECTS: tuple[Effect, ...] = (
    Effect("frame-misalignment", ("lens", "stations"), nowhere, _draw_frame, _frame),
    Effect("load-error", ("rope", "discs"), nowhere, _draw_load, _load),
    Effect("thermal-drift", ("thermostat", "sun"), nowhere, _draw_drift, _drift),
    Effect("outliers", ("run",), nowhere, _draw_outliers, _outliers),
)
