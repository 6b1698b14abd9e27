"""A diagnosis for people: the verdict in words, then the tables behind it, and a figure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from beamstiff.diagnosis.decomposed import cause_candidate
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.inference.search import UNKNOWN
from beamstiff.diagnosis.notes import FEW_VALUES, OFF
from beamstiff.diagnosis.result import Candidate, Diagnosis, Estimate
from beamstiff.report.tables import Column, Table, add_rows, counted, number, scale_of, table, worth
from beamstiff.report.verdict import Verdict, data_of, level_of, rounded
from beamstiff.robot.stiffness import parameter_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from beamstiff.diagnosis.decomposition.causes import Cause, Decomposition

SHOWN = 8
PARTS_OF_GAP = {
    "directions": "By direction",
    "loads": "By load",
    "history": "Loading and unloading",
    "time": "Over time",
}
LEAST = 0.0005  # probability of a candidate, or share of a place, that a list still shows
CAUSES = "Causes, each added to those above it"
LIKELY = 0.6  # probability below which a verdict is no more than the likeliest
DUST = 1e-6  # of its standard deviation, below which a value is nothing but rounding
NAMED = 3  # explanations that are named where nothing is decided
UNDECIDED, TOO_FEW, NOTHING = "Undecided", "Too few rows to say anything", "nothing beyond noise"


def diagnosis_tables(result: Diagnosis) -> Iterator[RenderableType]:
    """Yield what a terminal shows of a diagnosis."""
    yield from verdict(result).lines()
    yield Text(summary(result))
    yield Text("")
    if result.decomposition is not None and result.decomposition.gap_shows:
        if result.decomposition.causes:
            yield causes_table(result.decomposition, CAUSES)
        yield Text(remainder_text(result.decomposition))
    if not several(result):
        yield from (candidates_table(result, likely(result, SHOWN), "Which effect"), "")
    sizes = sizes_table(result, "How large")
    if sizes.rows:
        yield from (sizes, "")
    if result.verdict.effect != "none" and (places := notable(result)[:SHOWN]):
        title = "Where: share of the explainable gap that each place could account for"
        yield from (places_table(places, title), "")
    yield from (gap_tables(result, "Position gap of the fitted model, RMS"), "")
    if moved := stiffness_text(result):
        yield Text(f"{moved}\n")
    if result.untestable:
        yield from (untestable_table(result, "What these data cannot show"), "")
    if result.next and result.verdict.effect != "none":
        yield Text(f"Measure next: {proposed(result)} (--next writes them).")
    for line in separations(result):
        yield Text(line)


def verdict(result: Diagnosis) -> Verdict:
    """Return the headline with the gap and its cause, the data, and the one thing to do next."""
    head, ratio = headline(result), result.rms / result.noise if result.noise else np.inf
    gap, found, close = f"Gap of {rounded(1e3 * result.rms)} mm", several(result), result.verdict.shrink
    level = level_of(ratio)
    if head == TOO_FEW:
        said, level = head, "plain"
    elif head == NOTHING.capitalize():
        noise = f"gap {rounded(1e3 * result.rms)} mm, noise floor {rounded(1e3 * result.noise)} mm"
        said, level = f"Model and machine agree: {noise}", "agrees"
    else:
        level = "doubtful" if level == "agrees" else level  # what is systematic is no agreement
        if found:
            said = f"{gap}, {closed(found)} explained by {_shortly([one.key for one in found])}"
        elif head == UNDECIDED:
            said = f"{gap}, cause undecided"
        elif result.verdict.effect == "unknown":
            said = f"{gap}, cause unknown"
        elif head.startswith("Cause") and close is not None and close.shrink >= 0.01:
            share = "" if one_posture(result) else f"{percent(close.shrink)} "
            said = f"{gap}, {share}explained by {causes(result)}"
        else:
            said = f"{gap}, {head[0].lower()}{head[1:]}"
    return Verdict(said, level, data_of(result.baseline.rows), _action(result, head))


def _shortly(keys: Sequence[str]) -> str:
    """Return the first effects, ``effect:component`` each, in words, and how many there are beside them."""
    rest = f" and {len(keys) - NAMED} more" if len(keys) > NAMED else ""
    return in_words(keys[:NAMED]) + rest


def _action(result: Diagnosis, head: str) -> str:
    """Return the one thing to do next, as a sentence."""
    if head == TOO_FEW:
        return "Measure more rows; beamstiff plan chooses postures and loads."
    if head == NOTHING.capitalize():
        return "Nothing to mend. Use the fitted model (--apply) within the postures and loads measured."
    to_check = [one for one in told(result) if one.effect in EFFECTS]
    if not to_check:
        states = f"Measure {proposed(result)} (--next FILE writes them)." if result.next else ""
        return states or "Measure other postures and load directions; beamstiff plan chooses them."
    first = to_check[0]
    said = f"To check {named(first)}, measure {EFFECTS[first.effect].separation}."
    return f"{said} The states that --next FILE writes discriminate best." if result.next else said


def likely(result: Diagnosis, most: int) -> list[Candidate]:
    """Return the candidates that a list shows, the likeliest first: no row of 0.0 %."""
    return [one for one in result.candidates if one.probability >= LEAST][:most]


def notable(result: Diagnosis) -> list[Mapping[str, Any]]:
    """Return the places that could account for some of the gap, the largest share first."""
    places: Sequence[Mapping[str, Any]] = result.where.get("components", [])
    return [item for item in places if item["share"] >= LEAST]


def stiffness_text(result: Diagnosis) -> str:
    """Return, in words, which fitted stiffness is farthest from the file's; empty where none was fitted."""
    finite = {
        name: (given, value)
        for name, (given, value) in result.fitted_stiffness.items()
        if 0.0 < given < np.inf
    }
    if not finite:
        return ""
    name, (given, value) = max(finite.items(), key=lambda item: abs(np.log(item[1][1] / item[1][0])))
    robot = result.baseline.nominal
    unit, joint = parameter_unit(robot, name), name.rpartition(".")[0]
    variable = next((one.variable for one in robot.joints if one.name == joint and one.variable), None)
    of = f"{name} (of {variable})" if variable else name
    return (
        f"Fitted stiffness: farthest from the robot file is {of}, {stiffness_in_words(value)} instead of "
        f"{stiffness_in_words(given)} {unit}."
    )


