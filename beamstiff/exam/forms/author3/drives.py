"""Third forms of drives: play, hardening, joints that are not stiff, friction, and coupling of two."""

import numpy as np

from beamstiff.exam.added_parts import pair_of
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import turns
from beamstiff.exam.draws import PHASE, SIGN, at_joint, by_ratio, evenly, signed, sized, whole
from beamstiff.exam.effect import Drive, built, curve, in_pose, law, wind_up
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.forms.author2.drives import equal_of, hertzian, strong_of
from beamstiff.exam.laws import Curved, Law, Memory, Situation, varying, winding
from beamstiff.exam.machine import Machine, Mesh, stroke
from beamstiff.exam.parameters import Draw, Parameters

PER_METRE = 6.0  # rad of a pinion's turn for a metre of its rack
ROUNDED = 0.02  # of the play, about which a flank's contact closes
PINS = 18  # of a cycloid disc that can carry one way
FURTHEST = 0.9  # share of half a band's length that a strand can lose to the other
RUBBING = (0.04, 0.45)  # friction over the torque that passes: from a good gear to a worm
PRESSED = 0.2  # of the strain where motion turns round, that its way is longer by
SOFTER = (0.06, 1.2)  # what a slipping hub gives, over what the rest of the drive gives
SERVED = np.deg2rad(70.0)  # to either side: what a crank can turn before its rod stands across
LINEAR = 0.4  # share of the shafts, which are linear, in what bevel gears give at first


def _angle(drive: Drive, situation: Situation) -> Array:
    """Return the angle of the joint's own wheel, rad: of a pinion where the joint slides."""
    q = situation.value(drive.component)
    return q if turns(drive.robot, drive.component) else PER_METRE * q


