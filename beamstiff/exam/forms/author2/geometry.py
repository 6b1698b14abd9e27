"""Further forms of wrong geometry and payload."""

import dataclasses

import numpy as np

from beamstiff.exam.added_parts import with_loose_mass
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, drive_of, nowhere, stroke, vector
from beamstiff.exam.forms.author1 import geometry as author1
from beamstiff.exam.machine import Hose
from beamstiff.exam.reality import Reality
from beamstiff.robot.parts import FRAME_PARAMETERS

SMALL = 0.08  # of the named error's size: others that come with it
HEIGHT = 1.5  # m: the size of a hose is what hangs from there
GRAVITY = 9.81
FURTHEST = 0.12  # m that a loose part slides under its weight


def _draw_geometry(request: DrawRequest) -> dict[str, float]:
    component = str(request.component)
    plain = author1.draw_geometry(dataclasses.replace(request, form="single"))
    angle, length = (SMALL * request.sized(*r) for r in (author1.ANGLE, author1.LENGTH))
    if "." not in component:  # an encoder: its zero is off, and so is its track or its gear
        size = abs(plain["error"])
        if request.form == "eccentric":
            return plain | {
                "runout": size * request.uniform(0.3, 0.8),
                "phase": request.uniform(0.0, 2.0 * np.pi),
            }
        return plain | {"scale": size * request.sign() * request.uniform(0.1, 0.4)}
    if request.robot.loops:  # a rigid loop would not close with other errors
        return plain
    if request.form == "eccentric":
        return plain | {"runout": angle, "phase": request.uniform(0.0, 2.0 * np.pi)}
    own = component.rsplit(".", 1)[1]
    for parameter in ("d", "r", "alpha", "beta"):
        if parameter != own:
            kind = FRAME_PARAMETERS[parameter]
            plain[parameter] = request.sign() * (angle if kind == "angle" else length)
    return plain


def _geometry(truth: Truth, reality: Reality) -> Reality:
    component, p = str(truth.component), truth.parameters
    others = {f"{component.rsplit('.', 1)[0]}.{n}": p[n] for n in ("d", "r", "alpha", "beta") if n in p}
    reality = reality.with_errors({component: p["error"]} | others)
    robot = reality.machine.robot
    drive = drive_of(robot, component)
    if drive is None or not {"runout", "scale"} & set(p):
        return reality
    middle, _ = stroke(robot, drive)

    def encoder(q: Array) -> Array:
        return p.get("runout", 0.0) * np.sin(q + p.get("phase", 0.0)) + p.get("scale", 0.0) * (q - middle)

    return reality.with_encoder(drive, encoder)


def _draw_payload(request: DrawRequest) -> dict[str, float]:
    if request.form == "hose":
        return {"per_metre": request.sized(*author1.MASS) / HEIGHT, "low": request.uniform(-0.3, 0.3)}
    axis = request.direction()
    return axis | {
        "mass": request.sized(*author1.MASS),
        "slides": FURTHEST * request.uniform(0.3, 1.0),
        "away": request.uniform(0.0, 0.1),
    }


def _payload(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a hose that hangs at the tool, or a part of the payload that sits loose."""
    p, machine = truth.parameters, reality.machine
    if truth.form == "hose":
        hose = Hose(machine.tcp, p["per_metre"], p["low"])
        return reality.with_machine(machine.plus(hoses=(hose,)))
    held = np.full(6, np.inf)
    held[0] = p["mass"] * GRAVITY / p["slides"]
    return reality.with_machine(with_loose_mass(machine, vector(p), p["away"], p["mass"], held))


EFFECTS = (
    Effect("geometry-error", ("eccentric", "crooked"), author1.geometry_places, _draw_geometry, _geometry),
    Effect("payload-error", ("hose", "loose"), nowhere, _draw_payload, _payload),
)