def stiffness_in_words(value: float) -> str:
    """Return a stiffness as it is read: a number, ``rigid`` or ``free``."""
    return "rigid" if value == np.inf else number(value)


def causes_table(found: Decomposition, title: str) -> Table:
    """Return the causes of a gap that has several."""
    heads = ("closes", "90 %", "gap after", "probability", Column("indistinguishable from", left=True))
    made = table(title, Column("cause", left=True), *heads)
    for cause in found.causes:
        form = cause.forms[0]
        made.add_row(
            f"{form.effect} at {form.component}" if form.component else form.effect,
            percent(cause.closes),
            percents(cause.closes_interval),
            f"{1e3 * cause.rms_after:.3f} mm",
            f"{cause.probability:.2f}",
            in_words(cause.indistinguishable) if cause.indistinguishable else "-",
        )
    return made


def remainder_text(found: Decomposition) -> str:
    """Return, in words, what the causes leave of a gap, and what that follows."""
    rest = found.remainder
    said = f"Remainder: {1e3 * rest.rms:.3f} mm RMS ({percent(rest.share)} of the explainable gap)"
    if rest.follows:
        said += f"; it follows the {' and the '.join(name for name, _ in rest.follows[:2])}"
    if found.unclear:
        share = percent(sum(one.closes for one in found.unclear))
        said += f". Minor or undecided causes are a part of it ({share} of the gap): "
        said += in_words([one.key for one in found.unclear])
    return f"{said}."


def candidates_table(result: Diagnosis, some: Sequence[Candidate], title: str) -> Table:
    """Return the candidates with their probability, and how far the gap closes with each."""
    probability = (Column("probability", only="console"), Column("probability", only="page"))
    rest = ("shape", "gap after", "closes", "90 %")
    made = table(title, *(Column(name, left=True) for name in ("effect", "component")), *probability, *rest)
    for one in some:
        effect, component = causes_of(one, result)
        cells = ["-", "-", "-"]
        if one.shrink is not None and not one_posture(result):
            cells = [
                f"{1e3 * one.shrink.after:.3f} mm",
                percent(one.shrink.shrink),
                percents(one.shrink.interval),
            ]
        said = (f"{one.probability:.3f}", f"{100 * one.probability:.1f} %")
        made.add_row(effect, component, *said, one.shape, *cells)
    return made


