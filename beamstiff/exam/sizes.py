"""How large effects are: drawn by the gap that they are to leave, within what is realistic.

An effect's size runs from 0 to 1 over its realistic range. Drawn evenly, most effects would be invisible or
glaring: the gap over noise is drawn instead, and the size found that leaves about it, or the nearest one. The
gap is what the best fit without effects leaves of noise-free rows, over the noise.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import Reality
from beamstiff.exam.forms import draw_truth, resized
from beamstiff.exam.machine import machine_of
from beamstiff.exam.parameters import between
from beamstiff.exam.record import Kind
from beamstiff.exam.simulate import read, simulate, solve
from beamstiff.robot.description import Robot

STEP = 0.02  # of a compliance, relative: beyond the solver's rounding, and compliances act linearly
GAPS = (0.3, 6.0)  # over noise, evenly by ratio
FAINT = (0.05, 0.3)  # that may rightly be called nothing
FAINT_SHARE = 0.1
CLEARER = {"pair": (1.2, 6.0), "outside": (0.7, 6.0), "removed": (0.8, 6.0)}  # figures count from 1
CLOSE = 0.15  # of the gap's logarithm: a drawn gap need not be met better
MOST = 5  # sizes tried
DRAWS = 4  # of an effect, until one leaves
ENOUGH = 0.6  # of the wanted gap
SOME = 6  # poses that stand for a campaign's, more where they have few rows
ROWS = 60
USUAL = 4.0  # growth of the gap's logarithm from size 0 to 1
DIGITS = 3  # of a size: more could differ between machines, and the seal with them


@dataclass(frozen=True, eq=False)
class Fit:
    """A model that is fitted to what a machine with effects reads in a campaign, without noise."""

    machine: Robot  # without effects, its stiffness true
    campaign: SimulatedCampaign  # without noise
    still: Array  # (N, 6): m and rad; what is read without effects; NaN where nothing is
    basis: Array  # (N, 6, t): derivatives of that by the logarithms of the compliances fitted
    weight: Array  # (6,): one over the noise

    def residual(self, truths: Sequence[Truth]) -> Array:
        """Return what the fit leaves of the gap that some effects make, (N, 6), m and rad."""
        known = ~np.isnan(self.still) & (self.weight > 0)
        gap = true_rows(self.machine, truths, self.campaign) - self.still
        matrix = (self.basis * self.weight[:, None])[known]
        found = np.linalg.lstsq(matrix, (gap * self.weight)[known], rcond=1e-12)[0]
        return np.asarray(gap - self.basis @ found)


def linear_fit(robot: Robot, machine: Robot, campaign: SimulatedCampaign) -> Fit:
    """Return the linear least-squares fit, weighted by the true noise, of the compliances to identify.

    Derivatives are differences of the simulator's own answers without effects, at the true stiffness.
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


def draw_gap(rng: np.random.Generator, kind: Kind) -> float:
    """Return the gap over noise that an effect is to leave."""
    faint = float(rng.random()) < FAINT_SHARE
    low, high = CLEARER.get(kind, FAINT if faint else GAPS)
    return between(rng.random(), low, high)


@dataclass(frozen=True)
class Sized:
    """An effect of a size in [0, 1], and the gap over noise that it leaves on some of the poses."""

    truth: Truth
    size: float
    gap: float


def sized(
    rng: np.random.Generator,
    robot: Robot,
    machine: Robot,
    campaign: SimulatedCampaign,
    truths: Sequence[Truth],
    kind: Kind,
) -> tuple[Sized, ...]:
    """Return the effects, given in any size, in sizes that leave about the gaps that are drawn for them.

    Where an effect as it was drawn leaves far less at any size (a wrist's short link), another of its forms
    or another component is drawn, a few times. `robot`, `machine`: the model, the machine without effects.
    """
    if not truths:
        return ()
    a_pose = len(campaign) / len(np.unique(campaign.pose))
    part = some_poses(campaign, max(SOME, math.ceil(ROWS / a_pose)))
    fit = linear_fit(robot, machine, part)
    found: list[Sized] = []
    for at, first in enumerate(truths):
        wanted, truth, best = draw_gap(rng, kind), first, None
        others = {other.component for other in (*[one.truth for one in found], *truths[at + 1 :])}
        for _ in range(DRAWS):
            if truth.component not in others:
                one = _sized(part, fit, robot, truth, int(rng.integers(2**31)), wanted)
                best = one if best is None or _miss(one.gap, wanted) < _miss(best.gap, wanted) else best
                if best.gap > ENOUGH * wanted:
                    break
            truth = draw_truth(rng, robot, first.effect, 0.5)
        assert best is not None
        found.append(best)
    return tuple(found)


def _miss(gap: float, wanted: float) -> float:
    return float(abs(np.log(max(gap, 1e-12) / wanted)))


def _sized(part: SimulatedCampaign, fit: Fit, robot: Robot, truth: Truth, seed: int, wanted: float) -> Sized:
    def gap_of(size: float) -> float:
        try:
            return whitened_gap(part, fit.residual((resized(truth, robot, size, seed),)))
        except BeamstiffError:  # so large that the machine buckles under it
            return float("inf")

    size, gap = size_for(gap_of, wanted)
    return Sized(resized(truth, robot, size, seed), size, gap)


def some_poses(campaign: SimulatedCampaign, most: int) -> SimulatedCampaign:
    """Return the campaign's rows at some of its poses, evenly over it, its first and last among them."""
    poses = np.unique(campaign.pose)
    if len(poses) <= most:
        return campaign
    chosen = poses[np.linspace(0, len(poses) - 1, most).round().astype(int)]
    return campaign.at(np.isin(campaign.pose, chosen))


def size_for(gap_of: Callable[[float], float], wanted: float) -> tuple[float, float]:
    """Return the size in [0, 1] whose gap is nearest by ratio to the wanted one, and its gap.

    False position on the gap's logarithm between the sizes that bracket it, `USUAL` growth beyond them; where
    the largest size leaves less than the middle one (a drive that sticks), sizes between are tried.

    >>> size, gap = size_for(lambda s: 0.1 * 100.0**s, 1.0)
    >>> round(size, 1), 0.85 < gap < 1.17
    (0.5, True)
    """
    tried: dict[float, float] = {}
    below, above = (0.0, -np.inf), (1.0, np.inf)
    size = 0.5
    for _ in range(MOST):
        size = round(size, DIGITS)
        if size in tried:
            break
        tried[size] = gap_of(size)
        miss = float(np.log(max(tried[size], 1e-12) / wanted))
        if abs(miss) < CLOSE:
            break
        if miss < 0.0 and size == 1.0 and tried[size] < max(tried.values()):
            below, above, size = (0.5, -np.inf), (1.0, np.inf), 0.75
            continue
        if miss < 0.0:
            below = (size, miss)
        else:
            above = (size, miss)
        if np.isfinite(below[1]) and np.isfinite(above[1]):
            share = below[1] / (below[1] - above[1])
            size = below[0] + float(np.clip(share, 0.1, 0.9)) * (above[0] - below[0])
        elif np.isfinite(miss):
            size = float(np.clip(size - miss / USUAL, below[0], above[0]))
        else:
            size = 0.5 * (below[0] + size)
    best = min(tried, key=lambda s: (_miss(tried[s], wanted), s))
    return best, tried[best]
