"""Further forms of drives, their levers and balancers: play, hardening, friction, linkages, coils, a disc."""

from functools import partial

import numpy as np

from beamstiff.exam.added_parts import crank_stiffness, lever, pair_of, turned, with_balancer
from beamstiff.exam.campaign import Array
from beamstiff.exam.draws import PHASE, SIGN, always, at_joint, by_ratio, evenly, signed, sized
from beamstiff.exam.effect import Drive, built, curve, in_pose, law, wind_up
from beamstiff.exam.forms.author1 import drives as drives1
from beamstiff.exam.forms.author1 import levers as levers1
from beamstiff.exam.laws import Curved, Law, Memory, Situation, curved, ramp, rubbing, varying, winding
from beamstiff.exam.machine import Cross, Machine, Mesh, stroke
from beamstiff.exam.parameters import Draw, DrawRequest, Parameters

SLIDERS = 5
REACH = np.deg2rad([12.0, 45.0])  # half the turn that a four-bar linkage serves; gears beyond it
MARGIN = np.deg2rad(4.0)
TRIED = 300
FLAT = 0.2  # sine of the least angle between coupler and crank or lever
DEAD = 0.6  # of the shortest length between a screw's ends: what the nut and bearings take
BLUNT = 0.02  # m over which a second coil engages


def hertzian(torque: Array, scale: float) -> Curved:
    """Return the give of preloaded contacts after Hertz (power 2/3), and its slope, 1 at no torque."""
    more = 1.0 + np.abs(torque) / scale
    return 1.5 * scale * np.sign(torque) * (np.cbrt(more**2) - 1.0), 1.0 / np.cbrt(more)


def slackening(p: Parameters, k: float, e: Array) -> Curved:
    """Return the force of preloaded springs, and its slope: past `from` the share `loose` of k is left."""
    at, loose = p["from"], p["loose"]
    x4 = (e / at) ** 4
    held, slope = e / (1.0 + x4) ** 0.25, (1.0 + x4) ** -1.25
    return k * (loose * e + (1.0 - loose) * held), k * (loose + (1.0 - loose) * slope)


def _two_way(p: Parameters, k: float, e: Array) -> Curved:
    root = np.hypot(e, p["blunt"])
    return k * (e + p["uneven"] * (root - p["blunt"])), k * (1.0 + p["uneven"] * e / root)


def _arctan(p: Parameters, k: float, torque: Array) -> Curved:
    h, left, share = p["half"], p["left"], 2.0 / np.pi
    x = torque / (2.0 * left * k * h)
    return torque / k + h * share * np.arctan(x), 1.0 / k + share / (2.0 * left * k * (1.0 + x**2))


def _planets(p: Parameters, k: float, e: Array) -> Curved:
    """Return the play of three planets, whose flanks are spread by a share of the half play."""
    h, left = p["half"], p["left"]
    force, slope = left * k * e, np.full_like(e, left * k)
    each = (1.0 - left) * k / 3.0
    for flank in h * (1.0 - p["spread"] * np.array([1.0, 0.4, 0.0])):
        for side in (1.0, -1.0):
            carried, its = ramp(side * e - flank, 0.02 * h)
            force = force + side * each * carried
            slope = slope + each * its
    return force, slope


def _hertz(p: Parameters, k: float, torque: Array) -> Curved:
    soft, hard = k * p["soft"], k * p["hard"]
    more = 1.0 / soft - 1.0 / hard
    given, slope = hertzian(torque, 0.3 * k * p["bend"])
    return torque / hard + more * given, 1.0 / hard + more * slope


def _cubic(p: Parameters, k: float, e: Array) -> Curved:
    """Return the cubic of a fit to a test stand's range; straight on beyond it."""
    soft, more, end = k * p["soft"], k * (p["hard"] - p["soft"]), 2.0 * p["bend"]
    inside, beyond = np.clip(e, -end, end), np.abs(e) > end
    force = soft * e + more * (inside**3 / (3.0 * end**2) + np.where(beyond, e - inside, 0.0))
    return force, soft + more * (inside / end) ** 2


def _contacts(p: Parameters, _: float, variable: str) -> Law:
    """Return a spring with contacts, which give `more` than it at no torque."""
    k, start = p["stiffness"], p["from"]

    def wind_up(torque: Array) -> Curved:
        given, slope = hertzian(torque, k * start)
        return (torque + p["more"] * given) / k, (1.0 + p["more"] * slope) / k

    return winding(wind_up, k)


def _dahl(p: Parameters, k: float, variable: str) -> Law:
    """Return Dahl's friction with exponent 2, integrated in closed form along each step.

    ``dz/de = (1 - z sign(de))^2 / e_slip``, beside a spring (P. R. Dahl, A solid friction model, 1968).
    """
    friction = k * p["friction"]
    slip = friction * (1.0 - p["sliding"]) / (k * p["sliding"])

    def run(state: Array, way: Array) -> Curved:
        short = 1.0 - state  # of sliding freely
        short = short / (1.0 + short * way / slip)
        return 1.0 - short, short**2 / slip

    return rubbing(k, friction, p["arrived"], run)


