"""Further forms of the drives' springs: play, hardening, and joints that are not stiff."""

from __future__ import annotations

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives
from beamstiff.exam.forms.author1 import drives as author1
from beamstiff.exam.laws import Curve, Law, WindUp
from beamstiff.exam.reality import Reality

Curved = tuple[Array, Array]


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


EFFECTS = (
    Effect("backlash", ("arctan", "planets"), drives, _draw_play, _play),
    Effect("hardening", ("hertz", "cubic"), drives, author1.draw_hardening, _hardening),
    Effect("joint-compliance", ("hertz", "preloaded"), author1.rigid_joints, _draw_compliance, _compliance),
)
