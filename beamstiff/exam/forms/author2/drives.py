"""Further forms of drives: play, hardening, joints that are not stiff, friction, and coupling of two."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, stiffness_of
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.laws import Curve, Friction, Law, Memory, Remembering, Situation, Stiffness, WindUp
from beamstiff.exam.machine import Cross, Mesh, joints_of
from beamstiff.exam.reality import Reality

Curved = tuple[Array, Array]
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


def _draw_play(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_backlash(request)
    if request.form == "planets":
        found["spread"] = request.uniform(0.3, 0.8)  # of the half play, from planet to planet
    return found


def _play(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    h, left = p["half"], p["left"]

    def arctan(torque: Array, k: float) -> Curved:
        x = torque / (2.0 * left * k * h)
        share = 2.0 / np.pi
        return torque / k + h * share * np.arctan(x), 1.0 / k + share / (2.0 * left * k * (1.0 + x**2))

    def planets(e: Array, k: float) -> Curved:
        force, slope = left * k * e, np.full_like(e, left * k)
        each = (1.0 - left) * k / 3.0
        for flank in h * (1.0 - p["spread"] * np.array([1.0, 0.4, 0.0])):
            for side in (1.0, -1.0):
                z = side * e - flank
                root = np.sqrt(z**2 + (0.02 * h) ** 2)
                force = force + side * each * 0.5 * (z + root)
                slope = slope + each * 0.5 * (1.0 + z / root)
        return force, slope

    if truth.form == "arctan":
        return at_joints(truth, reality, lambda k: WindUp(lambda torque: arctan(torque, k), k))
    return at_joints(truth, reality, lambda k: Curve(lambda e: planets(e, k)))


def _hardening(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters

    def hertz(torque: Array, k: float) -> Curved:
        soft, hard = k * p["soft"], k * p["hard"]
        more = 1.0 / soft - 1.0 / hard
        given, slope = hertzian(torque, 0.3 * k * p["bend"])
        return torque / hard + more * given, 1.0 / hard + more * slope

    def cubic(e: Array, k: float) -> Curved:
        # the cubic of a fit to a test stand's range; straight on beyond it
        soft, more, end = k * p["soft"], k * (p["hard"] - p["soft"]), 2.0 * p["bend"]
        inside, beyond = np.clip(e, -end, end), np.abs(e) > end
        force = soft * e + more * (inside**3 / (3.0 * end**2) + np.where(beyond, e - inside, 0.0))
        return force, soft + more * (inside / end) ** 2

    if truth.form == "hertz":
        return at_joints(truth, reality, lambda k: WindUp(lambda torque: hertz(torque, k), k * p["hard"]))
    return at_joints(truth, reality, lambda k: Curve(lambda e: cubic(e, k)))


def _draw_compliance(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_compliance(request)
    found["from"] = request.log_uniform(1e-4, 1e-3)  # strain about which it changes
    if request.form == "hertz":
        found["more"] = request.uniform(0.5, 2.0)  # give of the contacts over the spring's
    else:
        found["loose"] = request.uniform(0.3, 0.6)
    return found


def _compliance(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    k, start = p["stiffness"], p["from"]

    def hertz(torque: Array) -> Curved:
        given, slope = hertzian(torque, k * start)
        return (torque + p["more"] * given) / k, (1.0 + p["more"] * slope) / k

    law: Law = (
        WindUp(hertz, k) if truth.form == "hertz" else Curve(lambda e: slackening(e, k, p["loose"], start))
    )
    return at_joints(truth, reality, lambda _: law)


def _draw_friction(request: DrawRequest) -> dict[str, float]:
    found = author1.draw_friction(request)
    found["arrived"] = request.uniform(-0.9, 0.9)  # friction left over from the move to the pose
    if request.form == "maxwell-slip":
        found["ratio"] = request.uniform(1.8, 3.5)  # of a slider's yield strain to the one before
        found["fall"] = request.uniform(0.3, 1.2)  # power by which later ones are softer
    return found


def _friction(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    if truth.form == "dahl":
        return at_joints(truth, reality, lambda k: Dahl(k, k * p["friction"], p["arrived"], p["sliding"]))
    return at_joints(
        truth,
        reality,
        lambda k: MaxwellSlip(k, k * p["friction"], p["sliding"], p["ratio"], p["fall"], p["arrived"]),
    )


@dataclass(frozen=True)
class Dahl(Friction):
    """Dahl's friction with exponent 2, integrated in closed form along each step.

    ``dz/de = (1 - z sign(de))^2 / e_slip``, beside a spring (P. R. Dahl, A solid friction model, 1968).
    """

    sliding: float

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state and its slope after a way."""
        slip = self.friction * (1.0 - self.sliding) / (self.stiffness * self.sliding)
        short = 1.0 - state  # of sliding freely
        short = short / (1.0 + short * way / slip)
        return 1.0 - short, short**2 / slip


