"""The pose-by-pose recursion: the parameters are put right after each pose, in its turn (seed 003, eq. 12).

The paper solves ``dS = J dxi`` for one pose, updates, and goes on to the next: the shortest step that
explains this pose alone. It forgets the poses before, so noise keeps it moving. With `memory` the step counts
all that was seen so far (recursive least squares, a Kalman filter for a state at rest) and ends near the
estimate from all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beamstiff.calibration.parameters import LENGTH
from beamstiff.calibration.problem import Problem
from beamstiff.se3 import Array

SWEEPS = 3
NEGLIGIBLE = 1e-6  # singular value, of the largest, below which a pose says nothing
VAGUE = 5.0  # realistic deviations: what is known of a parameter before the first pose


@dataclass(frozen=True, eq=False)
class Recursion:
    """The way of the parameters, pose by pose; K steps."""

    theta: Array  # (K + 1, t)
    # position, orientation: (K + 1,), m and rad: root mean square over all poses of the residual's norm; NaN
    # where nothing of it was measured
    position: Array
    orientation: Array


def recursion(
    problem: Problem, begin: Array, identified: Sequence[str], sweeps: int = SWEEPS, memory: bool = False
) -> Recursion:
    """Return the recursion over all poses, `sweeps` times.

    `identified`: parameters that move, from `begin` (t,). `memory`: weigh each pose against all before it, by
    noise.
    """
    free = np.array([item.name in set(identified) for item in problem.parameters])
    # without memory the shortest step explains a pose: base and target must not take all of it
    size = np.array(
        [LENGTH if item.group in ("base", "target") else item.size for item in problem.parameters]
    )
    size = size[free]
    pose = problem.geometry.pose
    singles = [problem.some(np.flatnonzero(pose == at)) for at in dict.fromkeys(pose.tolist())]
    theta = begin.copy()
    way, gaps = [theta], [_sizes(problem, theta)]
    spread = VAGUE**2 * np.eye(size.size)
    for _ in range(sweeps):
        for single in singles:
            residual, jacobian = single.linearised(theta)
            count = single.count  # priors count once, not once a pose
            columns = jacobian[:count, free] * size
            if memory:
                seen = columns @ spread
                gain = np.linalg.solve(seen @ columns.T + np.eye(count), seen).T
                step = gain @ residual[:count]
                spread = spread - gain @ seen
                spread = 0.5 * (spread + spread.T)
            else:
                step = np.linalg.lstsq(columns, residual[:count], rcond=NEGLIGIBLE)[0]
            theta = theta.copy()
            theta[free] += size * step
            way.append(theta)
            gaps.append(_sizes(problem, theta))
    return Recursion(np.array(way), *np.array(gaps).T)


def _sizes(problem: Problem, theta: Array) -> tuple[float, float]:
    """Return the root mean squares of the residuals' norms in position and orientation."""
    gap = problem.gap(theta)
    found = []
    for part in (slice(0, 3), slice(3, 6)):
        measured = problem.used[:, part].any(axis=1)
        size = (gap[measured, part] ** 2).sum(axis=1)
        found.append(float(np.sqrt(size.mean())) if size.size else np.nan)
    return found[0], found[1]