def _runout(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return an output gear off its centre: its play grows and shrinks once a turn (ISO 1328)."""
    half = p["half"] * (1.0 + p["depth"] * np.cos(_angle(drive, situation) + p["phase"]))
    k, left = drive.k, p["left"]
    force, slope = left * k * e, np.full_like(e, left * k)
    for side in (1.0, -1.0):
        z = side * e - half
        root = np.hypot(z, ROUNDED * p["half"])
        force = force + side * (1.0 - left) * k * 0.5 * (z + root)
        slope = slope + (1.0 - left) * k * 0.5 * (1.0 + z / root)
    return force, slope


def _scissors(p: Parameters, k: float, torque: Array) -> Curved:
    """Return an anti-backlash gear: two halves that a spring spreads hold both flanks.

    A torque above its preload crosses the whole play, one way only. `growth`: of the preload meanwhile.
    """
    width = p["growth"] * p["preload"] * k
    x = (p["way"] * torque - p["preload"] * k) / width
    root, before = np.hypot(1.0, x), 1.0 / p["growth"]
    crossed = p["half"] * (x / root + before / np.hypot(1.0, before))
    return torque / k + p["way"] * crossed, 1.0 / k + p["half"] / (width * root**3)


def levers(shortened: float) -> Array:
    """Return the lever arms of a cycloid disc's pins, over the longest one that there can be."""
    angle = (np.arange(PINS) + 0.5) * np.pi / PINS
    return np.asarray(np.sin(angle) / np.sqrt(1.0 + shortened**2 - 2.0 * shortened * np.cos(angle)))


def _lobes(p: Parameters, k: float, e: Array) -> Curved:
    """Return a cycloid reducer: relieved flanks of its disc leave gaps at all pins but one.

    They close one after another as it winds up, so that ever more pins carry: ``g (1 - l)`` with l a pin's
    lever, after Yu and others on the load distribution in RV gears.
    """
    arm = levers(p["shortened"])
    closed = np.abs(e)[:, None] * arm - p["bend"] * (1.0 - arm)
    more = k * (p["hard"] - p["soft"]) / float(arm @ arm)
    force = k * p["soft"] * e + np.sign(e) * more * (np.maximum(closed, 0.0) @ arm)
    return force, k * p["soft"] + more * ((closed > 0.0) @ arm**2)


def _hypoid(p: Parameters, k: float, torque: Array) -> Curved:
    """Return hypoid or bevel gears (Gleason), whose stiffness rises from another torque either way."""
    more = (1.0 / p["soft"] - 1.0 / p["hard"]) / k
    knee = 0.5 * k * p["bend"] * np.where(torque < 0.0, p["coast"], 1.0)
    x = torque / knee
    strain = torque / (k * p["hard"]) + more * knee * np.arcsinh(x)
    return strain, 1.0 / (k * p["hard"]) + more / np.hypot(1.0, x)


def _strands(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return a joint that a band or cable pulls from either side (catalogues of Gates, HIWIN).

    They are softest in the middle of the stroke: ``1/L1 + 1/L2``.
    """
    middle, half = stroke(drive.robot, drive.component)
    q = situation.value(drive.component, middle)
    share = np.clip(p["reach"] * (q - middle) / half, -FURTHEST, FURTHEST)
    k = p["stiffness"] / (1.0 - share**2)
    return k * e, k


def _spokes(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    """Return a bull gear or turntable, softer between its spokes or bolts than at them."""
    k = p["stiffness"] / (1.0 + p["depth"] * np.cos(p["spokes"] * _angle(drive, situation) + p["phase"]))
    return k * e, k


def _teeth(p: Parameters, k: float, variable: str) -> Law:
    """Return a spring with friction of the loaded flanks: a share of the torque that passes them.

    The friction's state runs to the way of motion exponentially, as Dahl's with exponent 1, over a way that
    is longer where the teeth were pressed harder, as slip after Mindlin is. `seals`: torque over stiffness.
    """

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        before, held = memory
        slip = p["slip"] + PRESSED * np.abs(before)
        way = np.where(strain >= before, 1.0, -1.0)
        short = (way - held) * np.exp(-np.abs(strain - before) / slip)
        now = way - short
        size = np.hypot(strain, p["slip"])
        most = k * p["seals"] + p["rubbing"] * k * size
        growing = p["rubbing"] * k * strain / size
        force = k * strain + most * now
        return force, k + growing * now + most * np.abs(short) / slip, (strain, now)

    return Law(respond, lambda poses: (np.zeros(poses), np.full(poses, p["arrived"])))


def _clamped(p: Parameters, k: float, variable: str) -> Law:
    """Return a spring behind a slider, beside which a second spring holds what has slipped.

    A hub slips above its shrink disc's torque until its key or bolts hold it, which are elastic, and stays
    where it went. `breaks`: torque over the stiffness.
    """
    key, breaks = k / p["softer"], k * p["breaks"]

    def start(poses: int) -> Memory:
        # at rest no torque passes: the key's spring and the slider hold one another
        return np.zeros(poses), np.full(poses, p["arrived"] * breaks)

    def respond(strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        slipped, locked = memory
        # the key is relaxed where the slip is locked / key behind its place
        tried = k * (strain - slipped) - key * slipped + locked
        beyond = tried - np.clip(tried, -breaks, breaks)
        now = slipped + beyond / (k + key)
        slope = np.where(beyond == 0.0, 1.0, key / (k + key)) * k
        return k * (strain - now), slope, (now, locked)

    return Law(respond, start)


def _linkage(p: Parameters, machine: Machine, pair: str) -> Machine:
    """Return the machine with a rod from the first axis' motor, before it, to a crank on the second.

    Its lever on the second axis swings as the cosine of the crank's angle (ABB IRB 6400, KUKA palletisers).
    `start`: rad from the longest lever.
    """
    one, two, first, second = pair_of(machine, pair)
    strong, equal, variable = strong_of(p) * first, equal_of(p, first, second), pair.split("+")[1]
    middle, half = stroke(machine.robot, variable)

    def swinging(situation: Situation) -> Array:
        geared = min(1.0, SERVED / half)
        return np.asarray(equal * np.cos(p["start"] + geared * (situation.values[variable] - middle)))

    law = varying(lambda situation: np.full(len(situation.time), strong))
    return machine.plus(meshes=(Mesh(one, two, (1.0, swinging), law),))


def _bevel(p: Parameters, machine: Machine, pair: str) -> Machine:
    """Return the machine with bevel gears of a hollow wrist, whose contacts stiffen; `preload`: strain."""
    one, two, first, second = pair_of(machine, pair)
    strong = strong_of(p) * first

    def teeth(torque: Array) -> Curved:
        given, slope = hertzian(torque, strong * p["preload"])
        return (LINEAR * torque + (1.0 - LINEAR) * given) / strong, (LINEAR + (1.0 - LINEAR) * slope) / strong

    mesh = Mesh(one, two, (1.0, equal_of(p, first, second)), winding(teeth, strong / LINEAR))
    return machine.plus(meshes=(mesh,))


_ARRIVED = evenly(-0.9, 0.9)  # friction left over from the move to the pose
_COUPLED: dict[str, Draw] = {"share": signed(sized(*author1.SHARE)), "ratio": evenly(0.6, 1.6)}
FORMS = (
    in_pose("backlash", "runout", _runout, author1.BACKLASH, depth=evenly(0.3, 0.9), phase=PHASE),
    wind_up("backlash", "scissors", _scissors, author1.BACKLASH,
            preload=at_joint(by_ratio(2e-5, 1e-4)), growth=evenly(0.3, 1.0), way=SIGN),
    curve("hardening", "lobes", _lobes, author1.draw_hardening, shortened=evenly(0.6, 0.8)),
    wind_up("hardening", "hypoid", _hypoid, author1.draw_hardening,
            coast=lambda request: float(by_ratio(1.5, 5.0)(request) ** request.sign())),
    in_pose("joint-compliance", "strands", _strands, author1.draw_compliance, reach=evenly(0.5, 0.85)),
    in_pose("joint-compliance", "spokes", _spokes, author1.draw_compliance,
            spokes=whole(3, 7), depth=evenly(0.2, 0.6), phase=PHASE),
    law("hysteresis", "teeth", _teeth, arrived=_ARRIVED, rubbing=sized(*RUBBING),
        seals=at_joint(by_ratio(2e-6, 2e-5)), slip=at_joint(by_ratio(4e-5, 2e-4))),
    law("hysteresis", "clamped", _clamped, arrived=_ARRIVED, softer=sized(*SOFTER),
        breaks=at_joint(by_ratio(2e-5, 1.5e-4))),
    built("joint-coupling", "linkage", _linkage, **_COUPLED, start=evenly(-0.3, 0.3)),
    built("joint-coupling", "bevel", _bevel, **_COUPLED, preload=by_ratio(2e-5, 3e-4)),
)  # fmt: skip
