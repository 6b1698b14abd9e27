"""A diagnosis in words: headline, summary, what the calibration changed, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.decomposition.applied import of_the_campaign, written_share
from beamstiff.diagnosis.decomposition.causes import HALF
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.inference.search import UNKNOWN
from beamstiff.diagnosis.notes import FEW_VALUES, MASSLESS, OFF, in_words
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import counted
from beamstiff.report import diagnosis_words as words
from beamstiff.report.calibrated_text import (
    as_described,
    calibrated_away,
    calibrated_worse,
    described_rigid,
    reflectors_moved,
)
from beamstiff.report.next_action import NOTHING, TOO_FEW, action, overstated, scatters
from beamstiff.report.verdict import (
    Verdict,
    data_of,
    level_of,
    rounded,
)

if TYPE_CHECKING:
    from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition

LIKELY = 0.6  # probability below which a verdict is no more than the likeliest
NAMED = 3  # explanations that are named where nothing is decided
UNDECIDED = "Undecided"
BEST = "the best fit by effects of the library leaves"
SCATTER = "noise larger than stated, or something loose"


def verdict(result: Diagnosis) -> Verdict:
    """Return the headline with the gap and its cause, the data, and the one thing to do next."""
    head, ratio = headline(result), result.rms / result.noise if result.noise else np.inf
    found, close, level = words.several(result), result.verdict.shrink, level_of(ratio)
    before = _before(result)
    gap = f"Gap of {rounded(1e3 * result.rms)} mm{' after calibration' * bool(before)}"
    each, doubt, left = "", "", np.inf
    worse = calibrated_worse(result)
    if head == TOO_FEW:
        said, level = head, "plain"
    elif head == NOTHING.capitalize():
        noise = f"gap {rounded(1e3 * result.rms)} mm, noise floor {rounded(1e3 * result.noise)} mm"
        said, level = f"Model and machine agree: {noise}", "agrees"
        if times := overstated(result):
            said = (
                f"Nothing can show: the stated noise is {times:.2g} times what the readings scatter ({noise})"
            )
            level = "doubtful"
        elif (times := _factor(result)) > OFF:
            said = f"No effect shows, but the readings scatter {times:.2g} times the stated noise ({noise})"
            level = "doubtful"
        elif wrong := calibrated_away(result):
            said, level = f"{wrong}; calibrated, model and machine agree ({noise})", "doubtful"
    else:
        level = "doubtful" if level == "agrees" else level  # what is systematic is no agreement
        if found:
            by, left = _first_cause(found), found[-1].rms_after
            if len(found) > 1:
                each = f"Causes, with the share that each closes: {_each(found)}."
            said = f"{gap}, {_explained(result, words.closed(found), by)}{_outside(result)}"
        elif head == UNDECIDED:
            said = f"{gap}, cause undecided"
        elif result.verdict.effect == "unknown":
            best = _perhaps(result) or (SCATTER if scatters(result) else "")
            said = f"{gap}, cause unknown{f': perhaps {best}' if best else ''}"
            if law := result.law:
                said = f"{gap}, {'cause outside the library: ' * law.nameless}{_looks(law)}"
        elif head.startswith("Cause") and close is not None and close.shrink >= 0.01:
            left = close.after
            share = "" if words.one_posture(result) else words.percent(close.shrink)
            alike = [key for key in result.indistinguishable if key != UNKNOWN]
            said = f"{gap}, {_explained(result, share, _or_alike(words.causes(result), alike))}"
        else:
            alike = [key for key in result.indistinguishable if key != UNKNOWN]
            said = _or_alike(f"{gap}, {head[0].lower()}{head[1:]}", alike)
        doubt = " ".join(_doubt(*one) for one in words.unrealistic(result)[:NAMED])
        doubt += " Another effect may look like it." if doubt else ""
        times = left / result.noise if result.noise and np.isfinite(left) else 0.0
        if level_of(times) == "differs" and not _outside(result):
            rest = (
                f"{rounded(1e3 * left)} mm are left, {times:.2g} times the noise floor: something else is "
                "missing in the model, and no effect of the library explains it."
            )
            doubt = f"{doubt} {rest}".strip()
        if worse:
            doubt = f"{doubt} Do not write this robot: {worse}.".strip()
        if MASSLESS in result.notes:
            doubt = f"{doubt} {MASSLESS[0].upper()}{MASSLESS[1:]}.".strip()
    data = f"{data_of(result.baseline.rows)}{_warmth(result)}{before}"
    explained = result.noise > 0.0 and level_of(left / result.noise) == "agrees"
    return Verdict(said, level, data, action(result, head), each, doubt, explained)


def _before(result: Diagnosis) -> str:
    """Return, in words, the error before the calibration; empty where that did not lower it."""
    changed = result.recalibration
    if changed is None or as_described(result)[1] <= result.rms:
        return ""
    fitted = "geometry" if changed.stiff is None else "geometry and drive stiffness"
    rigid = ", with rigid drives," if described_rigid(result) else ""
    placed = " and reflectors" if reflectors_moved(result) else ""
    before = rounded(1e3 * as_described(result)[1])
    return (
        f". The robot file{rigid} is {before} mm off (measuring frame{placed} fitted); the gap is what "
        f"calibration of {fitted} leaves"
    )


def _warmth(result: Diagnosis) -> str:
    """Return, in words, that nothing follows the measured temperature; empty where something does."""
    warmth, found = result.baseline.rows.temperature, result.decomposition
    undecided = () if found is None else found.unclear
    keys = [one.key for one in words.told(result)] + [one.key for one in undecided]
    if any("thermal-drift" in key for key in keys) or not (
        np.isfinite(warmth).all() and np.ptp(warmth) > 0.0
    ):
        return ""
    return f"; nothing follows the temperature, {warmth.min():.3g} to {warmth.max():.3g} degC"


def _each(found: Sequence[Cause]) -> str:
    """Return, in words, several causes with their look-alikes, and what each closes."""
    return ", ".join(
        f"{_or_alike(in_words([one.key]), one.indistinguishable, 1)} {words.percent(one.closes)}"
        for one in found
    )


def _first_cause(found: Sequence[Cause]) -> str:
    """Return, in words, the first of the causes of a gap, how many others there are, and whether it is sure.

    Of a single cause its look-alikes are named beside it, of several only where the first is undecided: all
    stand in the list below the headline.
    """
    first, others = found[0], len(found) - 1
    name = in_words([first.key])
    if first.probability < LIKELY:
        name = f"{name}, probability {words.chance(first.probability)}"
        alike = len(first.indistinguishable)
        name = (
            _or_alike(name, first.indistinguishable)
            if alike <= NAMED
            else f"{name} (or one of {alike} others below)"
        )
        which = f"{counted(len(found), 'cause')}, the largest" if others else "a cause that is"
        return f"{which} undecided: {name}"
    if not others:
        return _or_alike(name, first.indistinguishable)
    return f"{name} and {counted(others, 'other cause')}"


def _explained(result: Diagnosis, share: str, by: str) -> str:
    """Return, in words, what explains the gap; a doubt about its share is none about the cause."""
    if words.hardly_checked(result):
        return f"explained by {by}; the share, {share}, is uncertain"
    return f"{share} explained by {by}".strip()


def _outside(result: Diagnosis) -> str:
    """Return, in words, that a law outside the library explains more than any cause; mostly empty."""
    if (law := result.law) is None:
        return ""
    return f"; {_looks(law)}{', outside the library' * law.nameless}"


def _looks(law: Cause) -> str:
    how = "look as if" if law.nameless else "explained by the measurement:"
    return f"{words.percent(law.closes)} {how} {law.looks_like}"


def _shortly(names: Sequence[str], most: int = NAMED) -> str:
    """Return the first names, and how many there are beside them: one more is named as well."""
    most += len(names) == most + 1
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest


def _or_alike(name: str, alike: Sequence[str], most: int = NAMED) -> str:
    """Return a cause in words with what these data cannot distinguish from it."""
    if not alike:
        return name
    names = ["an unknown cause" if one.partition(":")[0] == "unknown" else in_words([one]) for one in alike]
    return f"{name} (or {_shortly(names, most)})"


def _doubt(cause: Candidate, size: Estimate) -> str:
    """Return, in words, that a size is unrealistic."""
    negative = size.positive and size.value < 0
    is_it = "negative" if negative else f"{words.oversized(size):.2g} times the largest realistic size"
    return f"Doubt {words.named(cause)}: its {size.name} is {is_it}."


def remainder_text(found: Decomposition) -> str:
    """Return, in words, what the causes leave of a gap, and what that follows."""
    rest = found.remainder
    of_what = "" if found.causes or found.unmodelled else " (no cause is named)"
    said = (
        f"Remainder{of_what}: {1e3 * rest.rms:.3f} mm RMS in the rows as fitted, corrected for the number of "
        "fitted values."
    )
    if rest.follows:
        said += f" It follows the {' and the '.join(name for name, _ in rest.follows[:2])}."
    if found.unclear:
        share, names = words.closed(found.unclear), in_words([one.key for one in found.unclear])
        said += f"\nToo small or too uncertain to be named as causes: {names} ({share} of the gap)."
        if found.causes:
            share, past = words.percent(written_share(found)), of_the_campaign(found)
            left = f"{1e3 * found.unclear[-1].rms_after:.3f} mm"
            alone = f"what is of this campaign alone ({in_words([one.key for one in past])})"
            said += (
                f" --apply leaves out {alone}; what it writes closes {share} of the rest of the gap."
                if past
                else f" --apply writes these too; {left} are then left: {share} of the gap closes."
            )
    if found.unmodelled:
        each = [
            f"{words.law_in_words(one)} ({words.percent(one.closes)} of the gap)" for one in found.unmodelled
        ]
        said += f"\nOf it, outside the library, the readings look as if {', '.join(each)}."
    return said


def summary(result: Diagnosis) -> str:
    """Return the verdict in plain words."""
    rms, noise = 1e3 * result.rms, 1e3 * result.noise
    gap = f"{rms:.3f} mm RMS between measured and predicted position"
    first = f"Gap {words.tested(result)}: {gap}; noise floor {noise:.3f} mm{_scaled(result)}"
    if not words.one_posture(result) and result.decomposition is None:
        first += f"; {BEST} {1e3 * result.ceiling:.3f} mm"
    first += "."
    verdict, head = result.verdict, headline(result)
    if found := words.several(result):
        effects = dict.fromkeys(one.forms[0].effect for one in found)
        meaning = "\n".join(f"{effect}: {EFFECTS[effect].meaning}" for effect in effects)
        floor = f"\nNoise floor {noise:.3f} mm{said}." if (said := _scaled(result)) else ""
        return f"{meaning}{floor}\n{_weak(result).strip()}".strip()
    certain = words.sure(result)
    if head == UNDECIDED:
        first_ones = ", ".join(
            f"{NOTHING if one.effect == 'none' else words.named(one)} ({words.chance(one.probability)})"
            for one in result.candidates[:NAMED]
        )
        structure = " The gap is systematic, not noise." if verdict.effect == "unknown" else ""
        others = [key for key in result.indistinguishable if key != UNKNOWN]
        alike = (
            f"\nIndistinguishable from {words.named(verdict)} with these data: {in_words(others)}."
            if others and verdict.effect != "unknown"
            else ""
        )
        return f"{first}\n{head}: {first_ones}.{structure}{alike}"
    if head == TOO_FEW:
        return (
            f"{first}\n{head}: they show nothing beyond noise, but so few rows could hardly show an effect."
        )
    if verdict.effect == "none":
        far = " The rows scatter far more than the stated noise." if _factor(result) > OFF else ""
        return f"{first}\n{head} (probability {certain}).{far}"
    if verdict.effect == "unknown":
        gap = "the gap is systematic"
        if result.decomposition is not None and not result.baseline.claimed:
            gap = "the gap exceeds a laser tracker's noise (state the instrument's own as sigma_position)"
        text = f"{first}\nUnknown (probability {certain}): {gap}, and "
        if law := result.law:
            chance = words.chance(law.probability)
            text = f"{first}\nThe gap is systematic, and no effect of the library fits it. Most of it looks "
            text += f"as if {law.looks_like} (probability {chance})."
        elif scatters(result):
            text = (
                f"{first}\nUnknown (probability {certain}): what is left scatters and follows no joint, "
                "load, direction of approach or time. The stated noise may be too small, or something loose."
            )
        elif best := _perhaps(result):
            text += f"no cause is sure. Best so far: {best} of it; the name may be wrong."
        else:
            text += (
                "no effect of the library explains it reliably. It is outside the library, or several "
                "effects act together that these rows cannot separate."
            )
        if result.indistinguishable:
            text += f"\nStill possible: {in_words(result.indistinguishable)}."
        return text
    also = words.second(result)
    meaning = f" {EFFECTS[verdict.effect].meaning}"
    if also is not None and also.effect != verdict.effect:
        meaning = f"\n{verdict.effect}:{meaning}\n{also.effect}: {EFFECTS[also.effect].meaning}"
    others = [key for key in result.indistinguishable if key != UNKNOWN]
    text = f"{first}\n{head} ({_probable(result, others if also is None else ())}).{meaning}"
    if verdict.shrink is not None and words.one_posture(result):
        text += "\nThe reduction cannot be tested: it needs held-out postures, and all rows are of one."
    elif verdict.shrink is not None:
        share, ends = words.percent(verdict.shrink.shrink), words.percents(verdict.shrink.interval)
        interval = "" if ends == share else f" (90 % interval over the postures: {ends})"
        text += (
            f"\nWith {'it' if also is None else 'both'}, {1e3 * verdict.shrink.after:.3f} mm are left on "
            f"held-out postures: {share} of the gap above noise is closed{interval}. This holds for postures "
            f"and load directions as measured.{_weak(result)}"
        )
    if others and also is None:
        text += f"\nLook-alikes, which these data do not distinguish from it: {in_words(others)}."
    elif others:
        text += f"\nPossible in place of one of the two: {in_words(others)}."
    if UNKNOWN in result.indistinguishable:
        open_to = sum(one.probability for one in result.candidates if one.key == UNKNOWN)
        text += f"\nA cause outside the library remains possible ({words.chance(open_to)})."
    if result.also is not None and also is None:
        text += f"\nAlso: {words.named(result.also)} (probability {words.chance(result.also.probability)})."
    if result.outliers:
        text += f"\nOutliers, excluded from the fit: {', '.join(_by_line(result.outliers))}."
    return text


def _probable(result: Diagnosis, others: Sequence[str]) -> str:
    """Return, in words, how probable a named cause is, and how probable it or one of its look-alikes."""
    own = words.sure(result)
    if not others:
        return f"probability {own}"
    found = result.decomposition
    if found is not None and found.verdict is not None:
        together = words.chance(found.verdict.present)
    else:
        keys = {result.verdict.key, *others}
        together = words.chance(
            min(sum(one.probability for one in result.candidates if one.key in keys), 1.0)
        )
    either = f"it or a look-alike: {together}"
    return either if together == own else f"probability {own}; {either}"


def _perhaps(result: Diagnosis) -> str:
    """Return, in words, the undecided causes that close at least half of an unknown gap; empty without."""
    unclear = () if result.decomposition is None else result.decomposition.unclear
    if sum(one.closes for one in unclear) < HALF:
        return ""
    each = [_or_alike(in_words([one.key]), one.indistinguishable) for one in unclear]
    return f"{_shortly(each)}, {'which close' if len(each) > 1 else 'which closes'} {words.closed(unclear)}"


def _weak(result: Diagnosis) -> str:
    """Return, in words, that the share is hardly checked; empty where it is well."""
    if not (why := words.hardly_checked(result)):
        return ""
    then = "Measure others, and check the written robot on them (beamstiff verify)."
    return f" This share is uncertain: {why}. {then}"


def headline(result: Diagnosis) -> str:
    """Return the verdict in a few words: as sure as its probability and its rows allow."""
    verdict = result.verdict
    if found := words.several(result):
        names = _shortly([in_words([one.key]) for one in found])
        return f"Cause{'s' * (len(found) > 1)} of {words.closed(found)} of the gap: {names}"
    if verdict.effect == "none":
        left = int(result.baseline.used.sum()) - len(result.baseline.fitted)
        if left < FEW_VALUES:
            return TOO_FEW
        return UNDECIDED if verdict.probability < LIKELY else NOTHING.capitalize()
    if verdict.effect == "unknown":
        if verdict.probability < LIKELY:
            return UNDECIDED
        return "A gap whose cause is unknown"
    plural = "" if words.second(result) is None else "s"
    if words.probability(result) >= LIKELY:
        return f"Cause{plural}: {words.causes(result)}"
    no_cause = (one.probability for one in result.candidates if one.effect in ("none", "unknown"))
    if max(no_cause, default=0.0) > verdict.probability:
        return UNDECIDED
    return f"Likeliest cause{plural}: {words.causes(result)}"


def _factor(result: Diagnosis) -> float:
    """Return the noise that is counted with over the one that the table states, 1 where it states none."""
    factor = result.features.get("noise_position", 1.0) * result.features.get("scale", 1.0)
    return factor if result.baseline.claimed else 1.0


def _scaled(result: Diagnosis) -> str:
    """Return what the noise that is counted with is to the one that the table states."""
    if result.decomposition is not None and not result.baseline.claimed:
        return " (a laser tracker's: the table states none, and scatter beyond it counts as gap)"
    factor = _factor(result)
    if 1.0 / OFF < factor < OFF:
        return ""
    return f" ({factor:.2g} times the stated noise)"


def _by_line(rows: Sequence[str]) -> list[str]:
    """Return rows, ``file:line`` each, in the order of the files."""
    places = [row.rpartition(":") for row in rows]
    order = sorted(places, key=lambda place: (place[0], int(place[2]) if place[2].isdigit() else 0))
    return ["".join(place) for place in order]


def undecided_text(found: Decomposition) -> str:
    """Return, in words, which effects of the written robot are undecided, and why they stand there."""
    past = {one.key for one in of_the_campaign(found)}  # is not written
    each = [
        _or_alike(in_words([one.key]), one.indistinguishable) for one in found.unclear if one.key not in past
    ]
    said = (
        f"these of its effects are undecided: {'; '.join(each)}. They are written because the others were "
        "fitted beside them, but they may not be the cause"
    )
    return said if each else ""
