"""The tables and the figure of a diagnosis."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from re import Match
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from beamstiff.diagnosis.candidate import Candidate, Estimate
from beamstiff.diagnosis.decomposition.causes import HALF, Decomposition
from beamstiff.diagnosis.decomposition.forms import SLIP
from beamstiff.diagnosis.drift_course import DRIFT
from beamstiff.diagnosis.inference.library import NO_CAMERA
from beamstiff.diagnosis.inference.search import UNKNOWN
from beamstiff.diagnosis.notes import in_words
from beamstiff.diagnosis.places import places_with_look_alikes
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.errors import listed
from beamstiff.report import diagnosis_words as words
from beamstiff.report.calibrated_text import changes_text, drives_table, far_stiffness, uncounted
from beamstiff.report.diagnosis_tables import (
    INTERVAL,
    drift_tables,
    hidden_text,
    smallest_table,
    steps,
    steps_table,
)
from beamstiff.report.diagnosis_text import (
    remainder_text,
    summary,
    verdict,
)
from beamstiff.report.identification import far_off_text
from beamstiff.report.next_action import proposed, separations
from beamstiff.report.tables import Column, Table, below, scale_of, table, worth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN, SIZES = 8, 16  # candidates and places; parameters
PARTS_OF_GAP = {
    "directions": "direction",
    "loads": "load",
    "history": "loading and unloading",
    "time": "time",
}
MOST_ODDS = 1e6  # beyond which a number says nothing
LABEL = 30  # characters of a line of a label in the figure
LEAST = 0.005  # probability of a candidate, or share of a place, that a list still shows: half a percent
OUTSIDE = "a law outside the library"
CLOSES = (
    "Closes: share of the squared gap above noise, on held-out postures: with 75 % closed, half the gap is "
    "left. Its 90 % interval says how far the share depends on the postures."
)
# what parts of a parameter's name mean: where it occurs, how it is written, in words
NAMES = (
    (r"_[xyz]_by_[xyz]", "a_by_b", "how much a grows per unit of b"),
    (r"_by_[xyz][xyz]\b", "a_by_bc", "how much a grows per unit of the product b c"),
    (r"_tool_|\btool_(drift|turn)_", "tool", "along the axes of the tool"),
    (r"\b(drift|turn|expansion)_(\w+_)?[xyz]\b", "drift, turn", "along and about the axes of the base frame"),
    (r"(sine|cosine)_\d", "sine_n, cosine_n", "n periods a turn, of a slide in twice its travel"),
    (
        r"_per_f[xyz]",
        "a_per_fb",
        "tilt or rise of the readings per force along b",
    ),
    (r"mode_\d", "mode_n", "size of typical curve n over the angle, or over time"),
    (
        r"half_lost_motion",
        "half_lost_motion",
        "positive where the joint goes farther than its reading, negative where it stays behind",
    ),
    (r"\bslip_[xyz]", "slip_x", "along the axes of the link or frame that the point is fixed to"),
    (r"\btare", "tare", "what the load cell reads without a load"),
    (
        r"_compliance_[xyz]",
        "compliance_x",
        "along or about x of the base or tool frame; of a joint or link, x is its axis",
    ),
    (
        r"_(r?[xyz]_r?[xyz]|xy|xz|yz)\b",
        "two axes, as x_ry or xz",
        "what a load along the first moves along the second",
    ),
)
DOUBTFUL = "(!) Larger than realistic, or wrongly negative: another effect may look like this one."
OPEN = "(?) Smaller than its standard deviation: these data do not determine it."
SUMMED = "Where: share of the gap that the causes close, summed by place"
ACCOUNTS = "Where: share of the gap above noise that each place could account for"
POWER = re.compile(r"[\d.]+e\+0[1-5]")  # of ten, as in 1.422e+04, a time in s: spelled out
COURSE = re.compile(r"_mode_\d")  # in names of parameters that mean nothing by themselves
DUST = 1e-6  # of its standard deviation, below which a value is nothing but rounding


def diagnosis_tables(result: Diagnosis) -> Iterator[RenderableType]:
    """Yield what a terminal shows of a diagnosis."""
    first = verdict(result)
    yield from first.lines()
    yield Text(summary(result))
    yield Text("")
    if result.decomposition is not None:
        yield steps_table(result)
        if found := by_causes(result):
            yield Text("\n".join([probability_text(found), *next_best_text(result)]))
        said = [remainder_text(result.decomposition)] if result.decomposition.gap_shows else []
        said += filter(None, [changes_text(result)])
        yield Text("".join(f"{line}\n" for line in ["", *said]))
    if not by_causes(result) and result.law is None:  # of no cause there is nothing to compare
        candidates = candidates_table(result, likely(result, SHOWN), "Which effect")
        yield from (candidates, Text(f"{CLOSES}\n" if INTERVAL in candidates.columns else ""))
    sizes = sizes_table(result, "How large")
    if sizes.rows:
        yield sizes
        yield Text("".join(f"{line}\n" for line in names_text(result)))
    for course in drift_tables(result):
        yield from (course, "")
    if result.verdict.effect == "none":
        yield from (smallest_table(result), Text(f"{hidden_text(result)}\n"))
    if result.verdict.effect != "none" and (places := notable(result)[:SHOWN]):
        title = SUMMED if by_causes(result) else ACCOUNTS
        yield from (places_table(places, title), "")
    yield from (gap_tables(result), "")
    doubt = f"; std {doubt}" if (doubt := uncounted(result)) else ""
    drives = drives_table(result, f"Fitted stiffness, as --apply writes it{doubt}")
    if drives.rows:
        far = far_off_text(far_stiffness(result))
        yield from (drives, Text(f"{far}\n" if far else ""))
    hidden = untestable_table(result, "What these data cannot show")
    if hidden.rows:
        yield from (hidden, "")
    if result.next and result.verdict.effect != "none" and proposed(result) not in first.action:
        yield Text(f"Measure next: {proposed(result)} (--next FILE writes them).")
    for line in separations(result):
        if line.partition(": ")[2] not in first.action:
            yield Text(line)


def by_causes(result: Diagnosis) -> Decomposition | None:
    """Return the causes that table, page and figure draw; None where they draw the candidates."""
    return result.decomposition if result.decomposition is not None and result.decomposition.causes else None


def likely(result: Diagnosis, most: int) -> list[Candidate]:
    """Return the candidates that a list shows, the likeliest first: no row under 1 %."""
    return [one for one in result.candidates if one.probability >= LEAST][:most]


def notable(result: Diagnosis) -> list[Mapping[str, Any]]:
    """Return the places that could account for some of the gap, the largest share first."""
    return [item for item in places_with_look_alikes(result) if item["share"] >= LEAST]


def probability_text(found: Decomposition) -> str:
    """Return, in words, what the probabilities of causes are of."""
    said = f"{CLOSES} Probability: that it is this effect."
    if any(one.indistinguishable for one in found.causes):
        said += (
            ' Causes joined by "or": these data do not decide which of them it is; that it is one of them is '
            "likelier."
        )
    for one in found.causes:
        if one.found_again < HALF:
            share, name = words.percent(one.found_again), in_words([one.key])
            said += (
                f" Repeated without a tenth of the postures each time, the search finds {name} in only "
                f"{share} of the cases: measure more postures."
            )
    return said


def next_best_text(result: Diagnosis) -> list[str]:
    """Return, in words, what would stand in place of each cause that has no look-alike."""
    lines = []
    for one in result.runners_up:
        without, ratio = f"Without {in_words([one.cause])}", one.rms / one.rms_with
        if not one.keys:
            lines.append(f"{without} no other effect explains its share: {ratio:.2g} times as much is left.")
            continue
        names = " with ".join(OUTSIDE if key == UNKNOWN else in_words([key]) for key in one.keys[:2])
        odds = f"{one.odds:.1g}" if one.odds < 10.0 else f"{float(f'{one.odds:.1g}'):.0f}"
        less = f"{odds} times less likely" if one.odds < MOST_ODDS else "far less likely"
        less = "as likely" if odds == "1" else less
        gap = f"{ratio:.2g} times as large" if ratio >= 2.0 else f"{100.0 * (ratio - 1.0):.0f} % larger"
        said = f"{without} the best explanation is {names}: {less}"
        if ratio >= 1.005:
            lines.append(f"{said}, held-out gap {gap}.")
        else:
            but = "and" if less == "as likely" else "but"
            lines.append(
                f"{said} by all rows, {but} as good on held-out rows: that explanation may be the true one."
            )
    return lines


def candidates_table(result: Diagnosis, some: Sequence[Candidate], title: str) -> Table:
    """Return the candidates with their probability, and how far the gap closes with each, if there is one."""
    heads = [("cause, its shape", "console"), ("cause", "page"), ("shape", "page")]
    told = (
        []
        if result.verdict.effect == "none" or words.one_posture(result)
        else ["gap after", "closes", INTERVAL]
    )
    made = table(title, *(Column(name, left=True, only=only) for name, only in heads), "probability", *told)
    for one in some:
        cells, cause = ["-"] * len(told), in_full(one, result)
        if one.shrink is not None and told:
            share, ends = words.percent(one.shrink.shrink), words.percents(one.shrink.interval)
            cells = [f"{1e3 * one.shrink.after:.3f} mm", share, ends]
        made.add_row(below(cause, one.shape), cause, one.shape, words.chance(one.probability), *cells)
    rest = 1.0 - sum(one.probability for one in some)
    if rest >= LEAST:
        made.add_row("all others", "all others", "", words.chance(rest), *(["-"] * len(told)))
    return made


def sizes_table(result: Diagnosis, title: str) -> Table:
    """Return the parameters of the verdict and of its look-alikes, beside realistic sizes."""
    made = table(title, "effect, its parameters", "value", "std", "realistic", "unit")
    own = {result.verdict.key, *(one.key for one in (result.also, *words.several(result)) if one is not None)}
    for one in sorted(words.told(result), key=lambda one: one.key not in own):
        some = [item for item in one.estimates if item.value != 0.0]  # the fit left out the others
        if not (some := some or list(one.estimates)):
            continue
        made.add_row(words.named(one))
        if one.key in own and one.effect == DRIFT and any(COURSE.search(item.name) for item in some):
            some = [item for item in some if not COURSE.search(item.name)]
            made.add_row("  its course: see below")
        for item in some:
            name, *cells = sized(item)
            name += " (?)" if _open(item) else "" if item.plausible else " (!)"
            made.add_row(f"  {name}", *cells)
        if one.key in own:  # look-alikes are cut
            made.most = max(SIZES, len(made.rows))
    made.open = made.most is None or len(made.rows) <= made.most
    return made


def _open(item: Estimate) -> bool:
    """Return whether a parameter says nothing: it is smaller than its standard deviation."""
    return item.plausible and 0.0 < abs(item.value) < item.std


def names_text(result: Diagnosis) -> list[str]:
    """Return what parts of the parameters' names mean, the marks of sizes, and the forms that were fitted."""
    items = [item for one in words.told(result) for item in one.estimates]
    names = " ".join(f"{item.name} " for item in items)
    said = [f"{part}: {means}" for pattern, part, means in NAMES if re.search(pattern, names)]
    marks = [DOUBTFUL] if any(not item.plausible for item in items) else []
    marks += [OPEN] if any(map(_open, items)) else []
    # at which row a target slipped is told by its place in the file
    shown = [one for one in words.told(result) if one.shape and one.effect != SLIP]
    own = [(words.named(one), one.shape) for one in shown]
    forms = [f"Fitted forms: {'; '.join(f'{cause}: {shape}' for cause, shape in own)}."] if own else []
    return [*marks, *([f"Names: {'; '.join(said)}."] if said else []), *forms, *_slips_text(result)]


