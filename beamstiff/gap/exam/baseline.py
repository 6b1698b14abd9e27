"""How large a gap is: what the best fit without effects leaves of noise-free rows, over the noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from beamstiff.gap.exam.campaign import Campaign, Truth
from beamstiff.gap.exam.cases import Case, without_noise
from beamstiff.gap.exam.simulate import simulate
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array

Baseline = Callable[[Case, Sequence[Sequence[Truth]]], list[Array]]
"""Residuals (N, 6), m and rad, that the fitted model leaves of the noise-free rows of each set of truths."""

STEP = 0.02  # of a compliance, relative: beyond the solver's rounding, and compliances act linearly


def linear_baseline(case: Case, sets: Sequence[Sequence[Truth]]) -> list[Array]:
    """Return residuals of a linear least-squares fit of the compliances that the robot lists to identify.

    The rows' derivatives by the compliances are differences of the simulator's own answers without effects,
    at the true stiffness; values are weighted by the true noise. It shares nothing with the diagnosis.
    """
    still = true_rows(case.machine, (), case.campaign)
    columns = []
    for name in case.robot.identify:  # of none, the gap is all that the effects do
        softer = case.machine.with_parameters({name: case.machine.parameter(name) / (1.0 + STEP)})
        columns.append((true_rows(softer, (), case.campaign) - still) / STEP)
    weight = weights(case.campaign)
    known = ~np.isnan(still) & (weight > 0)
    basis = np.stack(columns, axis=-1) if columns else np.zeros((*still.shape, 0))
    matrix = (basis * weight[:, None])[known]
    residuals = []
    for truths in sets:
        gap = true_rows(case.machine, truths, case.campaign) - still
        found = np.linalg.lstsq(matrix, (gap * weight)[known], rcond=1e-12)[0]
        residuals.append(gap - basis @ found)
    return residuals


def true_rows(machine: Robot, truths: Sequence[Truth], campaign: Campaign) -> Array:
    """Return what a perfect instrument reads, (N, 6); NaN where the campaign reads nothing."""
    return simulate(machine, truths, without_noise(campaign), np.random.default_rng(0)).measured


def weights(campaign: Campaign) -> Array:
    """Return one over the standard deviation of each of the six values; 0 for rotations that are not read."""
    rotation = 1.0 / campaign.sigma_rotation if campaign.rotations else 0.0
    return np.repeat([1.0 / campaign.sigma_position, rotation], 3)


def whitened_gap(campaign: Campaign, residual: Array) -> float:
    """Return the root mean square over the values read of the residual, each over its own noise."""
    values = residual * weights(campaign)
    read = values[:, :6] if campaign.rotations else values[:, :3]
    return float(np.sqrt(np.nanmean(np.square(read))))
