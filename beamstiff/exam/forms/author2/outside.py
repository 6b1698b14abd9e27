"""Further effects outside the table: drives softer one way or under load, and a tether to the ground."""

import numpy as np

from beamstiff.exam.added_parts import tied_to_ground
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import nowhere
from beamstiff.exam.draws import always, at_joint, by_ratio, direction, signed, sized
from beamstiff.exam.effect import built, curve
from beamstiff.exam.forms.author2.drives import slackening
from beamstiff.exam.laws import Curved
from beamstiff.exam.machine import Machine, drives_of
from beamstiff.exam.parameters import Parameters, vector


def _two_way(p: Parameters, k: float, e: Array) -> Curved:
    root = np.hypot(e, p["blunt"])
    return k * (e + p["uneven"] * (root - p["blunt"])), k * (1.0 + p["uneven"] * e / root)


def _tether(p: Parameters, machine: Machine, _: str) -> Machine:
    """Something elastic that ties the tool to the ground one way, a taut cable or a steady."""
    return tied_to_ground(machine, "tether", vector(p), np.array([p["stiffness"], 0.0, 0.0, 0.0, 0.0, 0.0]))


PLACES = {"uneven-drive": drives_of, "softening-drive": drives_of, "tether": nowhere}
FORMS = (
    curve("uneven-drive", "two-way", _two_way, uneven=signed(sized(0.05, 0.8)), blunt=at_joint(always(2e-5))),
    curve("softening-drive", "slackening", slackening,
          loose=sized(0.9, 0.2), **{"from": at_joint(by_ratio(5e-5, 5e-4))}),
    built("tether", "straight", _tether, direction(), stiffness=sized(2e4, 4e6)),
)  # fmt: skip
