"""Further effects outside the table: drives softer one way or under load, and a tether to the ground."""

import numpy as np

from beamstiff.exam.added_parts import tied_to_ground
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, drives, nowhere, turns, vector
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import Curve
from beamstiff.exam.reality import Reality


def _draw_uneven(request: DrawRequest) -> dict[str, float]:
    return {
        "uneven": request.sign() * request.sized(0.05, 0.8),  # of the stiffness, more one way
        "blunt": 2e-5 * (1.0 if turns(request.robot, request.component) else 0.1),
    }


def _uneven(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters

    def curve(e: Array, k: float) -> tuple[Array, Array]:
        root = np.hypot(e, p["blunt"])
        return k * (e + p["uneven"] * (root - p["blunt"])), k * (1.0 + p["uneven"] * e / root)

    return at_joints(truth, reality, lambda k: Curve(lambda e: curve(e, k)))


def _draw_softening(request: DrawRequest) -> dict[str, float]:
    scale = 1.0 if turns(request.robot, request.component) else 0.1
    return {"loose": request.sized(0.9, 0.2), "from": scale * request.log_uniform(5e-5, 5e-4)}


def _softening(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    return at_joints(truth, reality, lambda k: Curve(lambda e: slackening(e, k, p["loose"], p["from"])))


def _draw_tether(request: DrawRequest) -> dict[str, float]:
    found = request.direction()
    return found | {"stiffness": request.sized(2e4, 4e6)}  # N/m


def _tether(truth: Truth, reality: Reality) -> Reality:
    """Something elastic that ties the tool to the ground one way, a taut cable or a steady."""
    k = np.array([truth.parameters["stiffness"], 0.0, 0.0, 0.0, 0.0, 0.0])
    return reality.with_machine(tied_to_ground(reality.machine, "tether", vector(truth.parameters), k))


EFFECTS = (
    Effect("uneven-drive", ("two-way",), drives, _draw_uneven, _uneven),
    Effect("softening-drive", ("slackening",), drives, _draw_softening, _softening),
    Effect("tether", ("straight",), nowhere, _draw_tether, _tether),
)
