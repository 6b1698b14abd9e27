"""Third forms of drives: play, hardening, joints that are not stiff, friction, and coupling of two."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, stiffness_of, stroke, turns
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.forms.author2.drives import hertzian
from beamstiff.exam.laws import (
    Curve,
    Forgetful,
    Friction,
    Law,
    Memory,
    Remembering,
    Situation,
    Stiffness,
    WindUp,
)
from beamstiff.exam.machine import Mesh, Weight, joints_of
from beamstiff.exam.reality import Reality

Curved = tuple[Array, Array]
PER_METRE = 6.0  # rad of a pinion's turn for a metre of its rack
ROUNDED = 0.02  # of the play, about which a flank's contact closes
PINS = 18  # of a cycloid disc that can carry one way
FURTHEST = 0.9  # share of half a band's length that a strand can lose to the other
RUBBING = (0.04, 0.45)  # friction over the torque that passes: from a good gear to a worm
PRESSED = 0.2  # of the strain where motion turns round, that its way is longer by
SOFTER = (0.06, 1.2)  # what a slipping hub gives, over what the rest of the drive gives
SERVED = np.deg2rad(70.0)  # to either side: what a crank can turn before its rod stands across
LINEAR = 0.4  # share of the shafts, which are linear, in what bevel gears give at first


@dataclass(frozen=True)
class Posed(Forgetful):
    """A spring whose force curve changes with the pose.

    `curve`: force and its slope, (P,) each, from the strain (P,) and the situation.
    """

    curve: Callable[[Array, Situation], Curved]

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, slope and no memory."""
        force, slope = self.curve(strain, situation)
        return force, slope, memory


def _angle(truth: Truth, reality: Reality, situation: Situation) -> Array:
    """Return the angle of the joint's own wheel, rad: of a pinion where the joint slides."""
    q = situation.value(str(truth.component))
    return q if turns(reality.machine.robot, truth.component) else PER_METRE * q