def sizes_table(result: Diagnosis, title: str) -> Table:
    """Return the parameters of the verdict and of its look-alikes, beside realistic sizes."""
    realistic = (Column("realistic", only="console"), Column("realistic", only="page"))
    heads = ("value", "std", *realistic, Column("plausible", only="page"), "unit")
    made = table(title, *(Column(name, left=True) for name in ("effect", "parameter")), *heads)
    for one in told(result):
        for item in one.estimates:
            name, value, std, usual, unit = sized(item)
            negative = item.positive and item.value < 0
            plausible = "yes" if item.plausible else "no, negative" if negative else "no, larger than that"
            doubted = usual + ("" if item.plausible else " (!)")
            made.add_row(named(one), name, value, std, doubted, usual, plausible, unit)
    return made


def places_table(places: Sequence[Mapping[str, Any]], title: str) -> Table:
    """Return the share of the explainable gap that each place could account for."""
    made = table(title, "place", Column("share", only="console"), Column("share", only="page"), "90 %")
    for item in places:
        share = item["share"]
        made.add_row(item["component"], percent(share), f"{100 * share:.1f} %", percents(item["interval"]))
    made.most = SHOWN
    return made


def gap_tables(result: Diagnosis, title: str) -> Table:
    """Return the position gap, RMS in mm, by direction, load, loading and time in one table."""
    made = table(title, "by", "part", "mm", left=2)
    for key, name in PARTS_OF_GAP.items():
        by = name.removeprefix("By ").removeprefix("Over ").lower()
        add_rows(made, ([by, part, f"{value:.3f}"] for part, value in result.where.get(key, {}).items()))
    return made


def gap_table(values: Mapping[str, float], title: str, head: str) -> Table:
    """Return the position gap, RMS in mm, by a part of the rows."""
    made = table(title, head, "mm")
    add_rows(made, ([name, f"{value:.3f}"] for name, value in values.items()))
    return made


def untestable_table(result: Diagnosis, title: str) -> Table:
    """Return the effects that the data cannot show, and why."""
    made = table(title, "effect", "component", "why", left=3)
    add_rows(made, ([one.effect, one.component or "-", one.why] for one in result.untestable))
    return made


def percent(share: float) -> str:
    """Return a share in whole percent."""
    return f"{100 * share:.0f} %"


def percents(ends: Sequence[float]) -> str:
    """Return the ends of an interval in whole percent."""
    return f"{100 * ends[0]:.0f} to {100 * ends[1]:.0f} %"


def summary(result: Diagnosis) -> str:
    """Return the verdict in plain words."""
    rms, noise = 1e3 * result.rms, 1e3 * result.noise
    first = f"Gap {tested(result)}: {rms:.3f} mm RMS; noise floor {noise:.3f} mm{_scaled(result)}"
    if not one_posture(result):
        first += f"; best achievable by any elastic model {1e3 * result.ceiling:.3f} mm"
    first += "."
    verdict, head = result.verdict, headline(result)
    if found := several(result):
        return f"{first}\n{head}. {_of_several(found)}"
    sure = percent(verdict.probability)
    if head == UNDECIDED:
        likely = ", ".join(
            f"{NOTHING if one.effect == 'none' else named(one)} ({100 * one.probability:.0f} %)"
            for one in result.candidates[:NAMED]
        )
        structure = " The gap is systematic, not noise." if verdict.effect == "unknown" else ""
        others = [key for key in result.indistinguishable if key != UNKNOWN]
        alike = (
            f"\nIndistinguishable from {named(verdict)} with these data: {in_words(others)}."
            if others and verdict.effect != "unknown"
            else ""
        )
        return f"{first}\n{head}: {likely}.{structure}{alike}"
    if head == TOO_FEW:
        return (
            f"{first}\n{head}: they show nothing beyond noise, but so few rows could hardly show an effect."
        )
    if verdict.effect == "none":
        far = " The rows scatter far more than the stated noise." if _factor(result) > OFF else ""
        return f"{first}\n{head} ({sure}).{far}"
    if verdict.effect == "unknown":
        text = f"{first}\nUnknown ({sure}): the gap is systematic, and no effect in the library explains it."
        if result.indistinguishable:
            text += f"\nStill possible: {in_words(result.indistinguishable)}."
        return text
    also = second(result)
    meaning = EFFECTS[verdict.effect].meaning
    if also is not None:
        sure += f" and {100 * also.probability:.0f} %"
        meaning += f" {EFFECTS[also.effect].meaning}" if also.effect != verdict.effect else ""
    text = f"{first}\n{head} ({sure}). {meaning}"
    if verdict.shrink is not None and one_posture(result):
        text += "\nThe reduction cannot be tested: it needs held-out postures, and all rows are of one."
    elif verdict.shrink is not None:
        share, interval = percent(verdict.shrink.shrink), percents(verdict.shrink.interval)
        both = "it" if also is None else "both"
        text += (
            f"\nAdding {both} reduces the residual to {1e3 * verdict.shrink.after:.3f} mm ({share} of the "
            f"gap above noise; 90 % interval {interval}), within the postures and load directions measured."
        )
    others = [key for key in result.indistinguishable if key != UNKNOWN]
    if others and also is None:
        text += f"\nIndistinguishable with these data: {in_words(others)}."
    elif others:
        text += f"\nPossible in place of one of the two: {in_words(others)}."
    if UNKNOWN in result.indistinguishable:
        open_to = sum(one.probability for one in result.candidates if one.key == UNKNOWN)
        text += f"\nA cause outside the library remains possible ({percent(open_to)})."
    if result.also is not None and also is None:
        text += f"\nAlso: {named(result.also)} ({100 * result.also.probability:.0f} %)."
    if result.outliers:
        text += f"\nOutliers, excluded from the fit: {', '.join(_by_line(result.outliers))}."
    return text


