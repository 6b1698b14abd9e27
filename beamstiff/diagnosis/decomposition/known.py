"""What is known of open parameters beforehand: the machine is built as described, or as it was calibrated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from beamstiff.calibration.parameters import GEOMETRY, SOFTER
from beamstiff.calibration.problem import Problem
from beamstiff.calibration.result import CORRELATION_DIGITS
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

# realistic deviations (1 mm, 1 mrad) from what is described, where the readings do not tell; and standard
# deviations from what a calibration found, for it took up a part of every cause that it did not know
FACTOR = 10.0


def known_beforehand(
    robot: Robot,
    problem: Problem,
    change: Mapping[str, float],
    noise: float = 1.0,
    spread: float = FACTOR,
    drives: bool = False,
) -> tuple[Array, Array]:
    """Return rows (p,) and (p, t) behind the residual and the tangent of an open model.

    Parameters
    ----------
    robot : Robot
        As it was given: described, or calibrated before.
    problem : Problem
        Of t parameters, about the present calibration.
    change : mapping of str to float
        Of every parameter from the robot as given to the present calibration, SI.
    noise : float
        Of the readings, over what is stated: all counts beside it.
    spread : float
        Of lengths and angles about those described, in realistic deviations.
    drives : bool
        Whether compliances are within `SOFTER` times realistic ones of those described, too.
    """
    widths = dict.fromkeys(GEOMETRY, spread) | ({"compliance": SOFTER} if drives else {})
    places = [at for at, item in enumerate(problem.parameters) if item.group in widths]
    names = [problem.parameters[at].name for at in places]
    known = [problem.parameters[at] for at in places]
    described = np.diag([1.0 / (widths[item.group] * item.size) for item in known])
    weights = noise * np.concatenate([described, _as_calibrated(robot, names) / FACTOR])
    tangent = np.zeros((len(weights), len(problem.parameters)))
    tangent[:, places] = weights
    return -weights @ np.array([change[name] for name in names]), tangent


def _as_calibrated(robot: Robot, names: list[str]) -> Array:
    """Return rows (k, names) by which zeros and frames have unit noise, as an earlier calibration left them.

    Base and reflectors are set up anew for other readings: they are left out.
    """
    covariance, kept = calibrated_covariance(robot), []
    places = []
    for at, item in enumerate(robot.calibrated):
        if item.name in names:
            kept.append(at)
            places.append(names.index(item.name))
    rows = np.zeros((len(kept), len(names)))
    if kept:
        own = covariance[np.ix_(kept, kept)]
        std = np.sqrt(np.diag(own))
        values, vectors = np.linalg.eigh(own / np.outer(std, std))
        least = 10.0**-CORRELATION_DIGITS  # what rounding leaves of a direction that was known exactly
        rows[:, places] = vectors.T / np.sqrt(np.maximum(values, least))[:, None] / std
    return rows


def calibrated_covariance(robot: Robot) -> Array:
    """Return the covariance (k, k) of the parameters that the robot was calibrated by, SI."""
    std = np.array([item.std for item in robot.calibrated])
    correlation = np.eye(len(std))
    for at, item in enumerate(robot.calibrated):
        correlation[at, : len(item.correlation)] = item.correlation
        correlation[: len(item.correlation), at] = item.correlation
    return np.asarray(correlation * np.outer(std, std))