def _draw_play(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_backlash(request)
    if request.form == "runout":
        return found | {"depth": request.uniform(0.3, 0.9), "phase": request.uniform(0.0, 2.0 * np.pi)}
    scale = 1.0 if turns(request.robot, request.component) else 0.1
    return found | {
        "preload": scale * request.log_uniform(2e-5, 1e-4),  # torque over the stiffness
        "growth": request.uniform(0.3, 1.0),  # of the preload while the play is crossed
        "way": request.sign(),
    }


def _play(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with play in the drive.

    ``runout``: the output gear sits off its centre, so that the play between its flanks grows and shrinks
    once a turn; known from gear metrology (radial run-out and tooth thickness, ISO 1328, make the range of
    the backlash), its depth an engineering estimate.

    ``scissors``: a split gear whose halves a spring spreads holds both flanks; a torque above the spring's
    preload crosses the whole play, one way only. Anti-backlash gears, any textbook of machine elements; the
    preloads are an engineering estimate.
    """
    p = truth.parameters
    h, left = p["half"], p["left"]

    def runout(e: Array, situation: Situation, k: float) -> Curved:
        half = h * (1.0 + p["depth"] * np.cos(_angle(truth, reality, situation) + p["phase"]))
        force, slope = left * k * e, np.full_like(e, left * k)
        for side in (1.0, -1.0):
            z = side * e - half
            root = np.hypot(z, ROUNDED * h)
            force = force + side * (1.0 - left) * k * 0.5 * (z + root)
            slope = slope + (1.0 - left) * k * 0.5 * (1.0 + z / root)
        return force, slope

    def scissors(torque: Array, k: float) -> Curved:
        width = p["growth"] * p["preload"] * k
        x = (p["way"] * torque - p["preload"] * k) / width
        root, before = np.hypot(1.0, x), 1.0 / p["growth"]
        crossed = h * (x / root + before / np.hypot(1.0, before))
        return torque / k + p["way"] * crossed, 1.0 / k + h / (width * root**3)

    if truth.form == "runout":
        return at_joints(truth, reality, lambda k: Posed(lambda e, situation: runout(e, situation, k)))
    return at_joints(truth, reality, lambda k: WindUp(lambda torque: scissors(torque, k), k))


def _draw_hardening(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_hardening(request)
    if request.form == "lobes":
        return found | {"shortened": request.uniform(0.6, 0.8)}
    return found | {"coast": request.log_uniform(1.5, 5.0) ** request.sign()}


def levers(shortened: float) -> Array:
    """Return the lever arms of a cycloid disc's pins, over the longest one that there can be."""
    angle = (np.arange(PINS) + 0.5) * np.pi / PINS
    return np.asarray(np.sin(angle) / np.sqrt(1.0 + shortened**2 - 2.0 * shortened * np.cos(angle)))


def _hardening(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a drive that grows stiffer with torque.

    ``lobes``: in a cycloid reducer relieved flanks of the disc leave gaps at all pins but one, which close
    one after another as it winds up, so that ever more pins carry. The gaps are those of Yu and others for a
    relieved disc, ``g (1 - l)`` with l a pin's lever (given in papers on the load distribution in RV gears);
    the pins that carry from the start are an engineering estimate.

    ``hypoid``: flanks of different pressure angle carry either way, as in hypoid and bevel gears (Gleason);
    the stiffness rises both ways but from different torques. The curve is an engineering estimate.
    """
    p = truth.parameters

    def lobes(e: Array, k: float) -> Curved:
        arm = levers(p["shortened"])
        closed = np.abs(e)[:, None] * arm - p["bend"] * (1.0 - arm)
        more = k * (p["hard"] - p["soft"]) / float(arm @ arm)
        force = k * p["soft"] * e + np.sign(e) * more * (np.maximum(closed, 0.0) @ arm)
        return force, k * p["soft"] + more * ((closed > 0.0) @ arm**2)

    def hypoid(torque: Array, k: float) -> Curved:
        more = (1.0 / p["soft"] - 1.0 / p["hard"]) / k
        knee = 0.5 * k * p["bend"] * np.where(torque < 0.0, p["coast"], 1.0)
        x = torque / knee
        return torque / (k * p["hard"]) + more * knee * np.arcsinh(x), 1.0 / (
            k * p["hard"]
        ) + more / np.hypot(1.0, x)

    if truth.form == "lobes":
        return at_joints(truth, reality, lambda k: Curve(lambda e: lobes(e, k)))
    return at_joints(truth, reality, lambda k: WindUp(lambda torque: hypoid(torque, k), k * p["hard"]))


def _draw_compliance(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_compliance(request)
    if request.form == "strands":
        return found | {"reach": request.uniform(0.5, 0.85)}
    return found | {
        "spokes": request.integer(3, 7),
        "depth": request.uniform(0.2, 0.6),
        "phase": request.uniform(0.0, 2.0 * np.pi),
    }


def _compliance(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a joint that the model holds stiff.

    ``strands``: a band or cable pulls it from either side, and what one strand gains in length the other
    loses, so that the two together are softest in the middle of the stroke: ``1/L1 + 1/L2``. Catalogues of
    belt-driven axes (Gates, HIWIN) compute the stiffness so.

    ``spokes``: the wheel that holds the joint is softer between its spokes or bolts than at them. Known of
    bull gears and turntables; the depth is an engineering estimate.
    """
    p = truth.parameters
    middle, half = stroke(reality.machine.robot, truth.component)

    def strands(situation: Situation) -> Array:
        q = situation.value(str(truth.component), middle)
        share = np.clip(p["reach"] * (q - middle) / half, -FURTHEST, FURTHEST)
        return np.asarray(p["stiffness"] / (1.0 - share**2))

    def spokes(situation: Situation) -> Array:
        wave = np.cos(p["spokes"] * _angle(truth, reality, situation) + p["phase"])
        return np.asarray(p["stiffness"] / (1.0 + p["depth"] * wave))

    law: Law = Stiffness(strands if truth.form == "strands" else spokes)
    return at_joints(truth, reality, lambda _: law)


def _draw_friction(request: DrawRequest) -> dict[str, float]:
    scale = 1.0 if turns(request.robot, request.component) else 0.1
    found = {"arrived": request.uniform(-0.9, 0.9)}  # friction left over from the move to the pose
    if request.form == "teeth":
        return found | {
            "rubbing": request.sized(*RUBBING),
            "seals": scale * request.log_uniform(2e-6, 2e-5),  # torque over the stiffness
            "slip": scale * request.log_uniform(4e-5, 2e-4),
        }
    return found | {
        "softer": request.sized(*SOFTER),
        "breaks": scale * request.log_uniform(2e-5, 1.5e-4),  # torque over the stiffness
    }


def _friction(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with friction in the drive.

    ``teeth``: friction of the loaded flanks is a share of the torque that passes them, so that the loop is
    narrow where the load is small and opens with it. The loss factor of gears and screws in any textbook; the
    way over which it turns round is an engineering estimate.

    ``clamped``: a hub is held on its shaft by a shrink disc; above the disc's torque it slips until its key
    or bolts, which are elastic, hold it, and it stays where it went. Known from the design of clamped hubs;
    the sizes are an engineering estimate.
    """
    p = truth.parameters
    if truth.form == "teeth":
        return at_joints(
            truth, reality, lambda k: Teeth(k, k * p["seals"], p["arrived"], p["rubbing"], p["slip"])
        )
    return at_joints(truth, reality, lambda k: Clamped(k, k / p["softer"], k * p["breaks"], p["arrived"]))


@dataclass(frozen=True)
class Teeth(Friction):
    """A spring with friction that is a share of its force, and some more, and turns round over a way.

    The friction's state runs to the way of motion exponentially, as Dahl's with exponent 1. The way is longer
    where the teeth were pressed harder, as slip of contacts after Mindlin is.
    """

    rubbing: float
    slip: float

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent and the friction after."""
        before, held = memory
        slip = self.slip + PRESSED * np.abs(before)
        way = np.where(strain >= before, 1.0, -1.0)
        short = (way - held) * np.exp(-np.abs(strain - before) / slip)
        now = way - short
        size = np.hypot(strain, self.slip)
        most = self.friction + self.rubbing * self.stiffness * size
        growing = self.rubbing * self.stiffness * strain / size
        force = self.stiffness * strain + most * now
        return force, self.stiffness + growing * now + most * np.abs(short) / slip, (strain, now)


@dataclass(frozen=True)
class Clamped(Remembering):
    """A spring behind a slider, beside which a second spring holds what has slipped."""

    stiffness: float
    key: float
    breaks: float
    arrived: float

    def start(self, situation: Situation) -> Memory:
        """Return what has slipped, and the slider's force there, after the move to the pose."""
        # at rest no torque passes: the key's spring and the slider hold one another
        return (np.full(len(situation.time), 0.0), np.full(len(situation.time), self.arrived * self.breaks))

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent and the slip after."""
        slipped, locked = memory
        # the key is relaxed where the slip is locked / key behind its place
        tried = self.stiffness * (strain - slipped) - self.key * slipped + locked
        beyond = tried - np.clip(tried, -self.breaks, self.breaks)
        now = slipped + beyond / (self.stiffness + self.key)
        slope = np.where(beyond == 0.0, 1.0, self.key / (self.stiffness + self.key)) * self.stiffness
        return self.stiffness * (strain - now), slope, (now, locked)


def _draw_coupling(request: DrawRequest) -> dict[str, float]:
    found = {"share": request.sign() * request.sized(*author1.SHARE), "ratio": request.uniform(0.6, 1.6)}
    if request.form == "linkage":
        return found | {"start": request.uniform(-0.3, 0.3)}  # rad from the longest lever
    return found | {"preload": request.log_uniform(2e-5, 3e-4)}  # strain


def _coupling(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the two joints linked.

    ``linkage``: a rod from before the first axis, where its motor sits, to a crank on the second, as in
    palletisers; its lever on the second axis swings as the cosine of the crank's angle, and the coupling with
    it. Known from robots with a parallel rod (ABB IRB 6400, KUKA palletisers); sizes are an estimate.

    ``bevel``: bevel gears of a wrist pass torque between the axes, and their teeth grow stiffer with it as
    contacts after Hertz do. Known from hollow wrists with three shafts; sizes are an estimate.
    """
    p, machine = truth.parameters, reality.machine
    names = str(truth.component).split("+")
    first, second = (stiffness_of(machine.robot, name) for name in names)
    one, two = (joints_of(machine.robot, name)[0] for name in names)
    # with equal weights a spring of this over the first drive's stiffness couples by the wanted share
    strong = abs(p["share"]) / (1.0 - abs(p["share"])) * first
    equal = float(-np.sign(p["share"]) * p["ratio"] * np.sqrt(second / first))

    def swinging(situation: Situation) -> Array:
        middle, half = stroke(machine.robot, names[1])
        geared = min(1.0, SERVED / half)
        return np.asarray(equal * np.cos(p["start"] + geared * (situation.values[names[1]] - middle)))

    def teeth(torque: Array) -> tuple[Array, Array]:
        given, slope = hertzian(torque, strong * p["preload"])
        return (LINEAR * torque + (1.0 - LINEAR) * given) / strong, (LINEAR + (1.0 - LINEAR) * slope) / strong

    weight: Weight = swinging if truth.form == "linkage" else equal
    law: Law = WindUp(teeth, strong / LINEAR)
    if truth.form == "linkage":
        law = Stiffness(lambda situation: np.full(len(situation.time), strong))
    mesh = Mesh(one, two, (1.0, weight), law)
    return reality.with_machine(machine.plus(meshes=(mesh,)))


EFFECTS: tuple[Effect, ...] = (
    Effect("backlash", ("runout", "scissors"), drives, _draw_play, _play),
    Effect("hardening", ("lobes", "hypoid"), drives, _draw_hardening, _hardening),
    Effect("joint-compliance", ("strands", "spokes"), author1.rigid_joints, _draw_compliance, _compliance),
    Effect("hysteresis", ("teeth", "clamped"), drives, _draw_friction, _friction),
    Effect("joint-coupling", ("linkage", "bevel"), author1.coupled_drives, _draw_coupling, _coupling),
)
