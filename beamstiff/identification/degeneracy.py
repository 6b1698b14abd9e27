"""What the data cannot distinguish, whatever the noise; and what they distinguish hardly.

The sensitivities of all rows to the compliances are taken at several random stiffness values: what holds
at all of them is the structure's doing and not a chance. A column of zeros is a spring that is never loaded
(or never seen). Parallel columns are springs in series where their ratio is the same at all values, since
then the displacement depends on the sum of the compliances, and springs in parallel where the ratio of the
sensitivities to the stiffness is. Further dependent columns are found from the null space: the group that a
dependence joins is a block of the projector on it.

Near a singular posture the columns of two springs are nearly parallel, no more (joints 4 and 6 of a wrist
that is nearly stretched): nothing is degenerate, and yet either value may be anything while the sum of both
compliances is known. The covariance tells: among compliances that are badly known and correlated, the
combination of least variance (the last principal component, each in its standard deviations).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from beamstiff.identification.problem import Problem, balanced_stiffness
from beamstiff.identification.result import Combination
from beamstiff.identification.series_parallel import INVERSE_UNITS, Joined, Kind, Spring, join
from beamstiff.robot.description import Robot
from beamstiff.robot.stiffness_parameters import parameter_unit
from beamstiff.se3 import Array

POINTS = 3  # stiffness values at which a dependence has to hold
SPREAD = 0.5  # their standard deviation, of the logarithm
UNLOADED = 1e-9  # of the load, or of the motion, of the whole machine
PARALLEL = 1e-9  # sine of the angle between columns, and singular values of unit columns, that count as none
ENTANGLED = 1e-4  # entry of the projector on what does nothing that is more than rounding
SAME = 1e-5  # relative difference of ratios at different values

BADLY = 0.2  # relative standard deviation from which on a value is badly known
TOGETHER = 0.95  # correlation from which on compliances are known together only
BETTER = 4.0  # times, at least, that a sum is better known than the best of its terms


@dataclass(frozen=True)
class Silent:
    """A parameter that these rows do not feel at all."""

    name: str
    reason: str


@dataclass(frozen=True)
class Mixed:
    """Parameters of which fewer combinations act than there are parameters."""

    members: tuple[str, ...]  # (g)
    # (h): those whose value makes no difference: whatever it is, the others make up for it
    held: tuple[str, ...]
    # (g - h): the combinations that act, where they are sums of compliances; else empty
    sums: tuple[Joined, ...] = ()


@dataclass(frozen=True)
class Degeneracy:
    """What cannot be identified one by one from the rows of a problem."""

    silent: tuple[Silent, ...]
    joined: tuple[Joined, ...]  # springs in series or in parallel
    mixed: tuple[Mixed, ...]


@dataclass(frozen=True)
class _Acting:
    """A spring, or several as one, with its stiffness and its column at every point."""

    spring: Spring | Joined
    stiffness: tuple[float, ...]
    columns: tuple[Array, ...]  # by the compliance, whitened (n,)


def find_degeneracy(problem: Problem, seed: int = 0) -> Degeneracy:
    """Return what the rows of a problem cannot distinguish: all springs that they join exactly."""
    model = problem.model
    rng = np.random.default_rng(seed)
    balanced = balanced_stiffness(model)
    points = [balanced * np.exp(SPREAD * rng.standard_normal(balanced.size)) for _ in range(POINTS)]
    jacobians = [problem.jacobian(stiffness)[1] for stiffness in points]
    silent = _silent(problem, points)
    dumb = {item.name for item in silent}
    acting = [
        _Acting(
            Spring(name),
            tuple(float(stiffness[at]) for stiffness in points),
            tuple(
                jacobian[:, at] * stiffness[at] for jacobian, stiffness in zip(jacobians, points, strict=True)
            ),
        )
        for at, name in enumerate(model.parameters)
        if name not in dumb
    ]
    acting, mixed = _merge_parallel_columns(acting)
    joined = tuple(item.spring for item in acting if isinstance(item.spring, Joined))
    mixed += _dependent(acting)
    entangled = {name for group in mixed for name in group.members}
    return Degeneracy(
        silent=silent,
        joined=tuple(spring for spring in joined if not entangled & set(spring.members)),
        mixed=tuple(mixed),
    )


def _silent(problem: Problem, points: Sequence[Array]) -> tuple[Silent, ...]:
    """Return the parameters whose springs carry no load, or whose motion no reading sees."""
    model = problem.model
    size = float(model.lever.max(initial=1.0))
    scale = np.repeat([1.0, size], 3)  # rotations by what they move at the machine's size
    result = []
    for number, name in enumerate(model.parameters):
        loaded, seen, told = 0.0, 0.0, 0.0
        for stiffness in points:
            spring = stiffness[number] * model.springs[number]
            inverse = model.inverse(stiffness)[model.pose]
            force = np.abs((inverse @ model.force[..., None])[..., 0] @ spring / model.lever).max(axis=1)
            moved = np.abs(spring @ inverse @ model.motion * scale / model.lever[:, None]).max(axis=1)
            shown = np.where(problem.used, moved, 0.0).max(axis=1)
            share = force / max(float(np.abs(model.force / model.lever).max()), np.finfo(float).tiny)
            loaded, seen = max(loaded, float(share.max())), max(seen, float(shown.max()))
            told = max(told, float((share * shown).max()))
        if told <= UNLOADED:
            if loaded <= np.sqrt(UNLOADED):
                reason = "is never loaded: its stiffness cannot be identified"
            elif seen <= np.sqrt(UNLOADED):
                reason = "moves nothing that is measured: its stiffness cannot be identified"
            else:
                reason = "is loaded only where its motion is not measured: its stiffness cannot be identified"
            result.append(Silent(name, f"{name} {reason}"))
    return tuple(result)


def _merge_parallel_columns(acting: list[_Acting]) -> tuple[list[_Acting], list[Mixed]]:
    """Join springs whose columns are parallel at all points, by the simplest sum; others are mixed."""
    merged: list[_Acting] = []
    mixed: list[Mixed] = []
    for group in _parallel(acting):
        left = group
        while (pair := _joinable(left)) is not None:
            a, b, both = pair
            left = [both if at == a else item for at, item in enumerate(left) if at != b]
        merged.append(left[0])
        if len(left) > 1:
            names = tuple(name for item in left for name in item.spring.members)
            mixed.append(Mixed(names, names[1:]))
    return merged, mixed


def _parallel(acting: list[_Acting]) -> list[list[_Acting]]:
    """Return groups whose columns are parallel at every point."""
    count = len(acting)
    same = np.ones((count, count), dtype=np.bool_)
    for point in range(POINTS):
        units = (
            np.stack([_unit(item.columns[point]) for item in acting], axis=1) if count else np.zeros((1, 0))
        )
        cosine = units.T @ units
        for a in range(count):
            away = np.linalg.norm(units - units[:, [a]] * cosine[a], axis=0)
            same[a] &= away < PARALLEL
    groups = connected_components(csr_array((same | same.T).astype(np.int8)), directed=False)[1]
    return [[acting[at] for at in np.flatnonzero(groups == group)] for group in np.unique(groups)]


def _unit(column: Array) -> Array:
    return column / max(float(np.linalg.norm(column)), np.finfo(float).tiny)


def _joinable(group: list[_Acting]) -> tuple[int, int, _Acting] | None:
    """Return the first two that are in series or in parallel, and both as one."""
    for kind in ("series", "parallel"):
        for a, first in enumerate(group):
            for b in range(a + 1, len(group)):
                ratio = _ratio(first, group[b], kind)
                if ratio is not None:
                    return a, b, _both(first, group[b], kind, ratio)
    return None


def _ratio(a: _Acting, b: _Acting, kind: Kind) -> float | None:
    """Return the sensitivity to b over that to a, if it is the same at all points."""
    ratios = []
    for point in range(POINTS):
        by_a, by_b = a.columns[point], b.columns[point]
        ratio = float(by_a @ by_b / (by_a @ by_a))
        if kind == "parallel":  # by the stiffness: d/dk = -(1/k^2) d/dc
            ratio *= (a.stiffness[point] / b.stiffness[point]) ** 2
        ratios.append(ratio)
    if max(ratios) - min(ratios) > SAME * abs(ratios[0]) or ratios[0] <= 0:
        return None
    mean = float(np.mean(ratios))
    return 1.0 if abs(mean - 1) < SAME else mean


def _both(a: _Acting, b: _Acting, kind: Kind, ratio: float) -> _Acting:
    spring = join(kind, a.spring, b.spring, ratio)
    if kind == "series":
        stiffness = tuple(1 / (1 / ka + ratio / kb) for ka, kb in zip(a.stiffness, b.stiffness, strict=True))
        return _Acting(spring, stiffness, a.columns)
    stiffness = tuple(ka + ratio * kb for ka, kb in zip(a.stiffness, b.stiffness, strict=True))
    # d/dc of both: -k^2 d/dk, and d/dk is that of a
    columns = tuple(
        column * (k / ka) ** 2 for column, k, ka in zip(a.columns, stiffness, a.stiffness, strict=True)
    )
    return _Acting(spring, stiffness, columns)


def _dependent(acting: list[_Acting]) -> list[Mixed]:
    """Return groups of springs whose columns depend on one another, three or more together."""
    if not acting:
        return []
    nulls, norms = [], []
    for point in range(POINTS):
        norms.append(np.array([np.linalg.norm(item.columns[point]) for item in acting]))
        units = np.stack([item.columns[point] for item in acting], axis=1) / norms[-1]
        # all right singular vectors, and of the left ones no more than there are columns
        lacking = np.zeros((max(len(acting) - len(units), 0), len(acting)))
        _, singular, right = np.linalg.svd(np.concatenate([units, lacking]), full_matrices=False)
        nulls.append(right[singular < PARALLEL])
    nullity = min(len(null) for null in nulls)
    if not nullity:
        return []
    least = next(null for null in nulls if len(null) == nullity)
    projector = least.T @ least
    groups = connected_components(csr_array((np.abs(projector) > ENTANGLED).astype(np.int8)), directed=False)[
        1
    ]
    result = []
    for group in np.unique(groups):
        at = np.flatnonzero(groups == group)
        missing = round(float(np.trace(projector[np.ix_(at, at)])))
        if missing:
            bases = [null[:, at] / norm[at] for null, norm in zip(nulls, norms, strict=True)]
            result.append(_mixed([acting[number] for number in at], missing, bases))
    return result


def _mixed(group: list[_Acting], missing: int, bases: list[Array]) -> Mixed:
    """Return a group of which `missing` combinations do nothing; `bases` spans them, in compliances."""
    size = np.linalg.norm(bases[0], axis=0)
    pivots = np.sort(qr(bases[0] / size, mode="r", pivoting=True)[1][:missing])
    # with the held ones' own part the identity: what the others make up for, per unit of compliance held
    shares = []
    for base in bases:
        _, singular, right = np.linalg.svd(base / size, full_matrices=False)
        kept = right[:missing] * size
        shares.append(np.linalg.solve(kept[:, pivots], kept) if singular.size >= missing else kept * np.nan)
    spread = max(float(np.abs((share - shares[0]) / np.abs(shares[0]).max(axis=0)).max()) for share in shares)
    names = tuple(name for item in group for name in item.spring.members)
    held = tuple(name for pivot in pivots for name in group[pivot].spring.members)
    if not spread < SAME * 10 or any(isinstance(group[pivot].spring, Joined) for pivot in pivots):
        return Mixed(names, held)
    sums = []
    for number, item in enumerate(group):
        if number not in pivots:
            share = -shares[0][:, number]
            felt = [at for at in range(missing) if abs(share[at]) > ENTANGLED * np.abs(share).max()]
            parts = (item.spring, *(group[pivots[at]].spring for at in felt))
            sums.append(Joined("sum", parts, (1.0, *(float(share[at]) for at in felt))))
    return Mixed(names, held, tuple(sums))


def find_ill_determined(
    robot: Robot, names: Sequence[str], stiffness: Array, covariance: Array
) -> tuple[Combination, ...]:
    """Return sums of compliances that are well known though none of their terms is.

    `stiffness` (m,): values at the optimum. `covariance` (m, m): of their logarithms; infinite
    variance of what is not identifiable at all, which is left aside.
    """
    std = np.sqrt(np.diagonal(covariance))
    bad = np.flatnonzero(np.isfinite(std) & (std > BADLY))
    if bad.size < 2:
        return ()
    # of the compliances 1/k, in their standard deviations: that of log k with the other sign, twice
    correlation = covariance[np.ix_(bad, bad)] / np.outer(std[bad], std[bad])
    groups = connected_components(csr_array(np.abs(correlation) > TOGETHER), directed=False)[1]
    result = []
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        if members.size < 2:
            continue
        variance, direction = np.linalg.eigh(correlation[np.ix_(members, members)])
        at = bad[members]
        spread = std[at] / stiffness[at]  # of the compliances
        first = int(np.argmax(np.abs(direction[:, 0] / spread)))
        coefficients = direction[:, 0] / spread
        lead = coefficients[first]
        coefficients = coefficients / lead
        error = float(np.sqrt(max(variance[0], 0.0)) / abs(lead))
        terms = tuple(Spring(names[k]) for k in at)
        total = Joined("sum", terms, tuple(_plain(c) for c in coefficients.tolist()))
        value = float(coefficients @ (1.0 / stiffness[at]))
        if error * BETTER < abs(value) * std[at].min() and value > 0:
            unit = INVERSE_UNITS[parameter_unit(robot, names[at[first]])]
            result.append(Combination(total.members, total.text(), value, error, "ill-determined", unit))
    return tuple(result)


def _plain(coefficient: float) -> float:
    """Return a coefficient to the three digits that it is worth."""
    return float(f"{coefficient:.3g}")