def _slips_text(result: Diagnosis) -> Iterator[str]:
    """Yield from which row on each target that slipped stands elsewhere."""
    if result.decomposition is None:
        return
    for cause in result.decomposition.every:
        rows = [result.baseline.rows.place(row) for row in cause.rows]
        several = [f"{number} from {row}" for number, row in enumerate(rows, 1)]
        if rows:
            said = listed(several) if len(rows) > 1 else f"from {rows[0]}"
            yield f"{in_words([cause.key])}: {said} on (FILE:LINE)."


def places_table(places: Sequence[Mapping[str, Any]], title: str) -> Table:
    """Return the share of the gap above noise that each place could account for."""
    shares = (Column("share", only="console"), Column("share", only="page"), INTERVAL)
    made = table(title, "place", *shares)
    alike = [listed(item["indistinguishable"], SHOWN) for item in places]
    if any(alike):
        made.columns = (*made.columns, Column("or, not distinguished by these rows", left=True))
    for item, others in zip(places, alike, strict=True):
        share = item["share"]
        cells = words.percent(share), f"{100 * share:.1f} %", words.percents(item["interval"]), others
        made.add_row(item["component"], *cells[: len(made.columns) - 1])
    made.most = SHOWN
    return made


def gap_tables(result: Diagnosis) -> Table:
    """Return the position gap, RMS in mm, by direction, load, loading and time in one table."""
    found = result.decomposition
    several = found is not None and bool(found.causes or found.unclear)
    one = result.verdict.effect not in ("none", "unknown")
    without = " without the causes" if several else " without the cause" if one else ""
    title = f"Residual of the fitted rows{without}, RMS (the gap above is that of held-out rows)"
    rows = (
        [by, POWER.sub(_spelled, part), f"{value:.3f}"]
        for key, by in PARTS_OF_GAP.items()
        for part, value in result.where.get(key, {}).items()
    )
    return table(title, "by", "part", "mm", left=2, rows=rows)