@dataclass(frozen=True)
class MaxwellSlip(Remembering):
    """A few sliders beside a spring, each behind a spring of its own, whose yield strains grow by a ratio.

    The generalised Maxwell slip's elements without its sliding dynamics (Al-Bender, Lampaert and Swevers,
    2005). Later ones are softer; together they hold the friction torque.
    """

    stiffness: float
    friction: float
    sliding: float
    ratio: float
    fall: float
    arrived: float

    def start(self, situation: Situation) -> Memory:
        """Return strain and the sliders' forces after the move to the pose."""
        poses = len(situation.time)
        return np.zeros(poses), np.tile(self.arrived * self._sliders()[1], (poses, 1))

    def _sliders(self) -> tuple[Array, Array]:
        """Return the stiffness and the largest force of every slider."""
        yields = self.ratio ** np.arange(SLIDERS)
        k = yields**-self.fall
        k = k * self.stiffness * self.sliding / ((1.0 - self.sliding) * k.sum())
        most = k * yields
        return k, most * self.friction / most.sum()

    def respond(self, strain: Array, situation: Situation, memory: Memory) -> tuple[Array, Array, Memory]:
        """Return force, tangent and the sliders after."""
        before, held = memory
        k, most = self._sliders()
        tried = held + k * (strain - before)[:, None]
        now = np.clip(tried, -most, most)
        sticking = np.abs(tried) <= most
        return self.stiffness * strain + now.sum(axis=1), self.stiffness + sticking @ k, (strain, now)


def _draw_coupling(request: DrawRequest) -> dict[str, float]:
    found = {"share": request.sign() * request.sized(*author1.SHARE), "ratio": request.uniform(0.6, 1.6)}
    if request.form == "belt":
        found["slack"] = request.log_uniform(1e-4, 1e-3)  # strain where a strand is slack
    if request.form == "eccentric":
        found |= {"depth": request.uniform(0.3, 0.8), "phase": request.uniform(0.0, 2.0 * np.pi)}
    return found


def _coupling(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    names = str(truth.component).split("+")
    first, second = (stiffness_of(machine.robot, name) for name in names)
    one, two = (joints_of(machine.robot, name)[0] for name in names)
    # with equal weights a spring of this over the first drive's stiffness couples by the wanted share
    strong = abs(p["share"]) / (1.0 - abs(p["share"]))
    if truth.form == "bracket":
        gives = np.array([1.0, np.sign(p["share"]) * p["ratio"] * np.sqrt(first / second)])
        soft = np.diag([1.0 / first, 1.0 / second]) + strong / first * np.outer(gives, gives)
        added = np.asarray(np.linalg.inv(soft) - np.diag([first, second]), dtype=np.float64)
        crosses = (*machine.crosses, Cross(one, two, added))
        return reality.with_machine(dataclasses.replace(machine, crosses=crosses))
    weights = (1.0, float(-np.sign(p["share"]) * p["ratio"] * np.sqrt(second / first)))

    def meshing(situation: Situation) -> Array:
        wave = np.sin(situation.values[names[0]] + p["phase"])
        return np.asarray(strong * first * (1.0 + p["depth"] * wave))

    law: Law = (
        Curve(lambda e: slackening(e, strong * first, 0.5, p["slack"]))
        if truth.form == "belt"
        else Stiffness(meshing)
    )
    mesh = Mesh(one, two, weights, law)
    return reality.with_machine(machine.plus(meshes=(mesh,)))


EFFECTS: tuple[Effect, ...] = (
    Effect("backlash", ("arctan", "planets"), drives, _draw_play, _play),
    Effect("hardening", ("hertz", "cubic"), drives, author1.draw_hardening, _hardening),
    Effect("joint-compliance", ("hertz", "preloaded"), author1.rigid_joints, _draw_compliance, _compliance),
    Effect("hysteresis", ("dahl", "maxwell-slip"), drives, _draw_friction, _friction),
    Effect(
        "joint-coupling", ("belt", "eccentric", "bracket"), author1.coupled_drives, _draw_coupling, _coupling
    ),
)
