"""Third effects outside the table: a flange that slips, a gauge that sticks, a stand that the load moves."""

from dataclasses import dataclass

import numpy as np

from beamstiff.exam.added_parts import UP, behind_flange, sprung
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, Effect, nowhere, slender
from beamstiff.exam.laws import Friction, fading
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality, places_of
from beamstiff.exam.rotations import turn, turned_by

STUCK = 4.0  # of the stiffness once it slips: that before


@dataclass(frozen=True)
class Slipping(Friction):
    """A spring with a grip beside it that slips over a short distance, and reverses over the same."""

    def run(self, state: Array, way: Array) -> tuple[Array, Array]:
        """Return the state and its slope after a way."""
        return fading(state, way, self.friction / (STUCK * self.stiffness))


def _draw_slipping(request: DrawRequest) -> dict[str, float]:
    return {
        "give": request.sized(2e-8, 3e-7) * slender(request.robot),  # m/N once it slips
        "grip": request.log_uniform(150.0, 900.0) / slender(request.robot),  # N
        "behind": request.uniform(0.02, 0.15),
        "arrived": request.uniform(-0.8, 0.8),
    }


def _slipping(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a tool that slips sideways on its flange.

    Beyond the grip of its bolts it slides in their clearance, against their bending, and stays there when the
    load is taken off: friction, but in no joint. Textbooks of bolted joints (VDI 2230); slips of up to some
    tenths of a millimetre are an engineering estimate.
    """
    p, (machine, flange) = truth.parameters, behind_flange(reality.machine)
    across = Slipping(1.0 / p["give"], p["grip"], p["arrived"])
    laws = {0: across, 1: across}
    return reality.with_machine(sprung(machine, flange, -p["behind"] * UP, np.full(6, np.inf), laws))


def _draw_sticking(request: DrawRequest) -> dict[str, float]:
    half = request.sized(1e-5, 3e-4)  # m
    return {name: half * request.uniform(0.5, 1.0) for name in "xyz"}


def _sticking(truth: Truth, reality: Reality) -> Reality:
    """Return the reality read by gauges along the base axes that follow only once they are pushed.

    Dial gauges and draw-wire sensors have a reversal error: what they read stays until the point has gone a
    way, and lags behind it by that from then on (ISO 463 for dial gauges, a few micrometres; data sheets of
    draw-wire sensors, up to some tenths of a millimetre).
    """
    half = np.array([truth.parameters[name] for name in "xyz"])

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        values = values.copy()
        shown: dict[tuple[int, str], Array] = {}
        for row in np.lexsort((np.arange(len(values)), campaign.step, campaign.pose)):
            key = (int(campaign.pose[row]), str(campaign.point[row]))
            # the gauges are set down anew in every pose; absolute ones on the first value
            last = shown.get(key, np.zeros(3) if campaign.kind == "displacement" else values[row, :3])
            shown[key] = np.clip(last, values[row, :3] - half, values[row, :3] + half)
            values[row, :3] = shown[key]
        return values

    return reality.with_reading(read)


def _draw_stand(request: DrawRequest) -> dict[str, float]:
    rng = request.rng
    angle, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(2.0, 5.0)
    soft = request.sized(3e-9, 4e-7) * slender(request.robot)  # m/N
    found = {f"soft_{name}": soft * request.uniform(0.5, 1.0) for name in "xyz"}
    return found | {
        "u": float(away * np.cos(angle)),
        "v": float(away * np.sin(angle)),
        "tall": request.uniform(1.0, 2.0),  # m of the stand
    }


def _stand(truth: Truth, reality: Reality) -> Reality:
    """Return the reality read from a stand that the load's reaction moves.

    The frame, winch or jack that loads the tool stands on the same plate as the tracker's stand, and its
    reaction, the load turned about, shifts and tilts that. Known from tests of structures, where gauges are
    never to stand on the reaction floor; sizes are an engineering estimate.
    """
    p = truth.parameters
    soft = np.array([p[f"soft_{name}"] for name in "xyz"])
    foot = np.array([p["u"], p["v"], 0.0])

    def read(campaign: SimulatedCampaign, placed: Placed, values: Array) -> Array:
        head = -soft * campaign.wrench[:, :3]  # where the stand's head goes
        tilted = np.cross([0.0, 0.0, 1.0], head) / p["tall"]
        values = values.copy()
        tracker = foot + np.array([0.0, 0.0, p["tall"]])
        seen = places_of(reality.machine, campaign.point, placed) - tracker
        values[:, :3] -= head + np.cross(tilted, seen)
        values[:, 3:] = turned_by(turn(-tilted) @ turn(values[:, 3:]))
        return values

    return reality.with_reading(read)


EFFECTS: tuple[Effect, ...] = (
    Effect("slipping-flange", ("clearance",), nowhere, _draw_slipping, _slipping),
    Effect("sticking-gauge", ("reversal",), nowhere, _draw_sticking, _sticking),
    Effect("moving-stand", ("reaction",), nowhere, _draw_stand, _stand),
)