def _spelled(power: Match[str]) -> str:
    return f"{float(power[0]):.0f}"


def gap_table(values: Mapping[str, float], title: str, head: str) -> Table:
    """Return the position gap, RMS in mm, by a part of the rows."""
    return table(title, head, "mm", rows=([name, f"{value:.3f}"] for name, value in values.items()))


def untestable_table(result: Diagnosis, title: str) -> Table:
    """Return the effects that the data cannot show, those of one reason in a row."""
    reasons = dict[str, list[str]]()
    for one in (one for one in result.untestable if one.why != NO_CAMERA):
        reasons.setdefault(one.why, []).append(in_words([f"{one.effect}:{one.component or ''}"]))
    rows = ([", ".join(effects), why] for why, effects in reasons.items())
    return table(title, "effects", "why", left=2, rows=rows)


def sized(item: Estimate) -> tuple[str, str, str, str, str]:
    """Return a parameter for people: name, value, standard deviation, realistic sizes, unit."""
    size = 0.0 if abs(item.value) < DUST * item.std else item.value
    factor, unit = scale_of([size, *item.realistic], item.unit)
    low, high = (POWER.sub(_spelled, f"{factor * one:.2g}") for one in item.realistic)
    value, std = (POWER.sub(_spelled, text) for text in worth(factor * size, factor * item.std))
    held = size == 0.0 and item.positive  # at its bound: it has no standard deviation
    return item.name, value, "-" if held else std, f"{low} to {high}", unit