def _maxwell_slip(p: Parameters, stiffness: float, variable: str) -> Law:
    """Return sliders beside a spring, each behind one of its own, whose yield strains grow by a ratio.

    Generalised Maxwell slip (Al-Bender, Lampaert and Swevers, 2005); later ones are softer, by power `fall`.
    """
    yields = p["ratio"] ** np.arange(SLIDERS)
    k = yields ** -p["fall"]
    k = k * stiffness * p["sliding"] / ((1.0 - p["sliding"]) * k.sum())
    most = k * yields
    most = most * (stiffness * p["friction"]) / most.sum()

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        before, held = memory
        tried = held + k * (strain - before)[:, None]
        now = np.clip(tried, -most, most)
        sticking = np.abs(tried) <= most
        return stiffness * strain + now.sum(axis=1), stiffness + sticking @ k, (strain, now)

    return Law(respond, lambda poses: (np.zeros(poses), np.tile(p["arrived"] * most, (poses, 1))))


def strong_of(p: Parameters) -> float:
    """Return the spring, over the first drive, that couples by the wanted share where weights are equal."""
    return abs(p["share"]) / (1.0 - abs(p["share"]))


def equal_of(p: Parameters, first: float, second: float) -> float:
    """Return the second drive's weight in such a spring, the first one's being 1."""
    return float(-np.sign(p["share"]) * p["ratio"] * np.sqrt(second / first))


def _bracket(p: Parameters, machine: Machine, pair: str) -> Machine:
    one, two, first, second = pair_of(machine, pair)
    gives = np.array([1.0, np.sign(p["share"]) * p["ratio"] * np.sqrt(first / second)])
    soft = np.diag([1.0 / first, 1.0 / second]) + strong_of(p) / first * np.outer(gives, gives)
    added = np.asarray(np.linalg.inv(soft) - np.diag([first, second]))
    return machine.plus(crosses=(Cross(one, two, added),))


def _belt(p: Parameters, machine: Machine, pair: str) -> Machine:
    """Return the machine with a belt, a strand of which hangs slack from a strain on."""
    one, two, first, second = pair_of(machine, pair)
    law = curved(partial(slackening, {"loose": 0.5, "from": p["slack"]}, strong_of(p) * first))
    return machine.plus(meshes=(Mesh(one, two, (1.0, equal_of(p, first, second)), law),))


def _eccentric(p: Parameters, machine: Machine, pair: str) -> Machine:
    one, two, first, second = pair_of(machine, pair)

    def meshing(situation: Situation) -> Array:
        wave = np.sin(situation.values[pair.split("+")[0]] + p["phase"])
        return np.asarray(strong_of(p) * first * (1.0 + p["depth"] * wave))

    return machine.plus(meshes=(Mesh(one, two, (1.0, equal_of(p, first, second)), varying(meshing)),))


_FROM = by_ratio(1e-4, 1e-3)  # strain about which the stiffness changes
_ARRIVED = evenly(-0.9, 0.9)  # friction left over from the move to the pose
_COUPLED: dict[str, Draw] = {"share": signed(sized(*drives1.SHARE)), "ratio": evenly(0.6, 1.6)}


def _linkage(swing: Array, p: Parameters) -> tuple[Array, Array]:
    """Return the crank's turn over the lever's (length 1), and how far the linkage is from flat or open."""
    end = np.stack([np.cos(swing), np.sin(swing)], axis=-1)
    apart = end - np.array([p["base"], 0.0])
    distance = np.linalg.norm(apart, axis=-1)
    cosine = (p["crank"] ** 2 + distance**2 - p["coupler"] ** 2) / (2.0 * p["crank"] * distance)
    angle = np.arctan2(apart[..., 1], apart[..., 0]) + np.arccos(np.clip(cosine, -1.0, 1.0))
    pin = np.array([p["base"], 0.0]) + p["crank"] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    along = (end - pin) / p["coupler"]
    arms = [along[..., 1] * np.cos(a) - along[..., 0] * np.sin(a) for a in (swing, angle)]
    clear = np.where(np.abs(cosine) < 1.0, np.minimum(np.abs(arms[0]), np.abs(arms[1])), 0.0)
    ratio = np.abs(arms[0]) / (p["crank"] * np.maximum(np.abs(arms[1]), 1e-3))
    return ratio, clear


def _draw_linkage(request: DrawRequest) -> dict[str, float]:
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*levers1.SWING)
    even = np.linspace(-1.0, 1.0, 31)
    best, found = np.inf, dict[str, float]()
    for crank, base, longer, start, share in request.rng.uniform(
        [0.6, 1.5, 0.8, 0.3, 0.0], [1.2, 3.0, 1.3, 2.8, 1.0], (TRIED, 5)
    ):
        reach = min(half, REACH[0] + share * (REACH[1] - REACH[0]))
        tried = {"crank": crank, "base": base, "coupler": base * longer, "start": start, "reach": reach}
        ratio, clear = _linkage(start + (reach + MARGIN) * even, tried)
        miss = abs(float(np.log((ratio.max() / ratio.min()) ** 2 / swing)))
        miss += 100.0 * max(0.0, FLAT - float(clear.min()))
        if miss < best:
            best, found = miss, {name: float(value) for name, value in tried.items()}
    return found | {"gear": found["reach"] / half, "way": request.sign(), "middle": middle}


