"""Further forms of wrong geometry and payload."""

import numpy as np

from beamstiff.exam.added_parts import with_loose_mass
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import drive_of, stroke
from beamstiff.exam.draws import direction, evenly, sized
from beamstiff.exam.effect import built, form
from beamstiff.exam.forms.author1 import geometry as author1
from beamstiff.exam.machine import Hose, Machine
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.reality import Reality
from beamstiff.robot.parts import FRAME_PARAMETERS

SMALL = 0.08  # of the named error's size: others that come with it
HEIGHT = 1.5  # m: the size of a hose is what hangs from there
GRAVITY = 9.81
FURTHEST = 0.12  # m that a loose part slides under its weight


def _draw_geometry(request: DrawRequest) -> dict[str, float]:
    component = str(request.component)
    plain = author1.draw_geometry(request)
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


def _hose(p: Parameters, machine: Machine, _: str) -> Machine:
    return machine.plus(hoses=(Hose(machine.tcp, p["per_metre"], p["low"]),))


def _loose(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a part of the payload that sits loose along an axis."""
    held = np.full(6, np.inf)
    held[0] = p["mass"] * GRAVITY / p["slides"]
    return with_loose_mass(machine, vector(p), p["away"], p["mass"], held)


FORMS = (
    form("geometry-error", "eccentric", _geometry, _draw_geometry),
    form("geometry-error", "crooked", _geometry, _draw_geometry),
    built("payload-error", "hose", _hose,
          per_metre=lambda request: request.sized(*author1.MASS) / HEIGHT, low=evenly(-0.3, 0.3)),
    built("payload-error", "loose", _loose, direction(),
          mass=sized(*author1.MASS), slides=lambda request: FURTHEST * request.uniform(0.3, 1.0),
          away=evenly(0.0, 0.1)),
)  # fmt: skip