def headline(result: Diagnosis) -> str:
    """Return the verdict in a few words: as sure as its probability and its rows allow."""
    verdict = result.verdict
    if found := several(result):
        names = _shortly([one.key for one in found])
        return f"Cause{'s' * (len(found) > 1)} of {closed(found)} of the gap: {names}"
    if verdict.effect == "none":
        left = int(result.baseline.used.sum()) - len(result.baseline.fitted)
        if left < FEW_VALUES:
            return TOO_FEW
        return UNDECIDED if verdict.probability < LIKELY else NOTHING.capitalize()
    if verdict.effect == "unknown":
        if verdict.probability < LIKELY:
            return UNDECIDED
        return "A gap that no effect in the library explains"
    plural = "" if second(result) is None else "s"
    if verdict.probability >= LIKELY:
        return f"Cause{plural}: {causes(result)}"
    no_cause = (one.probability for one in result.candidates if one.effect in ("none", "unknown"))
    if max(no_cause, default=0.0) > verdict.probability:
        return UNDECIDED
    return f"Likeliest cause{plural}: {causes(result)}"


def several(result: Diagnosis) -> tuple[Cause, ...]:
    """Return the causes of a gap that has more than one, or none that makes most of it; else none."""
    found = result.decomposition
    return () if found is None or (found.verdict and len(found.causes) == 1) else found.causes


def closed(found: Sequence[Cause]) -> str:
    """Return what several causes close together, in whole percent."""
    return percent(min(sum(one.closes for one in found), 1.0))


def _of_several(found: Sequence[Cause]) -> str:
    """Return, in words, what several causes mean and what each closes."""
    effects = dict.fromkeys(one.forms[0].effect for one in found)
    meaning = " ".join(EFFECTS[effect].meaning for effect in effects)
    each = ", ".join(f"{in_words([one.key])} ({percent(one.closes)})" for one in found)
    them = "all of them" if len(found) > 1 else "it"
    left = f"{1e3 * found[-1].rms_after:.3f} mm"
    return (
        f"{meaning}\nShare of the explainable gap that each closes on held-out data, added in this order: "
        f"{each}. Adding {them} reduces the residual to {left}."
    )


def causes(result: Diagnosis) -> str:
    """Return the verdict, and the second cause that it closes with, in words."""
    also = second(result)
    return named(result.verdict) + ("" if also is None else f" and {named(also)}")


def second(result: Diagnosis) -> Candidate | None:
    """Return the second cause, fitted together with the first; wrong rows are none."""
    return None if result.also is None or result.also.effect == "outliers" else result.also


def one_posture(result: Diagnosis) -> bool:
    """Return whether all rows are of one posture, so that none can be held out."""
    return len(np.unique(result.baseline.rows.q, axis=0)) < 2


def tested(result: Diagnosis) -> str:
    """Return, in words, what the gap is of."""
    return "in one posture" if one_posture(result) else "on held-out data"


def _factor(result: Diagnosis) -> float:
    """Return the noise that is counted with over the one that the table states, 1 where it states none."""
    factor = result.features.get("noise_position", 1.0) * result.features.get("scale", 1.0)
    return factor if result.baseline.claimed else 1.0


def _scaled(result: Diagnosis) -> str:
    """Return what the noise that is counted with is to the one that the table states."""
    factor = _factor(result)
    if 1.0 / OFF < factor < OFF:
        return ""
    return f" ({factor:.2g} times the stated noise)"


