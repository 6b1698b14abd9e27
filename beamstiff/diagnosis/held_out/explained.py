"""What each cause explains of the gap, at the places where it sits."""

from collections.abc import Iterable, Sequence

from beamstiff.diagnosis.candidate import Candidate
from beamstiff.diagnosis.decision.attribution import Explanation
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.held_out.score import Fitted
from beamstiff.diagnosis.residual.baseline import Baseline


def explanations(
    baseline: Baseline, candidates: Iterable[Candidate], verdict: Candidate, pair: Sequence[Fitted]
) -> list[Explanation]:
    """Return what each candidate that was tried on held-out postures explains, with its probability.

    `baseline`: the one that the effects are linear about.
    `pair`: the fit of the verdict and a second cause together, empty where one alone is named.
    """
    found = []
    for one in candidates:
        if one.shrink is not None:
            parts = _parts(baseline, pair[0]) if pair and one.key == verdict.key else {one.key: 1.0}
            share = {place: one.shrink.explained_fraction * part for place, part in _by_place(parts).items()}
            found.append(Explanation(one.probability, share))
    return found


def _by_place(parts: dict[str, float]) -> dict[str, float]:
    """Return the shares of causes as those of their places, each of a cause's as much as the others."""
    result: dict[str, float] = {}
    for key, part in parts.items():
        effect, _, component = key.partition(":")
        places = EFFECTS[effect].places(None if component == "null" else component)
        for place in places:
            result[place] = result.get(place, 0.0) + part / len(places)
    return result


def _parts(baseline: Baseline, fit: Fitted) -> dict[str, float]:
    """Return what each effect of a fit moves, squared and over the noise, of what all of them move."""
    moved, start = {}, 0
    for one in fit.shapes:
        sizes = one.hypothesis.sizes
        shift = one.hypothesis.shape.columns @ (fit.theta[start : start + sizes.size] * sizes)
        moved[one.hypothesis.key] = float(((shift / baseline.sigma)[baseline.used] ** 2).sum())
        start += sizes.size
    whole = max(sum(moved.values()), 1e-300)
    return {key: square / whole for key, square in moved.items()}