def _four_bar(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    turn = p["way"] * p["gear"] * (situation.values[drive.component] - p["middle"])
    turn = np.clip(turn, -p["reach"] - MARGIN, p["reach"] + MARGIN)
    ratio, _ = _linkage(p["start"] + turn, p)
    k = drive.k * (ratio / _linkage(np.array(p["start"]), p)[0]) ** 2
    return k * e, k


def _triangle(p: Parameters, angle: Array | float) -> tuple[Array, Array]:
    arm, length = lever(p["crank"], p["frame"], angle)
    return arm, length - DEAD * (p["frame"] - p["crank"])


def _screw(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return a screw's; `shaft`: give of its free length over that of nut and bearings, at mid-range."""
    arm, shaft = _triangle(p, levers1.angle_of(p, drive.component, situation))
    arm0, shaft0 = _triangle(p, p["start"])
    k = drive.k * ((arm / arm0) ** 2 * (1.0 + p["shaft"]) / (1.0 + p["shaft"] * shaft / shaft0))
    return k * e, k


def _nested(p: Parameters, strong: float, longer: Array) -> Curved:
    """Return two coils: from a stretch on, m, a second one with a share of the rate."""
    z = longer - p["engages"]
    second = 0.5 * p["second"] * (z + np.hypot(z, BLUNT))
    pull = p["pull"] + p["growth"] * (longer + second)
    return strong * (1.0 + 0.5 * p["second"] * (1.0 + z / np.hypot(z, BLUNT))), pull


def _disc(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return the drive with a strap over a disc that turns with the joint, off its middle."""
    angle = turned(p, drive.component, situation)
    wound = angle + p["eccentric"] * (np.sin(angle - p["phase"]) + np.sin(p["phase"]))
    strap = np.maximum(p["pull"] + p["growth"] * p["side"] * p["crank"] * wound, 0.0)
    arm = p["crank"] * (1.0 + p["eccentric"] * np.cos(angle - p["phase"]))
    slope = -p["crank"] * p["eccentric"] * np.sin(angle - p["phase"])
    strong = crank_stiffness(p, drive.robot, drive.component)
    k = drive.k + (strong * arm**2 + p["side"] * strap * slope)
    return k * e + p["side"] * strap * arm, k


FORMS = (
    wind_up("backlash", "arctan", _arctan, drives1.BACKLASH),
    curve("backlash", "planets", _planets, drives1.BACKLASH, spread=evenly(0.3, 0.8)),
    wind_up("hardening", "hertz", _hertz, drives1.draw_hardening),
    curve("hardening", "cubic", _cubic, drives1.draw_hardening),
    law("joint-compliance", "hertz", _contacts,
        drives1.draw_compliance, **{"from": _FROM, "more": evenly(0.5, 2.0)}),
    law("joint-compliance", "preloaded", lambda p, _, __: curved(partial(slackening, p, p["stiffness"])),
        drives1.draw_compliance, **{"from": _FROM, "loose": evenly(0.3, 0.6)}),
    law("hysteresis", "dahl", _dahl, drives1.FRICTION, arrived=_ARRIVED),
    law("hysteresis", "maxwell-slip", _maxwell_slip,
        drives1.FRICTION, arrived=_ARRIVED, ratio=evenly(1.8, 3.5), fall=evenly(0.3, 1.2)),
    built("joint-coupling", "belt", _belt, **_COUPLED, slack=by_ratio(1e-4, 1e-3)),
    built("joint-coupling", "eccentric", _eccentric, **_COUPLED, depth=evenly(0.3, 0.8), phase=PHASE),
    built("joint-coupling", "bracket", _bracket, **_COUPLED),
    in_pose("actuator-lever", "four-bar", _four_bar, _draw_linkage),
    in_pose("actuator-lever", "screw", _screw, levers1.draw_lever, shaft=evenly(0.5, 2.0)),
    built("gravity-compensator", "nested", partial(with_balancer, _nested),
          levers1.draw_balancer, engages=evenly(-0.1, 0.1), second=evenly(0.5, 1.5)),
    in_pose("gravity-compensator", "disc", _disc,
            levers1.draw_balancer, side=SIGN, eccentric=evenly(0.2, 0.6), phase=PHASE),
    curve("uneven-drive", "two-way", _two_way, uneven=signed(sized(0.05, 0.8)), blunt=at_joint(always(2e-5))),
    curve("softening-drive", "slackening", slackening,
          loose=sized(0.9, 0.2), **{"from": at_joint(by_ratio(5e-5, 5e-4))}),
)  # fmt: skip
