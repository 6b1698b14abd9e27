"""Causes that the user excluded: a gap that they would explain is not noise."""

from dataclasses import replace

from beamstiff.diagnosis.candidate import Candidate
from beamstiff.diagnosis.inference.search import NONE, UNKNOWN
from beamstiff.diagnosis.result import Diagnosis

NOISE_LEVEL = ("noise_position", "noise_rotation", "scale")  # features: the noise as the rows show it


def not_noise(found: Diagnosis, whole: Diagnosis) -> Diagnosis:
    """Return a diagnosis with the noise floor, and the probability that there is no cause, of another one.

    `found`: its verdict is `none`. `whole`: of the same rows, with no cause excluded. What excluded causes
    explain counts as noise in `found`; it is a gap of unknown cause. The exam withholds causes from
    `beamstiff.diagnosis.diagnose`, which must not know them: so this is a step of its own behind it.
    """
    if whole.verdict.key == NONE:
        return found
    odds = {one.key: one.probability for one in found.candidates}
    none = min(odds[NONE], sum(one.probability for one in whole.candidates if one.key == NONE))
    unknown = odds.get(UNKNOWN, 0.0) + odds[NONE] - none
    others = [one for one in found.candidates if one.key not in (NONE, UNKNOWN)]
    candidates = [Candidate("none", None, none), Candidate("unknown", None, unknown), *others]
    candidates.sort(key=lambda one: -one.probability)
    said: tuple[str, ...] = ()
    if whole.verdict.key != UNKNOWN:
        cause = whole.verdict.key.removesuffix(":null")
        said = (f"with no cause excluded, the verdict is {cause} ({100 * whole.verdict.probability:.0f} %)",)
    return replace(
        found,
        candidates=tuple(candidates),
        verdict=next(one for one in candidates if one.key in (NONE, UNKNOWN)),
        noise=whole.noise,
        features={**found.features, **{k: v for k, v in whole.features.items() if k in NOISE_LEVEL}},
        notes=(*said, *found.notes),
    )
