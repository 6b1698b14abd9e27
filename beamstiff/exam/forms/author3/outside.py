"""Third effects outside the table: a flange that slips, a gauge that sticks, a stand that the load moves."""

from functools import partial

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, sprung
from beamstiff.exam.campaign import Array
from beamstiff.exam.components import nowhere, slender
from beamstiff.exam.draws import around, by_ratio, evenly, product, sized, softer
from beamstiff.exam.effect import Seen, built, reading
from beamstiff.exam.laws import fading, rubbing
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import Parameters, vector
from beamstiff.exam.rotations import turn, turned_by

SOFT = ("soft_x", "soft_y", "soft_z")
STUCK = 4.0  # of the stiffness once it slips: that before


def _slipping(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine with a tool that slips sideways on its flange.

    Beyond the grip of its bolts it slides in their clearance, against their bending, and stays there when the
    load is taken off (VDI 2230). `give`: m/N once it slips; `grip`: N.
    """
    k = 1.0 / p["give"]
    across = rubbing(k, p["grip"], p["arrived"], partial(fading, reach=p["grip"] / (STUCK * k)))
    return sprung(*behind_flange(machine), -p["behind"] * UP, np.full(6, np.inf), {0: across, 1: across})


def _sticking(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values read by gauges along the base axes with a reversal error: they lag behind by a way.

    A few micrometres of dial gauges (ISO 463), up to some tenths of a millimetre of draw-wire sensors.
    """
    half, campaign, values = vector(p), seen.campaign, values.copy()
    shown: dict[tuple[int, str], Array] = {}
    for row in np.lexsort((np.arange(len(values)), campaign.step, campaign.pose)):
        key = (int(campaign.pose[row]), str(campaign.point[row]))
        # the gauges are set down anew in every pose; absolute ones on the first value
        last = shown.get(key, values[row, :3] if seen.absolute else np.zeros(3))
        values[row, :3] = shown[key] = np.clip(last, values[row, :3] - half, values[row, :3] + half)
    return values


def _stand(p: Parameters, seen: Seen, values: Array) -> Array:
    """Return values read from a stand on a plate that the load's reaction shifts and tilts.

    `soft_x` and so on: its give, m/N. `tall`, m.
    """
    head = -vector(p, SOFT) * seen.campaign.wrench[:, :3]  # where its head goes
    tilted = np.cross([0.0, 0.0, 1.0], head) / p["tall"]
    away = seen.places - np.array([p["u"], p["v"], p["tall"]])
    moved = values[:, :3] - (head + np.cross(tilted, away))
    return np.concatenate([moved, turned_by(turn(-tilted) @ turn(values[:, 3:]))], axis=1)


PLACES = dict.fromkeys(("slipping-flange", "sticking-gauge", "moving-stand"), nowhere)
FORMS = (
    built("slipping-flange", "clearance", _slipping,
          give=softer(sized(2e-8, 3e-7)), grip=lambda r: by_ratio(150.0, 900.0)(r) / slender(r.robot),
          behind=evenly(0.02, 0.15), arrived=evenly(-0.8, 0.8)),
    reading("sticking-gauge", "reversal", _sticking,
            **dict.fromkeys("xyz", product(sized(1e-5, 3e-4), evenly(0.5, 1.0)))),
    reading("moving-stand", "reaction", _stand, around(evenly(2.0, 5.0)),
            **dict.fromkeys(SOFT, product(softer(sized(3e-9, 4e-7)), evenly(0.5, 1.0))),
            tall=evenly(1.0, 2.0)),
)  # fmt: skip
