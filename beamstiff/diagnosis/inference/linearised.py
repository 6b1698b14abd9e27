"""The stiffness about which effects are linear: the one that is left when the likeliest cause is fitted too.

What an effect does depends on the stiffness of the rest: a wrong lever at the tool moves it by the
compliance of the drives. A fit without the effect bends that stiffness to follow the gap, by several times
where the gap is large. Effects are therefore weighed once more about the stiffness beside the likeliest cause
or pair, as Gauss and Newton do it, until that stays where it is.
"""

from collections.abc import Sequence

import numpy as np

from beamstiff.diagnosis.effects.torque_laws import change_of_drives
from beamstiff.diagnosis.held_out.score import Weighted, solve, stated
from beamstiff.diagnosis.inference.evidence import NoisePrior
from beamstiff.diagnosis.inference.noise_scale import scale_after
from beamstiff.diagnosis.inference.search import NONE, Search
from beamstiff.diagnosis.residual.baseline import Baseline, around
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

TURNS = 2  # new points at most
MOVED = 0.1  # of the logarithm of a stiffness, below which the point stays
SPREAD = 1.0  # standard deviation of a compliance about its nominal value, of that value
LEAST, MOST = 0.2, 5.0  # times its nominal value


def beside_the_cause(
    baseline: Baseline, white: Whitened, found: Search, scales: NoisePrior
) -> Baseline | None:
    """Return a baseline linear about the stiffness beside the likeliest cause or pair; None if it is.

    `white`: of it: what counts of it.
    `scales`: of the noise.
    """
    if not baseline.fitted or found.log_weight[NONE] > found.log_weight[found.named[0]]:
        return None
    pair = found.pairs[0] if found.pairs else None
    models: Sequence[Sequence[Weighted]] = [found.shapes[found.named[0]]]
    if pair is not None and pair.log_weight > found.log_weight[found.named[0]]:
        models = pair.shapes
    best = [[max(shapes, key=lambda one: one.weight)] for shapes in models]
    problem = stated(baseline, white.used, best, scale_after(white, models, scales))
    (_, _, columns, ridge), *_ = problem.ways
    count = len(baseline.fitted)
    change_by = change_of_drives(baseline)  # far off as most drives are, the file's values are guesses
    guess = 1.0 if LEAST < change_by < MOST else change_by
    nominal = 1.0 / (guess * _stiffness(baseline.nominal, baseline.fitted))
    now = 1.0 / _stiffness(baseline.robot, baseline.fitted)
    gap = problem.gap + columns[:, :count] @ (now - nominal)
    size = np.concatenate([nominal, np.ones(len(ridge) - count)])
    change, _ = solve(columns * size, np.concatenate([np.full(count, SPREAD**-2), ridge[count:]]), gap)
    beside = nominal * np.clip(1.0 + change[:count], LEAST, MOST)
    if np.abs(np.log(beside / now)).max() < MOVED:
        return None
    return around(baseline, 1.0 / beside)


def _stiffness(robot: Robot, names: Sequence[str]) -> Array:
    known = stiffness_parameters(robot)
    return np.array([known[name] for name in names])
