"""What the poses can distinguish: the minimal identifiable set, and the rest as linear combinations of it.

Columns are weighed by the noise and scaled by realistic deviations, so that a column's length, and a singular
value, is a ratio of signal to noise: below one, the readings say less of a direction than the tolerances of
manufacture do. Parameters are taken one after another by QR with column pivoting, the more telling ranks
first; what a parameter would add to those already taken decides (Khalil and Dombre 2002, chapter 11). The
observability indices O1 to O5 of a plan stand in `planning.observability`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq, qr

from beamstiff.calibration.parameters import SETUP, Parameter
from beamstiff.se3 import Array

NOTICED = 1.0  # signal over noise of a realistic deviation, below which a parameter is held
EXACT = 1e-9  # of the longest unit column: what is left below is rounding
TIE = 1e-7  # of a column, by which it has to be longer to be taken before one that comes first
MENTIONED = 1e-3  # of a column, from which another's part in it is named


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What can be identified; t parameters."""

    names: tuple[str, ...]
    identified: tuple[str, ...]  # the minimal set, in the order of `names`
    order: tuple[str, ...]  # all parameters in the order in which they were taken, the dependent ones last
    # (t,): in that order, what each adds to those before it: signal over noise of a realistic deviation
    adds: Array
    singular_values: Array  # (t,): of the weighed and scaled Jacobian
    exact_rank: int  # number of parameters that could be distinguished without noise
    # by parameter that is held: an error of it looks like these many of the identified ones, SI units
    dependent: Mapping[str, Mapping[str, float]]
    silent: tuple[str, ...]  # parameters that move no measured point by themselves
    condition: float  # ratio of the largest and the smallest singular value over the identified ones


def identifiability(
    jacobian: Array, parameters: tuple[Parameter, ...], noticed: float = NOTICED
) -> Identifiability:
    """Return which parameters the rows of a Jacobian distinguish.

    `jacobian` (n, t): weighed by the noise, per SI unit of the parameters. `parameters` (t): their sizes
    scale the columns, their ranks say which are kept. `noticed`: signal over noise of a realistic deviation
    from which a parameter is identified; 0 for all that could be distinguished without noise.
    """
    size = np.array([item.size for item in parameters])
    scaled = jacobian * size
    length = np.linalg.norm(scaled, axis=0)
    felt = length > EXACT * length.max(initial=0.0)
    own = np.linalg.svd(scaled[:, felt] / length[felt], compute_uv=False)
    left = scaled.copy()
    taken: list[int] = []
    rest: list[int] = []
    adds = np.zeros(len(parameters))
    for rank in sorted({item.rank for item in parameters}):
        group = np.array([at for at, item in enumerate(parameters) if item.rank == rank])
        # of two that move the points alike the first is taken, and not the one that rounding makes longer
        first = 1.0 - TIE * np.arange(group.size)
        _, upper, pivots = qr(left[:, group] * first, mode="economic", pivoting=True)
        # fewer rows than columns: the columns behind add nothing
        gains = np.zeros(group.size)
        diagonal = np.abs(np.diagonal(upper))
        gains[: diagonal.size] = diagonal / first[pivots[: diagonal.size]]
        ordered = group[pivots]
        adds[ordered] = gains
        kept = felt[ordered] & (gains > noticed) & (gains > EXACT * length[ordered])
        taken += ordered[kept].tolist()
        rest += ordered[~kept].tolist()
        if taken:  # from the columns themselves, twice: what is left is right to rounding
            base = np.linalg.qr(scaled[:, taken])[0]
            left = scaled - base @ (base.T @ scaled)
            left -= base @ (base.T @ left)
    for at in _undetermined(scaled, parameters, taken, noticed):
        taken.remove(at)
        rest.insert(0, at)
    names = [item.name for item in parameters]
    silent = [names[at] for at in rest if not felt[at]]
    dependent: dict[str, dict[str, float]] = {}
    if taken:
        factors = lstsq(scaled[:, taken], scaled[:, rest])[0] if rest else np.zeros((len(taken), 0))
        for column, at in enumerate(rest):
            if names[at] not in silent:
                dependent[names[at]] = {
                    names[one]: float(factors[row, column] * size[one] / size[at])
                    for row, one in sorted(enumerate(taken), key=lambda pair: pair[1])
                    if abs(factors[row, column]) * length[one] > MENTIONED * length[at]
                }
    values = np.linalg.svd(scaled[:, taken], compute_uv=False) if taken else np.ones(1)
    return Identifiability(
        names=tuple(names),
        identified=tuple(names[at] for at in sorted(taken)),
        order=tuple(names[at] for at in (*taken, *rest)),
        adds=adds[[*taken, *rest]],
        singular_values=np.linalg.svd(scaled, compute_uv=False),
        exact_rank=int((own > EXACT * own.max(initial=0.0)).sum()),
        dependent=dependent,
        silent=tuple(silent),
        condition=float(values.max() / values.min()),
    )


def _undetermined(
    scaled: Array, parameters: tuple[Parameter, ...], taken: list[int], noticed: float
) -> list[int]:
    """Return which of the parameters taken, of what was set up, those taken after them leave unknown.

    Setting-up comes first, before what it may not be told from: how far from a tool that stays level its
    reflector hangs shows by errors of angles alone, and by these it is a fraction of a metre either way.
    """
    out: list[int] = []
    while True:
        left = [at for at in taken if at not in out]
        setup = [at for at in left if parameters[at].rank == SETUP]
        if not setup:
            return out
        shows = 1.0 / np.linalg.norm(np.linalg.pinv(scaled[:, left]), axis=1)
        worst = min(reversed(setup), key=lambda at: round(float(np.log(shows[left.index(at)])), 3))
        if shows[left.index(worst)] >= noticed:
            return out
        out.append(worst)
