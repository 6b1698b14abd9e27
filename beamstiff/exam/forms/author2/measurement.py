"""Further forms of wrong loads and readings."""

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, named, nowhere, vector
from beamstiff.exam.forms.author1 import measurement as author1
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality, axes_of, places_of
from beamstiff.exam.rotations import turn, turned_by
from beamstiff.robot.description import Robot

USUAL = 1500.0  # N: a gain of one in a hundred is 15 N
MOMENT_ARM = 0.5  # m: a moment misread by a force, for a gain of 1
SMALL = 50.0  # N about which a load cell's gain changes from push to pull
SHORTEST = 0.1  # m of a link that grows
STAND = 3.0  # m from where drift is told to where a stand tilts


def _tracker(rng: np.random.Generator) -> dict[str, float]:
    """Return where a tracker stands, m, base frame."""
    angle, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(3.0, 6.0)
    return named(np.array([away * np.cos(angle), away * np.sin(angle), rng.uniform(0.8, 1.8)]), "uvw")


def _draw_frame(request: DrawRequest) -> dict[str, float]:
    angle = request.sized(*author1.FRAME_ANGLE)
    found = request.direction(angle) | _tracker(request.rng)
    if request.form == "depth":
        found["deeper"] = angle * request.sign() * request.uniform(0.3, 0.8)
    return found


def _frame(truth: Truth, reality: Reality) -> Reality:
    """Return the reality read by a tracker whose axes are turned where it stands.

    Or by a camera there, which misjudges depth more than what lies across its view.
    """
    p, place = truth.parameters, vector(truth.parameters, "uvw")

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        displaced = campaign.kind == "displacement"
        share = 1.0 if displaced else author1.REGISTERED
        R = turn(share * vector(p))
        view = place / np.linalg.norm(place)
        matrix = R @ (np.eye(3) + share * p.get("deeper", 0.0) * np.outer(view, view))
        about = np.zeros(3) if displaced or truth.form == "depth" else place
        turned = turn(values[:, 3:])
        turned = R @ turned @ R.T if displaced else R @ turned
        return np.concatenate([about + (values[:, :3] - about) @ matrix.T, turned_by(turned)], axis=1)

    return reality.with_reading(read)


def _draw_load(request: DrawRequest) -> dict[str, float]:
    gain = request.sized(*author1.GAIN)
    if request.form == "hanger":
        return {"tare": gain * USUAL}
    if request.form == "push-pull":
        return request.direction(gain * np.sqrt(3.0))
    mixed = request.rng.standard_normal((3, 3))
    mixed = mixed + mixed.T  # its odd part would be a load beside the tool
    mixed -= np.eye(3) * np.trace(mixed) / 3.0
    mixed *= MOMENT_ARM * gain / np.linalg.norm(mixed, 2)
    return {f"{a}{b}": float(mixed[i, j]) for i, a in enumerate("xyz") for j, b in enumerate("xyz")}


def _load(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with loads misread.

    By a hanger that is not counted in, by a load cell whose gain differs from push to pull, or by one that
    takes forces for moments.
    """
    p = truth.parameters

    def hanger(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        size = np.linalg.norm(wrench[:, :3], axis=1, keepdims=True)
        return np.asarray(wrench * (1.0 + p["tare"] / np.where(size > 0.0, size, np.inf)))

    def push_pull(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        axes = axes_of(reality.machine, campaign.load_point, placed)
        own = np.einsum("nji,nj->ni", axes, wrench[:, :3])
        more = np.einsum("nij,nj->ni", axes, own * vector(p) * np.tanh(own / SMALL))
        return np.concatenate([wrench[:, :3] + more, wrench[:, 3:]], axis=1)

    def crosstalk(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        axes = axes_of(reality.machine, campaign.load_point, placed)
        mixed = np.array([[p[f"{a}{b}"] for b in "xyz"] for a in "xyz"])
        moment = np.einsum("nij,jk,nlk,nl->ni", axes, mixed, axes, wrench[:, :3])
        return np.concatenate([wrench[:, :3], wrench[:, 3:] + moment], axis=1)

    change = {"hanger": hanger, "push-pull": push_pull, "crosstalk": crosstalk}[truth.form]
    return reality.with_load(change)


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


def _draw_drift(request: DrawRequest) -> dict[str, float]:
    rng = request.rng
    found = {"drift": request.sized(*author1.DRIFT)}
    if request.form == "link":
        return found | {
            "link": float(rng.integers(len(links(request.robot)))),
            "fast": request.uniform(0.02, 0.15),  # lags, as shares of the campaign's time
            "slow": request.uniform(0.4, 1.5),
            "prompt": request.uniform(0.3, 0.7),
        }
    found |= request.direction()
    if request.form == "swing":
        return found | {
            "period": request.uniform(0.4, 1.5),  # over the campaign's time
            "phase": request.uniform(0.0, 2.0 * np.pi),
        }
    return found | _tracker(rng) | {"slow": request.uniform(0.2, 1.5)}


def _drift(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with readings that drift: a link grows, the hall swings, the stand tilts."""
    p, machine = truth.parameters, reality.machine

    def course(campaign: SimulatedCampaign) -> Array:
        time = author1.since_start(campaign)
        part = time / (float(time.max()) or 1.0)
        if truth.form == "swing":
            turns = 2.0 * np.pi / p["period"]
            share = 0.5 * (np.sin(turns * part + p["phase"]) - np.sin(p["phase"]))
        elif truth.form == "link":
            share = -p["prompt"] * np.expm1(-part / p["fast"])
            share = share - (1.0 - p["prompt"]) * np.expm1(-part / p["slow"])
        else:
            share = np.expm1(-part / p["slow"]) / np.expm1(-1.0 / p["slow"])
        return author1.since_rest(campaign, np.asarray(share))

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        moved, turned = np.zeros((len(values), 3)), np.zeros((len(values), 3))
        if truth.form == "swing":
            moved[:] = vector(p)
        elif truth.form == "link":
            a, b = links(machine.robot)[int(p["link"])]
            ways = placed.node(machine.node(b)) - placed.node(machine.node(a))
            size = np.linalg.norm(ways, axis=1, keepdims=True)
            moved = ways / np.where(size > 1e-9, size, np.inf)
        else:
            turned[:] = vector(p) / STAND
            moved = np.cross(turned, places_of(machine, campaign.point, placed) - vector(p, "uvw"))
        share = p["drift"] * course(campaign)[:, None]
        return np.asarray(values + share * np.concatenate([moved, turned], axis=1))

    return reality.with_reading(read)


EFFECTS = (
    Effect("frame-misalignment", ("tracker", "depth"), nowhere, _draw_frame, _frame),
    Effect("load-error", ("hanger", "push-pull", "crosstalk"), nowhere, _draw_load, _load),
    Effect("thermal-drift", ("link", "swing", "stand"), nowhere, _draw_drift, _drift),
)
