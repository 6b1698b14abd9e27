"""Further forms of drives: play, hardening, joints that are not stiff, friction, and coupling of two."""

import numpy as np

from beamstiff.exam.added_parts import pair_of
from beamstiff.exam.campaign import Array
from beamstiff.exam.draws import PHASE, by_ratio, evenly, signed, sized
from beamstiff.exam.effect import built, law
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.laws import Curved, Law, Memory, Situation, curved, rubbing, varying, winding
from beamstiff.exam.machine import Cross, Machine, Mesh
from beamstiff.exam.parameters import Draw, Parameters

SLIDERS = 5


def hertzian(torque: Array, scale: float) -> Curved:
    """Return the give of contacts after Hertz under a preload, odd in the torque, and its slope.

    Approach grows with the load's power 2/3; it is counted from the preload `scale`, and has slope 1 there.
    """
    more = 1.0 + np.abs(torque) / scale
    return 1.5 * scale * np.sign(torque) * (np.cbrt(more**2) - 1.0), 1.0 / np.cbrt(more)


def slackening(e: Array, k: float, loose: float, at: float) -> Curved:
    """Return the force of a preloaded pair of springs and its slope, (P,) each.

    Past the strain `at` one of the pair hangs slack, and the share `loose` of the stiffness k is left. The
    corner is rounded.
    """
    x4 = (e / at) ** 4
    held, slope = e / (1.0 + x4) ** 0.25, (1.0 + x4) ** -1.25
    return k * (loose * e + (1.0 - loose) * held), k * (loose + (1.0 - loose) * slope)


def _arctan(p: Parameters, k: float, variable: str) -> Law:
    h, left, share = p["half"], p["left"], 2.0 / np.pi

    def wind_up(torque: Array) -> Curved:
        x = torque / (2.0 * left * k * h)
        return torque / k + h * share * np.arctan(x), 1.0 / k + share / (2.0 * left * k * (1.0 + x**2))

    return winding(wind_up, k)


def _planets(p: Parameters, k: float, variable: str) -> Law:
    """Return the play of three planets, whose flanks are spread by a share of the half play."""
    h, left = p["half"], p["left"]

    def curve(e: Array) -> Curved:
        force, slope = left * k * e, np.full_like(e, left * k)
        each = (1.0 - left) * k / 3.0
        for flank in h * (1.0 - p["spread"] * np.array([1.0, 0.4, 0.0])):
            for side in (1.0, -1.0):
                z = side * e - flank
                root = np.sqrt(z**2 + (0.02 * h) ** 2)
                force = force + side * each * 0.5 * (z + root)
                slope = slope + each * 0.5 * (1.0 + z / root)
        return force, slope

    return curved(curve)


def _hertz(p: Parameters, k: float, variable: str) -> Law:
    soft, hard = k * p["soft"], k * p["hard"]
    more = 1.0 / soft - 1.0 / hard

    def wind_up(torque: Array) -> Curved:
        given, slope = hertzian(torque, 0.3 * k * p["bend"])
        return torque / hard + more * given, 1.0 / hard + more * slope

    return winding(wind_up, hard)


def _cubic(p: Parameters, k: float, variable: str) -> Law:
    """Return the cubic of a fit to a test stand's range; straight on beyond it."""
    soft, more, end = k * p["soft"], k * (p["hard"] - p["soft"]), 2.0 * p["bend"]

    def curve(e: Array) -> Curved:
        inside, beyond = np.clip(e, -end, end), np.abs(e) > end
        force = soft * e + more * (inside**3 / (3.0 * end**2) + np.where(beyond, e - inside, 0.0))
        return force, soft + more * (inside / end) ** 2

    return curved(curve)


def _contacts(p: Parameters, _: float, variable: str) -> Law:
    """Return a spring with contacts, which give `more` than it at no torque."""
    k, start = p["stiffness"], p["from"]

    def wind_up(torque: Array) -> Curved:
        given, slope = hertzian(torque, k * start)
        return (torque + p["more"] * given) / k, (1.0 + p["more"] * slope) / k

    return winding(wind_up, k)


def _preloaded(p: Parameters, _: float, variable: str) -> Law:
    return curved(lambda e: slackening(e, p["stiffness"], p["loose"], p["from"]))


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
    """Return a few sliders beside a spring, each behind one of its own, whose yield strains grow by a ratio.

    The generalised Maxwell slip's elements without its sliding dynamics (Al-Bender, Lampaert and Swevers,
    2005). Later ones are softer, by the power `fall`; together they hold the friction torque.
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
    return machine.plus(
        crosses=(Cross(one, two, np.asarray(np.linalg.inv(soft) - np.diag([first, second]))),)
    )


def _belt(p: Parameters, machine: Machine, pair: str) -> Machine:
    """Return the machine with a belt, a strand of which hangs slack from a strain on."""
    one, two, first, second = pair_of(machine, pair)
    law = curved(lambda e: slackening(e, strong_of(p) * first, 0.5, p["slack"]))
    return machine.plus(meshes=(Mesh(one, two, (1.0, equal_of(p, first, second)), law),))


def _eccentric(p: Parameters, machine: Machine, pair: str) -> Machine:
    one, two, first, second = pair_of(machine, pair)

    def meshing(situation: Situation) -> Array:
        wave = np.sin(situation.values[pair.split("+")[0]] + p["phase"])
        return np.asarray(strong_of(p) * first * (1.0 + p["depth"] * wave))

    return machine.plus(meshes=(Mesh(one, two, (1.0, equal_of(p, first, second)), varying(meshing)),))


_FROM = by_ratio(1e-4, 1e-3)  # strain about which the stiffness changes
_ARRIVED = evenly(-0.9, 0.9)  # friction left over from the move to the pose
_COUPLED: dict[str, Draw] = {"share": signed(sized(*author1.SHARE)), "ratio": evenly(0.6, 1.6)}
FORMS = (
    law("backlash", "arctan", _arctan, author1.draw_backlash),
    law("backlash", "planets", _planets, author1.draw_backlash, spread=evenly(0.3, 0.8)),
    law("hardening", "hertz", _hertz, author1.draw_hardening),
    law("hardening", "cubic", _cubic, author1.draw_hardening),
    law("joint-compliance", "hertz", _contacts,
        author1.draw_compliance, **{"from": _FROM, "more": evenly(0.5, 2.0)}),
    law("joint-compliance", "preloaded", _preloaded,
        author1.draw_compliance, **{"from": _FROM, "loose": evenly(0.3, 0.6)}),
    law("hysteresis", "dahl", _dahl, author1.draw_friction, arrived=_ARRIVED),
    law("hysteresis", "maxwell-slip", _maxwell_slip,
        author1.draw_friction, arrived=_ARRIVED, ratio=evenly(1.8, 3.5), fall=evenly(0.3, 1.2)),
    built("joint-coupling", "belt", _belt, **_COUPLED, slack=by_ratio(1e-4, 1e-3)),
    built("joint-coupling", "eccentric", _eccentric, **_COUPLED, depth=evenly(0.3, 0.8), phase=PHASE),
    built("joint-coupling", "bracket", _bracket, **_COUPLED),
)  # fmt: skip
