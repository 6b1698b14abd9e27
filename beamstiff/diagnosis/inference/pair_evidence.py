"""Two causes weighed together.

The search finds a second cause beside the best shape of a first. Which two causes it is, is asked once more
of both at once: the shapes of each are chosen beside the other's, and the evidence of both is that of one
hypothesis with the columns of both. What their places may do beside their shapes belongs to the unknown:
a shape that is not quite right errs at its own place first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from beamstiff.diagnosis.held_out.score import Weighted
from beamstiff.diagnosis.inference.component_subspaces import ComponentSubspace, modes_of
from beamstiff.diagnosis.inference.evidence import COARSE, NoisePrior, evidence, log_weights
from beamstiff.diagnosis.inference.library import Hypothesis
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array

TURNS = 3  # in which each is chosen beside the other
SHAPES = 4  # of each cause, the likeliest beside the other, that are combined
COMMON = 2.0  # factor within which both sizes are known once each has been found beside the other
KEPT = 0.02  # weight from which a shape of the first is kept


@dataclass(frozen=True)
class Pair:
    """Two candidates together.

    `log_weight`: log of the priors of their shapes times the evidence of both; of a search, the log weight of
        the likeliest single cause and the log odds of the pair against it.
    `residual_fraction`: share of the gap's size that both leave to the unknown.
    `shapes`: of the first, and of the second beside it.
    """

    first: str
    second: str
    log_weight: float
    residual_fraction: float
    shapes: tuple[list[Weighted], list[Weighted]]


def together(
    white: Whitened,
    first: Sequence[Hypothesis],
    second: Sequence[Hypothesis],
    start: Hypothesis,
    scales: NoisePrior,
    laws: Sequence[ComponentSubspace],
) -> Pair:
    """Return what two causes are worth together.

    `first`, `second`: the shapes of each.
    `start`: the shape of the first that is the best alone.
    """
    nuisance = modes_of(laws, {*first[0].places, *second[0].places}, white.gap.size)
    best = start
    for _ in range(TURNS):
        of_second = evidence(white.with_fitted(best.columns, nuisance), second, scales, COARSE)
        other = second[int(np.argmax(log_weights(second, of_second)))]
        of_first = evidence(white.with_fitted(other.columns, nuisance), first, scales, COARSE)
        before, best = best, first[int(np.argmax(log_weights(first, of_first)))]
        if best.shape.name == before.shape.name:
            break
    ways = [
        (a, b)
        for a in np.argsort(-log_weights(first, of_first))[:SHAPES].tolist()
        for b in np.argsort(-log_weights(second, of_second))[:SHAPES].tolist()
    ]
    sizes = of_first.magnitude, of_second.magnitude
    both = [_joined(first[a], second[b], sizes[0][a], sizes[1][b]) for a, b in ways]
    found = evidence(white.with_fitted(first[0].columns[:, :0], nuisance), both, scales)
    weights = log_weights(both, found)
    total = float(logsumexp(weights))
    share = np.exp(weights - total)
    top = int(np.argmax(weights))
    of_shape: dict[int, float] = {}
    for (a, _), p in zip(ways, share.tolist(), strict=True):
        of_shape[a] = of_shape.get(a, 0.0) + p
    kept = {a: p for a, p in of_shape.items() if p > KEPT}
    a_sum, b = sum(kept.values()), ways[top][1]
    shapes = (
        [Weighted(first[a], p / a_sum, float(sizes[0][a])) for a, p in kept.items()],
        [Weighted(second[b], 1.0, float(sizes[1][b]))],
    )
    return Pair(first[0].key, second[0].key, total, float(found.residual_fraction[top]), shapes)


def alone(
    white: Whitened, shapes: Sequence[Hypothesis], scales: NoisePrior, laws: Sequence[ComponentSubspace]
) -> float:
    """Return the log evidence of one cause whose place may do more than its shapes, as in `together`."""
    nuisance = modes_of(laws, set(shapes[0].places), white.gap.size)
    found = evidence(white.with_fitted(shapes[0].columns[:, :0], nuisance), shapes, scales)
    return float(logsumexp(log_weights(shapes, found)))


def _joined(first: Hypothesis, second: Hypothesis, size: float, other: float) -> Hypothesis:
    columns: Array = np.concatenate([size * first.columns, other * second.columns], axis=1)
    parameters = (*first.shape.parameters, *second.shape.parameters)
    return replace(
        first,
        shape=replace(first.shape, prior_factor=COMMON, parameters=parameters),
        prior=first.prior * second.prior,
        columns=columns,
        places=(*first.places, *second.places),
    )
