"""How large a gap is: what the best fit without effects leaves of noise-free rows, over the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.machine import machine_of
from beamstiff.exam.reality import Reality
from beamstiff.exam.simulate import read, simulate, solve
from beamstiff.robot.description import Robot

STEP = 0.02  # of a compliance, relative: beyond the solver's rounding, and compliances act linearly


@dataclass(frozen=True, eq=False)
class Fit:
    """A model that is fitted to what a machine with effects reads in a campaign, without noise.

    `machine`: without effects, its stiffness true.
    `campaign`: without noise.
    `still`: (N, 6) array, m and rad; what is read without effects; NaN where nothing is.
    `basis`: (N, 6, t) array; derivatives of that by the logarithms of the compliances fitted.
    `weight`: (6,) array; one over the noise.
    """

    machine: Robot
    campaign: SimulatedCampaign
    still: Array
    basis: Array
    weight: Array

    def residual(self, truths: Sequence[Truth]) -> Array:
        """Return what the fit leaves of the gap that some effects make, (N, 6), m and rad."""
        known = ~np.isnan(self.still) & (self.weight > 0)
        gap = true_rows(self.machine, truths, self.campaign) - self.still
        matrix = (self.basis * self.weight[:, None])[known]
        found = np.linalg.lstsq(matrix, (gap * self.weight)[known], rcond=1e-12)[0]
        return np.asarray(gap - self.basis @ found)


def linear_fit(robot: Robot, machine: Robot, campaign: SimulatedCampaign) -> Fit:
    """Return the linear least-squares fit of the compliances that a robot lists to identify.

    The rows' derivatives by the compliances are differences of the simulator's own answers without effects,
    at the true stiffness; values are weighted by the true noise. It shares nothing with the diagnosis.
    """
    exact = without_noise(campaign)
    reality = Reality(machine_of(machine))
    solved = solve(reality, exact)
    still = read(reality, exact, solved)
    columns = []
    for name in robot.identify:  # of none, the gap is all that the effects do
        softer = Reality(machine_of(machine.with_parameters({name: machine.parameter(name) / (1.0 + STEP)})))
        columns.append((read(softer, exact, solve(softer, exact, solved, once=True)) - still) / STEP)
    if not campaign.rotations:
        still[:, 3:] = np.nan
    basis = np.stack(columns, axis=-1) if columns else np.zeros((*still.shape, 0))
    return Fit(machine, exact, still, basis, weights(campaign))


def true_rows(machine: Robot, truths: Sequence[Truth], campaign: SimulatedCampaign) -> Array:
    """Return what a perfect instrument reads, (N, 6); NaN where the campaign reads nothing."""
    return simulate(machine, truths, without_noise(campaign), np.random.default_rng(0)).measured


def weights(campaign: SimulatedCampaign) -> Array:
    """Return one over the standard deviation of each of the six values; 0 for rotations that are not read."""
    rotation = 1.0 / campaign.sigma_rotation if campaign.rotations else 0.0
    return np.repeat([1.0 / campaign.sigma_position, rotation], 3)


def whitened_gap(campaign: SimulatedCampaign, residual: Array) -> float:
    """Return the root mean square over the values read of the residual, each over its own noise."""
    values = residual * weights(campaign)
    read = values[:, :6] if campaign.rotations else values[:, :3]
    return float(np.sqrt(np.nanmean(np.square(read))))


def without_noise(campaign: SimulatedCampaign) -> SimulatedCampaign:
    """Return the campaign as a perfect instrument would make it."""
    return replace(
        campaign, sigma_position=0.0, sigma_rotation=0.0, claimed_position=None, claimed_rotation=None
    )