def in_full(one: Candidate, result: Diagnosis) -> str:
    """Return a candidate in words, the verdict with its second cause."""
    return words.causes(result) if one.key == result.verdict.key else words.named(one)


def _broken(name: str) -> str:
    """Return a label in lines that leave the bars their room."""
    return "\n".join(wrap(name, LABEL, break_long_words=False))


def diagnosis_figure(result: Diagnosis) -> Figure:
    """Draw the candidates, the places and the gap before and after."""
    from beamstiff.report.figures import BLUE, GREEN, ORANGE, new_figure, plain
    from beamstiff.report.skeleton import draw_shares

    figure = new_figure(12.0, 7.2)
    axes = figure.subplots(2, 2).ravel()
    for one in axes:
        plain(one)
    found = by_causes(result)
    if found is not None:
        some = found.causes[::-1]
        closes = np.array([one.closes for one in some])
        error = np.abs(np.array([one.closes_interval for one in some]).T - closes)
        axes[0].barh([_broken(in_words([one.key])) for one in some], closes, xerr=error, color=BLUE)
        axes[0].set(title="Which causes", xlabel="share of the gap that each closes", xlim=(0, 1))
    else:
        shown = likely(result, SHOWN)[::-1]
        names = [_broken(in_full(one, result)) for one in shown]
        axes[0].barh(names, [one.probability for one in shown], color=BLUE)
        axes[0].set(title="Which", xlabel="probability", xlim=(0, 1))
    places = result.where.get("components", [])[:SHOWN][::-1]
    if places:
        share = [item["share"] for item in places]
        ends = [(item["share"] - item["interval"][0], item["interval"][1] - item["share"]) for item in places]
        names, error = [item["component"] for item in places], np.transpose(ends)
        axes[1].barh(names, share, xerr=error, color=ORANGE)
        axes[1].set(title="Where", xlabel="share of the gap above noise", xlim=(0, 1))
    else:
        axes[1].set_axis_off()
        axes[1].text(0.5, 0.5, "Where: no place accounts for the gap", ha="center")
    bars = steps(result)
    at = range(len(bars))[::-1]
    names = [_broken(step.model) for step in bars]
    axes[2].barh(at, [1e3 * step.error for step in bars], color=GREEN, tick_label=names)
    axes[2].set(title="How far", xlabel="held-out position gap, RMS, mm")
    worst = result.where.get("poses", [])
    if worst:
        q = np.array([worst[0]["q"][name] for name in result.baseline.rows.variables])
        shares = {item["component"]: item["share"] for item in result.where.get("components", [])}
        draw_shares(axes[3], result.baseline.robot, q, shares)
        title = f"Where on the robot\n(worst posture, {worst[0]['rms_mm']:.2f} mm)"
        axes[3].set(title=title, xlabel="m", ylabel="m")
    return figure
