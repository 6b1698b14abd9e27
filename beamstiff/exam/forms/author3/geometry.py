"""Third forms of wrong geometry and payload: oval wheels, many tolerances, things that roll or flow."""

from functools import partial

import numpy as np

from beamstiff.exam.added_parts import with_loose_mass
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import drive_of
from beamstiff.exam.draws import direction, evenly, signed, sized
from beamstiff.exam.effect import built, form
from beamstiff.exam.forms.author1 import geometry as author1
from beamstiff.exam.laws import Curved, winding
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import Draw, DrawRequest, Parameters, between, vector
from beamstiff.exam.reality import Reality
from beamstiff.robot.parts import FRAME_PARAMETERS

SMALL = 0.08  # of the named error's size: an oval wheel at a frame's drive
TOLERANCE = 0.03  # of the named error's size, one standard deviation: all other errors
GRAVITY = 9.81
FIRM = 1e-4  # of what it gives at first, that a loose thing gives at its bounds


def _size(component: str, size: float) -> float:
    angle = "." not in component or FRAME_PARAMETERS[component.rsplit(".", 1)[1]] == "angle"
    return between(size, *(author1.ANGLE if angle else author1.LENGTH))


def _draw_geometry(request: DrawRequest) -> dict[str, float]:
    component, robot = str(request.component), request.robot
    found = {"error": author1.draw_geometry(request)["error"]}
    if request.form == "oval":
        encoder = "." not in component
        share = request.uniform(0.3, 0.7) if encoder else SMALL
        return found | {
            "oval": share * request.sized(*author1.ANGLE),
            "phase": request.uniform(0.0, 2.0 * np.pi),
        }
    others = [name for name in map(str, author1.geometry_places(robot)) if name != component]
    if robot.loops:  # rigid loops would not close with lengths that do not fit
        others = [name for name in others if "." not in name]
    return found | {
        name: TOLERANCE * _size(name, request.size) * float(request.rng.standard_normal()) for name in others
    }


def _geometry(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with wrong kinematics.

    ``oval``: besides the error of its zero an encoder's track or its coupling is oval, or its shaft is bent
    in its universal joint, so that the angle errs twice a turn. Textbooks of angle measurement; a frame's
    error comes with a little of it at the frame's drive.

    ``tolerances``: one error stands out, and all others are there as well, far smaller, as manufacture and an
    earlier calibration leave them. What calibrations of real robots find.
    """
    component, p = str(truth.component), truth.parameters
    errors = {name: p[name] for name in p if name not in ("error", "oval", "phase")}
    reality = reality.with_errors({component: p["error"]} | errors)
    drive = drive_of(reality.machine.robot, component)
    kinds = {variable.name: variable.kind for variable in reality.machine.robot.actuated}
    if drive is None or "oval" not in p or kinds[drive] != "angle":
        return reality
    return reality.with_encoder(drive, lambda q: p["oval"] * np.sin(2.0 * q + p["phase"]))


def _payload(ways: tuple[int, ...], p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with something at the tool that the model lacks, and that moves within bounds.

    ``rolling``: a part that lies loose in a groove and goes to its lower end as soon as that is tilted.
    ``liquid``: paint, glue or coolant in an open-topped vessel, whose middle runs to the low side the further
    the more it is tilted, up to the wall. Engineering estimates both.

    `half`: m to either side. `tilt`: share of the weight along its way with which it has gone most of it.
    """
    turning = p["tilt"] * p["mass"] * GRAVITY

    def bounded(force: Array) -> Curved:
        x = force / turning
        root = np.hypot(1.0, x)
        firm = FIRM * p["half"] / turning
        return p["half"] * x / root + firm * force, p["half"] / (turning * root**3) + firm

    laws = dict.fromkeys(ways, winding(bounded, turning / (FIRM * p["half"])))
    return with_loose_mass(machine, vector(p), p["along"], p["mass"], np.full(6, np.inf), laws)


_LOOSE: dict[str, Draw] = {
    "mass": sized(*author1.MASS), "along": signed(evenly(0.0, 0.1)), "half": evenly(0.03, 0.12)
}  # fmt: skip
FORMS = (
    form("geometry-error", "oval", _geometry, _draw_geometry),
    form("geometry-error", "tolerances", _geometry, _draw_geometry),
    built("payload-error", "rolling", partial(_payload, (0,)),
          direction(), **_LOOSE, tilt=evenly(0.03, 0.12)),
    built("payload-error", "liquid", partial(_payload, (1, 2)),
          direction(), **_LOOSE, tilt=evenly(0.3, 0.8)),
)  # fmt: skip
