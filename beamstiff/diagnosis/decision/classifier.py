"""Whether there is no cause, one, two, or something that the library does not hold: three logistic models.

    P(none) = s(c_n . x_n),  P(two | some) = s(c_t . x_t),
    P(unknown | some) = s(log(exp(c_u . x_u) + exp(u + d m / n)))

with s the logistic function, u the log odds of the best law outside the library, n the values less fitted
ones and m = `FEW`: a law that explains few values explains them by its freedom. Evidence takes shapes for
true, no real drive or link has exactly the shape of a library, and what that adds grows with the evidence:
log odds enter as ``sign(x) log(1 + |x|)``, or divided as those between effects are. The coefficients in
`decision.json` are fitted to simulated campaigns, none against the sense of its feature
(`python -m benchmarks.decision_study`); the file says which campaigns, and how many of each kind.
"""

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from scipy.special import expit, logit

from beamstiff.diagnosis.decision.tempering import divisor_of
from beamstiff.diagnosis.held_out.score import HeldOutError
from beamstiff.diagnosis.inference.evidence import logsumexp
from beamstiff.diagnosis.inference.search import NONE, PRIOR, Search

FEWEST = 25  # values of the smallest campaigns that it was fitted to: of fewer the prior says the rest
EXCESS = 0.02  # of the noise's square, below which what is left over it is chance
FEW = 60  # values less fitted ones m, of which what is left to the unknown says nothing

Terms = dict[str, float]
Coefficients = dict[str, Terms]  # of each model, by the names of its features, and ``constant``


@dataclass(frozen=True)
class Features:
    """What the models look at, by name.

    `two`: empty where no second cause was weighed.
    `unknown`, `unknown_of_two`: of the likeliest cause, and of the likeliest pair; empty where there is none.
    `enough`: share of the values that the models need, at most 1.
    """

    none: Terms
    two: Terms
    unknown: Terms
    unknown_of_two: Terms
    enough: float = 1.0


@dataclass(frozen=True)
class Shares:
    """Probabilities that sum to 1."""

    none: float
    unknown: float
    one: float
    two: float


def features_of(
    search: Search,
    freedom: int,
    single: HeldOutError,
    both: HeldOutError | None,
    by_load: tuple[HeldOutError, HeldOutError] | None = None,
) -> Features:
    """Return what a search says.

    `freedom`: values less fitted parameters.
    `single`, `both`: held-out worth of the best cause, and of the best pair.
    `by_load`: the worth of both on held-out loads, where the pair has something to itself in each posture.
    """
    best, nothing = search.named[0], search.log_weight[NONE]
    outside = list(search.unmodelled.values())
    any_law = logsumexp(np.array([*(search.log_weight[key] for key in search.named), *outside]))
    values, enough = float(np.log(max(freedom, FEWEST))), float(np.clip(freedom / FEWEST, 0.0, 1.0))

    def unknown(left: float, log_weight: float) -> Terms:
        divisor = divisor_of(log_weight - nothing)  # shapes are never exact, as between effects
        return {
            "left": min(left, 1.0) * max(values - float(np.log(FEW)), 0.0),
            "unmodelled": (max([nothing, *outside]) - log_weight) / divisor,
            "free": (max([nothing, *search.free.values()]) - log_weight) / divisor,
            "few": FEW / max(freedom, 1),
        }

    none = {"evidence": _compressed(nothing - float(any_law)), "values": values}
    one = unknown(search.residual_fraction[best], search.log_weight[best])
    if both is None or not search.pairs:
        return Features(none, {}, one, {}, enough)
    pair = search.pairs[0]
    worth = [(single, both), *([by_load] if by_load is not None else [])]
    two = {
        "evidence": _compressed(pair.log_weight - search.log_weight[best]),
        "closed": max(_excess(first) - _excess(second) for first, second in worth),
    }
    return Features(none, two, one, unknown(pair.residual_fraction, pair.log_weight), enough)


def shares_of(features: Features, coefficients: Coefficients | None = None) -> Shares:
    """Return how probable it is that there is no cause, one, two, or another than is named."""
    fitted = coefficients or coefficients_of_file()
    none = float(expit(none_log_odds(fitted["none"], features)))
    two = probability(fitted["two"], features.two) if features.two else 0.0
    named = features.unknown_of_two if two > 0.5 else features.unknown
    unknown = (1.0 - none) * float(expit(unknown_log_odds(fitted["unknown"], named)))
    real = 1.0 - none - unknown
    return Shares(none, unknown, real * (1.0 - two), real * two)


@cache
def coefficients_of_file() -> Coefficients:
    """Return the coefficients of the three models."""
    text = files("beamstiff.diagnosis.decision").joinpath("decision.json").read_text(encoding="utf-8")
    return {name: value for name, value in json.loads(text).items() if name in ("none", "two", "unknown")}


def probability(coefficients: Terms, features: Terms) -> float:
    """Return what a model says."""
    return float(expit(coefficients["constant"] + sum(coefficients[key] * x for key, x in features.items())))


def none_log_odds(coefficients: Terms, features: Features) -> float:
    """Return the log odds that there is no cause; of few values what is known beforehand counts with them."""
    level = coefficients["constant"] + coefficients["values"] * features.none["values"]
    level = features.enough * level + (1.0 - features.enough) * float(logit(PRIOR[NONE]))
    return level + coefficients["evidence"] * features.none["evidence"]


def unknown_log_odds(coefficients: Terms, features: Terms) -> float:
    """Return the log odds that what is named is not what is there."""
    near = sum(coefficients[key] * features[key] for key in ("left", "free"))
    law = features["unmodelled"] + coefficients["few"] * features["few"]
    return float(np.logaddexp(coefficients["constant"] + near, law))


def _compressed(log_odds: float) -> float:
    return float(np.sign(log_odds) * np.log1p(abs(log_odds)))


def _excess(error: HeldOutError) -> float:
    """Return the log of what is left beyond the noise on held-out postures."""
    return float(np.log(EXCESS + max(error.misfit**2 - 1.0, 0.0)))