def sized(item: Estimate) -> tuple[str, str, str, str, str]:
    """Return a parameter for people: name, value, standard deviation, realistic sizes, unit."""
    size = 0.0 if abs(item.value) < DUST * item.std else item.value
    factor, unit = scale_of([size, item.std, *item.realistic], item.unit)
    low, high = (f"{factor * one:.2g}" for one in item.realistic)
    return item.name, *worth(factor * size, factor * item.std), f"{low} to {high}", unit


def named(one: Candidate) -> str:
    """Return a candidate in words."""
    return one.effect if one.component is None else f"{one.effect} at {one.component}"


def _by_line(rows: Sequence[str]) -> list[str]:
    """Return rows, ``file:line`` each, in the order of the files."""
    places = [row.rpartition(":") for row in rows]
    order = sorted(places, key=lambda place: (place[0], int(place[2]) if place[2].isdigit() else 0))
    return ["".join(place) for place in order]


def in_words(keys: Sequence[str]) -> str:
    """Return effects, ``effect:component`` each, in words."""
    parts = [key.partition(":") for key in keys]
    return ", ".join(effect if name in ("", "null") else f"{effect} at {name}" for effect, _, name in parts)


def proposed(result: Diagnosis) -> str:
    """Return, in words, how many states the test plan proposes, and where else to read them."""
    told: dict[str, float] = {}
    for item in result.next:
        told[item["point"]] = told.get(item["point"], 0.0) + item["discrimination"]
    rivals = any(item["separates"] for item in result.next)
    what = "discriminate best between the causes" if rivals else "bound the sizes best"
    states = f"{counted(len(result.next) // len(told), 'state')} to {what}"
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


def told(result: Diagnosis) -> list[Candidate]:
    """Return the verdict, its look-alikes and the second cause; of several causes all."""
    if listed := several(result):
        return [cause_candidate(one) for one in listed]
    keys = {result.verdict.key, *result.indistinguishable}
    found = [one for one in result.candidates if one.key in keys]
    return [*found, *([result.also] if result.also is not None else [])]


def causes_of(one: Candidate, result: Diagnosis) -> tuple[str, str]:
    """Return effect and component of a candidate, of the verdict with those of the second cause."""
    also, component = second(result), one.component or "-"
    if also is None or one.key != result.verdict.key:
        return one.effect, component
    return f"{one.effect} and {also.effect}", f"{component} and {also.component or '-'}"


def diagnosis_figure(result: Diagnosis) -> Figure:
    """Draw the candidates, the places and the gap before and after."""
    from beamstiff.report.figures import BLUE, GREEN, ORANGE, new_figure, plain
    from beamstiff.report.skeleton import draw_shares

    figure = new_figure(12.0, 7.2)
    axes = figure.subplots(2, 2).ravel()
    for one in axes:
        plain(one)
    shown = result.candidates[:SHOWN][::-1]
    axes[0].barh([named(one) for one in shown], [one.probability for one in shown], color=BLUE)
    axes[0].set(title="Which", xlabel="probability", xlim=(0, 1))
    places = result.where.get("components", [])[:SHOWN][::-1]
    share = [item["share"] for item in places]
    low = [item["share"] - item["interval"][0] for item in places]
    high = [item["interval"][1] - item["share"] for item in places]
    axes[1].barh([item["component"] for item in places], share, xerr=[low, high], color=ORANGE)
    axes[1].set(title="Where", xlabel="share of the explainable gap", xlim=(0, 1))
    bars = {"gap": result.rms}
    if result.verdict.shrink is not None:
        bars["with\nthe cause"] = result.verdict.shrink.after
    bars |= {"any elastic\nmodel": result.ceiling, "noise\nfloor": result.noise}
    axes[2].bar(list(bars), [1e3 * value for value in bars.values()], color=GREEN)
    axes[2].set(title="How far", ylabel="held-out position gap, RMS, mm")
    worst = result.where.get("poses", [])
    if worst:
        q = np.array([worst[0]["q"][name] for name in result.baseline.rows.variables])
        shares = {item["component"]: item["share"] for item in result.where.get("components", [])}
        draw_shares(axes[3], result.baseline.robot, q, shares)
        axes[3].set(
            title=f"Where on the robot (worst posture, {worst[0]['rms_mm']:.2f} mm)", xlabel="m", ylabel="m"
        )
    return figure
