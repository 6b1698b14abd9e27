"""A diagnosis in words: headline, summary, what the calibration changed, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamstiff.diagnosis.decomposition.causes import HALF
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.inference.search import UNKNOWN
from beamstiff.diagnosis.next_measurement.test_plan import DECIDES
from beamstiff.diagnosis.notes import FEW_VALUES, OFF, weightless
from beamstiff.diagnosis.recalibration import unlike
from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.diagnosis.residual.screening import SILENCE
from beamstiff.diagnosis.result import Candidate, Diagnosis, Estimate
from beamstiff.errors import listed
from beamstiff.measure.doubts import LARGE_DISPLACEMENT
from beamstiff.report.calibrated_text import calibrated_away, moved_load
from beamstiff.report.diagnosis_words import (
    causes,
    chance,
    closed,
    hardly_checked,
    in_words,
    load_lever,
    named,
    one_posture,
    oversized,
    percent,
    percents,
    postures,
    probability,
    second,
    several,
    sure,
    tested,
    told,
    unrealistic,
)
from beamstiff.report.tables import counted
from beamstiff.report.verdict import (
    Verdict,
    data_of,
    level_of,
    rigid_drives,
    rigid_text,
    rounded,
    undetermined_text,
)

if TYPE_CHECKING:
    from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition

SIMULATED = 1e-6  # m, RMS: no instrument reads as finely
LIKELY = 0.6  # probability below which a verdict is no more than the likeliest
NAMED = 3  # explanations that are named where nothing is decided
UNDECIDED, TOO_FEW, NOTHING = "Undecided", "Too few rows to say anything", "nothing beyond noise"
OF_THE_LOAD = ("load-error", "tool-offset", "payload-error")  # effects that a misplaced load looks like
LIKE_SAG = ("angle-curve", "geometry-error")  # effects that a weight unknown to the robot file looks like
WEIGHT = "no weight is known by which the machine sags, and such a sag follows the joint angles as well"
# what a remainder follows, and how it is varied by itself
VARIED = {
    "angle": "move {} alone through its range in small steps, unloaded",
    "direction of approach": "move {} alone to the same values from both sides",
    "time": "return to one posture now and then, unloaded",
    "load": "load some postures step by step, up and down again",
    "reflector": "read all reflectors in the same postures",
}
SQUARES = "Shares refer to squared errors: with 75 % closed, half of the gap is left."
NO_CAUSES = "Fitted zeros, lengths and drive stiffness do not count as causes."
ELASTIC = "best achievable by any elastic model (compliance of every kind at every place)"


def verdict(result: Diagnosis) -> Verdict:
    """Return the headline with the gap and its cause, the data, and the one thing to do next."""
    head, ratio = headline(result), result.rms / result.noise if result.noise else np.inf
    found, close, level = several(result), result.verdict.shrink, level_of(ratio)
    gap = f"Gap of {rounded(1e3 * result.rms)} mm on {counted(postures(result), 'posture')}"
    if result.recalibration is not None and result.recalibration.placed > result.rms:
        gap += f" with calibrated geometry ({rounded(1e3 * result.recalibration.placed)} mm before)"
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
        elif wrong := calibrated_away(result):
            said, level = f"{wrong}; calibrated, model and machine agree ({noise})", "doubtful"
    else:
        level = "doubtful" if level == "agrees" else level  # what is systematic is no agreement
        if found:
            # of several causes, look-alikes in short: the table names them
            most = NAMED if len(found) == 1 else 1
            each = [_or_alike(in_words([one.key]), one.indistinguishable, most) for one in found]
            said = f"{gap}, {_explained(result, closed(found), _shortly(each))}"
        elif head == UNDECIDED:
            said = f"{gap}, cause undecided"
        elif result.verdict.effect == "unknown":
            said = f"{gap}, cause unknown" + (f": perhaps {best}" if (best := _perhaps(result)) else "")
        elif head.startswith("Cause") and close is not None and close.shrink >= 0.01:
            share = "" if one_posture(result) else percent(close.shrink)
            alike = [key for key in result.indistinguishable if key != UNKNOWN]
            said = f"{gap}, {_explained(result, share, _or_alike(causes(result), alike))}"
        else:
            alike = [key for key in result.indistinguishable if key != UNKNOWN]
            said = _or_alike(f"{gap}, {head[0].lower()}{head[1:]}", alike)
        if far := [named(one) for one, _ in unrealistic(result)]:
            said += f"; unrealistic size: {_shortly(far)}"
    drives = "" if result.rms > LARGE_DISPLACEMENT else _drives(result)  # then the table is wrong first
    action = f"{_action(result, head)} {drives}".strip()
    return Verdict(said, level, data_of(result.baseline.rows), action)


def _explained(result: Diagnosis, share: str, by: str) -> str:
    """Return, in words, what explains the gap; a doubt about its share is none about the cause."""
    if hardly_checked(result):
        return f"explained by {by}; the share, {share}, is uncertain"
    return f"{share} explained by {by}".strip()


def _shortly(names: Sequence[str], most: int = NAMED) -> str:
    """Return the first names, and how many there are beside them: one more is named as well."""
    most += len(names) == most + 1
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest


def _or_alike(name: str, alike: Sequence[str], most: int = NAMED) -> str:
    """Return a cause in words with what these data cannot distinguish from it."""
    if not alike:
        return name
    return f"{name} (or {_shortly([in_words([one]) for one in alike], most)})"


def _action(result: Diagnosis, head: str) -> str:
    """Return the one thing to do next, as a sentence."""
    if head == TOO_FEW:
        return "Measure more rows; beamstiff plan chooses postures and loads."
    if result.decomposition is not None and unlike(result.decomposition):
        return "Check that robot file and table are of one robot, and each joint column of its joint."
    if overstated(result):
        return "State the noise of the instrument (sigma_position: 0.02 mm, say) and diagnose again."
    if head == NOTHING.capitalize():
        write = (
            "Write the calibrated robot (--apply FILE, or beamstiff calibrate --out FILE) and use it"
            if calibrated_away(result)
            else "Use the fitted model (--apply FILE writes it)"
        )
        return f"{write} within the postures and loads measured. {NO_CAUSES}"
    if result.rms > LARGE_DISPLACEMENT:
        gap = rounded(1e3 * result.rms)
        return f"Check joint readings, units and robot file: {gap} mm are too much for an effect."
    to_check = [one for one in told(result) if one.effect in EFFECTS]
    of_the_load = not to_check or any(one.effect in OF_THE_LOAD for one in to_check)
    if of_the_load and (moved := moved_load(result)):
        return moved
    if moved := next((said for one in to_check if (said := _elsewhere(one))), ""):
        return moved
    like_sag = not to_check or any(one.effect in LIKE_SAG for one in to_check)
    if like_sag and weightless(result.baseline):
        return f"Give the robot file `masses`, estimates are enough, and diagnose again: {WEIGHT}."
    if not to_check:
        return _also(result, "Measure").strip() or _by_remainder(result)
    far = [(one, size) for one, size in unrealistic(result) if one.effect in EFFECTS]
    first = far[0][0] if far else to_check[0]
    said = f"To check {named(first)}: {EFFECTS[first.effect].separation}."
    if far:
        said = f"{_doubt(*far[0])} {said}"
    return f"{said}{_also(result, 'Also measure')}"


def _drives(result: Diagnosis) -> str:
    """Return what to do about drives that are rigid in the robot file, or of which the rows say nothing."""
    base = result.baseline
    felt = bool(base.rows.wrench.any()) or (base.absolute and not weightless(base))
    named_ones = {one.component for one in told(result) if one.effect == "joint-compliance"}
    rigid = [] if not felt or None in named_ones else rigid_drives(base.nominal, named_ones)
    fitted, guessed = result.fitted_stiffness, {*result.untouched, *result.undetermined}
    # nothing is fitted where no row loads a drive
    unknown = [name for name in fitted if name in guessed] if fitted else fitted_names(base.nominal)
    return " ".join(filter(None, (rigid_text(rigid), undetermined_text(unknown))))


def _by_remainder(result: Diagnosis) -> str:
    """Return what to measure next of a gap without a cause: what its remainder follows, varied by itself."""
    found = result.decomposition
    if found is None or not found.remainder.follows:
        return "Measure other postures and load directions; beamstiff plan chooses them."
    what = found.remainder.follows[0][0]
    how, joint, name = what.rpartition(" of ")
    vary = VARIED[how or what].format(name if joint else "")
    return f"The gap follows the {what}: {vary}. Diagnose the old and the new rows together."


def _elsewhere(cause: Candidate) -> str:
    """Return, in words, where a load acts whose error is that of a wrong place; empty for another error."""
    lever = load_lever(cause)
    if lever is None:
        return ""
    place = ", ".join(f"{1e3 * one:+.0f}" for one in lever)
    return (
        f"Check where the load acts. The error looks like a load that acts about ({place}) mm, along the "
        "tool's axes, from where the robot file says. Correct the link in --tcp or the column "
        "load_point, and diagnose again."
    )


def _doubt(cause: Candidate, size: Estimate) -> str:
    """Return, in words, that a size is unrealistic."""
    negative = size.positive and size.value < 0
    is_it = "negative" if negative else f"{oversized(size):.2g} times the largest realistic size"
    return f"Doubt {named(cause)}: its {size.name} is {is_it}. Another effect may look like it."


def _also(result: Diagnosis, measure: str) -> str:
    """Return the states to measure as a sentence after others, `measure` its verb; empty without."""
    if not result.next:
        return ""
    each = [item["discrimination"] for item in result.next if item["separates"]]
    if each and sum(each) < DECIDES:
        return f" Readings like these hardly decide: even {proposed(result)} add little{_written(result)}"
    return f" {measure} {proposed(result)}{_written(result)}"


def _written(result: Diagnosis) -> str:
    """Return what loads the proposed states have, and which option writes them."""
    force = max(float(np.linalg.norm(item["wrench"][:3])) for item in result.next)
    loaded = bool(np.any(result.baseline.rows.wrench))
    loads = f", under loads as in the table, at most {float(f'{force:.3g}'):g} N" if force and loaded else ""
    return f"{loads} (--next FILE writes them)."


def remainder_text(found: Decomposition) -> str:
    """Return, in words, what the causes leave of a gap, and what that follows."""
    rest = found.remainder
    said = f"Remainder, all rows fitted: {1e3 * rest.rms:.3f} mm RMS ({percent(rest.share)} of the gap)."
    if rest.follows:
        said += f" It follows the {' and the '.join(name for name, _ in rest.follows[:2])}."
    if found.unclear:
        share, names = closed(found.unclear), in_words([one.key for one in found.unclear])
        said += f"\nMinor or undecided causes close another {share} on held-out data: {names}."
    if found.unmodelled:
        each = [f"{one.forms[0].component} ({percent(one.closes)} of the gap)" for one in found.unmodelled]
        said += f"\nOutside the library: {', '.join(each)}."
    return said


def summary(result: Diagnosis) -> str:
    """Return the verdict in plain words."""
    rms, noise = 1e3 * result.rms, 1e3 * result.noise
    gap = f"{rms:.3f} mm RMS between measured and predicted position"
    first = f"Gap {tested(result)}: {gap}; noise floor {noise:.3f} mm{_scaled(result)}"
    if not one_posture(result) and result.decomposition is None:
        first += f"; {ELASTIC} {1e3 * result.ceiling:.3f} mm"
    first += "."
    verdict, head = result.verdict, headline(result)
    if found := several(result):
        return f"{first}\n{_of_several(found)}{_weak(result)}"
    certain = sure(result)
    if head == UNDECIDED:
        first_ones = ", ".join(
            f"{NOTHING if one.effect == 'none' else named(one)} ({chance(one.probability)})"
            for one in result.candidates[:NAMED]
        )
        structure = " The gap is systematic, not noise." if verdict.effect == "unknown" else ""
        others = [key for key in result.indistinguishable if key != UNKNOWN]
        alike = (
            f"\nIndistinguishable from {named(verdict)} with these data: {in_words(others)}."
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
        if best := _perhaps(result):
            text += f"no cause is sure. Best so far: {best} of it; the name may be wrong."
        else:
            text += (
                "no effect of the library explains it reliably. It is outside the library, or several "
                "effects act together that these rows cannot separate."
            )
        if result.indistinguishable:
            text += f"\nStill possible: {in_words(result.indistinguishable)}."
        return text
    also = second(result)
    meaning = f" {EFFECTS[verdict.effect].meaning}"
    if also is not None and also.effect != verdict.effect:
        meaning = f"\n{verdict.effect}:{meaning}\n{also.effect}: {EFFECTS[also.effect].meaning}"
    text = f"{first}\n{head} (probability {certain}).{meaning}"
    if verdict.shrink is not None and one_posture(result):
        text += "\nThe reduction cannot be tested: it needs held-out postures, and all rows are of one."
    elif verdict.shrink is not None:
        share, ends = percent(verdict.shrink.shrink), percents(verdict.shrink.interval)
        interval = "" if ends == share else f" (90 % interval over the postures: {ends})"
        text += (
            f"\nWith {'it' if also is None else 'both'}, {1e3 * verdict.shrink.after:.3f} mm are left on "
            f"held-out postures: {share} of the gap above noise is closed{interval}. This holds for postures "
            f"and load directions as measured.\n{SQUARES}{_weak(result)}"
        )
    others = [key for key in result.indistinguishable if key != UNKNOWN]
    if others and also is None:
        text += f"\nIndistinguishable with these data: {in_words(others)}."
    elif others:
        text += f"\nPossible in place of one of the two: {in_words(others)}."
    if UNKNOWN in result.indistinguishable:
        open_to = sum(one.probability for one in result.candidates if one.key == UNKNOWN)
        text += f"\nA cause outside the library remains possible ({chance(open_to)})."
    if result.also is not None and also is None:
        text += f"\nAlso: {named(result.also)} (probability {chance(result.also.probability)})."
    if result.outliers:
        text += f"\nOutliers, excluded from the fit: {', '.join(_by_line(result.outliers))}."
    return text


def _perhaps(result: Diagnosis) -> str:
    """Return, in words, the undecided causes that close at least half of an unknown gap; empty without."""
    unclear = () if result.decomposition is None else result.decomposition.unclear
    if sum(one.closes for one in unclear) < HALF:
        return ""
    each = [_or_alike(in_words([one.key]), one.indistinguishable) for one in unclear]
    return f"{_shortly(each)}, {'which close' if len(each) > 1 else 'which closes'} {closed(unclear)}"


def _weak(result: Diagnosis) -> str:
    """Return, in words, that the share is hardly checked; empty where it is well."""
    if not hardly_checked(result):
        return ""
    return (
        f" This share is uncertain: it was checked on {counted(postures(result), 'posture')} only. Measure "
        "others, and check the written robot on them (beamstiff verify)."
    )


def headline(result: Diagnosis) -> str:
    """Return the verdict in a few words: as sure as its probability and its rows allow."""
    verdict = result.verdict
    if found := several(result):
        names = _shortly([in_words([one.key]) for one in found])
        return f"Cause{'s' * (len(found) > 1)} of {closed(found)} of the gap: {names}"
    if verdict.effect == "none":
        left = int(result.baseline.used.sum()) - len(result.baseline.fitted)
        if left < FEW_VALUES:
            return TOO_FEW
        return UNDECIDED if verdict.probability < LIKELY else NOTHING.capitalize()
    if verdict.effect == "unknown":
        if verdict.probability < LIKELY:
            return UNDECIDED
        return "A gap whose cause is unknown"
    plural = "" if second(result) is None else "s"
    if probability(result) >= LIKELY:
        return f"Cause{plural}: {causes(result)}"
    no_cause = (one.probability for one in result.candidates if one.effect in ("none", "unknown"))
    if max(no_cause, default=0.0) > verdict.probability:
        return UNDECIDED
    return f"Likeliest cause{plural}: {causes(result)}"


def _of_several(found: Sequence[Cause]) -> str:
    """Return, in words, what several causes mean and what each closes."""
    effects = dict.fromkeys(one.forms[0].effect for one in found)
    meaning = "\n".join(f"{effect}: {EFFECTS[effect].meaning}" for effect in effects)
    each = ", ".join(f"{in_words([one.key])} ({percent(one.closes)})" for one in found)
    them = "all of them" if len(found) > 1 else "it"
    return (
        f"{meaning}\nShare of the gap that each closes on held-out data, added in this order: {each}.\n"
        f"With {them}, {1e3 * found[-1].rms_after:.3f} mm are left. {SQUARES}"
    )


def _factor(result: Diagnosis) -> float:
    """Return the noise that is counted with over the one that the table states, 1 where it states none."""
    factor = result.features.get("noise_position", 1.0) * result.features.get("scale", 1.0)
    return factor if result.baseline.claimed else 1.0


def overstated(result: Diagnosis) -> float:
    """Return how many times the stated noise is what is left of the readings, where that is no chance; or 0.

    What leaves no micrometre was written by a program, and not read.
    """
    left = result.features.get("scatter", 1.0)
    if not result.baseline.claimed or result.rms < SIMULATED:
        return 0.0
    return 1.0 / left if 0.0 < left < SILENCE else 0.0


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


def proposed(result: Diagnosis) -> str:
    """Return, in words, how many states the test plan proposes, and where else to read them."""
    told: dict[str, float] = {}
    for item in result.next:
        told[item["point"]] = told.get(item["point"], 0.0) + item["discrimination"]
    rivals = any(item["separates"] for item in result.next)
    count = len(result.next) // len(told)
    verb = ("discriminate" if rivals else "determine") + ("" if count > 1 else "s")
    what = f"{verb} best between the causes" if rivals else f"{verb} the sizes of the causes best"
    if not rivals and result.indistinguishable and result.decomposition is not None:
        what += " (no posture and load here distinguishes look-alikes)"
    states = f"the {counted(count, 'state')} that {what}"
    if free := [one.name for one in result.baseline.nominal.actuated if one.limits is None]:
        states += f", within the measured range of {listed(free, 3)} (no limits in the robot file)"
    tcp = told.pop(next(iter(told)))  # one point, or the TCP and another
    for node, there in told.items():
        times = f" {there / tcp:.0f} times as well" if there < 1e3 * tcp else ", as the TCP does not"
        near = [joint.name for joint in result.baseline.nominal.joints if node in joint.nodes]
        place = f"{node} ({', '.join(near)})" if near else node
        states += f"; also read a reflector on {place}, which discriminates{times}"
    return states


def separations(result: Diagnosis) -> list[str]:
    """Return, in words, the measurements that separate the verdict from its look-alikes."""
    keys = [one.key for one in told(result)]
    effects = list(dict.fromkeys(key.partition(":")[0] for key in keys))
    return [f"To check {name}: {EFFECTS[name].separation}." for name in effects if name in EFFECTS]


def undecided_text(found: Decomposition) -> str:
    """Return, in words, which effects of the written robot are undecided, and why they stand there."""
    if not found.unclear:
        return ""
    each = "; ".join(_or_alike(in_words([one.key]), one.indistinguishable) for one in found.unclear)
    return (
        f"these effects are undecided: {each}. The robot predicts best with them, but they may not be the "
        f"cause"
    )
