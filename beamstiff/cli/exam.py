"""`beamstiff exam`: the diagnosis on simulated campaigns whose effect is withheld."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamstiff.cli.options import Debug, Html, Json, Processes, Quiet, Scheduler, robot_file
from beamstiff.cli.output import check_outputs, note_effects, people, say, source_of, write_figure, write_json
from beamstiff.errors import BeamstiffError, listed, suggest

if TYPE_CHECKING:
    from beamstiff.exam.blind import Control, Diagnose, Examiner
    from beamstiff.exam.cases import Exam
    from beamstiff.exam.record import Kind, Record
    from beamstiff.exam.run import Void
    from beamstiff.robot.description import Robot


def exam(
    context: typer.Context,
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROBOT]",
            help="Examine on this robot only: YAML file, or the name of one that comes along; default: two "
            "serial robots, arms of random proportions and the closed-loop ir663.",
        ),
    ] = None,
    plan: Annotated[
        str | None,
        typer.Option(
            "--plan",
            metavar="CSV",
            help="Examine on these poses and loads only, a table of measurements or a plan: what could "
            "be found with it?",
        ),
    ] = None,
    cases: Annotated[int, typer.Option("--cases", min=1, help="How many cases.")] = 100,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of all draws; the same cases again.")] = 0,
    processes: Processes = 1,
    scheduler: Scheduler = None,
    classes: Annotated[
        list[str] | None,
        typer.Option(
            "--classes",
            metavar="NAME,...",
            help="Only cases of these kinds (null, single, pair, outside, removed) or single effects "
            "(backlash, ...), in equal shares.",
        ),
    ] = None,
    sets: Annotated[
        str | None,
        typer.Option(
            "--sets",
            metavar="FOLDER",
            help="Examine on the campaigns of a folder with a labels.json instead of simulated ones.",
        ),
    ] = None,
    json: Json = None,
    out: Annotated[
        str | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Keep every case's result as a line of JSON; a broken-off exam is taken up again there.",
        ),
    ] = None,
    reports: Annotated[
        str | None, typer.Option("--reports", metavar="FOLDER", help="Keep every diagnosis' report there.")
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option("--figure", metavar="FILE", help="Draw the reliability diagram (.png, .svg or .pdf)."),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option("--compare/--no-compare", help="Ask a plain regression too (best BIC), as a control."),
    ] = True,
    html: Html = None,
    quiet: Quiet = False,
    debug: Debug = False,  # noqa: ARG001
) -> None:
    """Examine the diagnosis on simulated campaigns whose effect is withheld from it.

    A simulator that shares no equations with the library draws a robot, what is wrong with it (an
    effect, none, two, one outside the library, or one whose class is taken from the library), a
    campaign, its noise and what is claimed of the noise. The label is sealed by its SHA-256, the
    rows are diagnosed, the report is sealed, and the label is opened. The table shows each figure
    beside what is required, the worst class first.

    \b
    Examples:
      beamstiff exam --cases 2160 --seed 7 --processes 4 --out results.jsonl --html report.html
      beamstiff exam robot.yaml --plan plan.csv --cases 200
      beamstiff exam --cases 60 --classes null,backlash,hysteresis
      beamstiff exam --cases 2160 --scheduler tcp://10.0.0.5:8786 --out results.jsonl
    """  # noqa: D301 - a real backspace keeps the lines of the next paragraph
    from beamstiff.exam.blind import Examiner
    from beamstiff.exam.labelled import examine_folder
    from beamstiff.exam.run import check_results
    from beamstiff.exam.table import by_design, table_dict
    from beamstiff.files import check_writable
    from beamstiff.outputs import check_replaceable
    from beamstiff.report.exam import exam_tables, plan_tables, reliability_figure

    inputs: list[str | Path] = [] if robot is None else [robot_file(robot)]
    inputs += [] if plan is None else [plan]
    if sets is not None and Path(sets).is_dir():
        inputs += [path for path in Path(sets).iterdir() if path.is_file()]
    written = {} if reports is None or not Path(reports).is_dir() else _reports(reports, sets, cases)
    other = {} if out is None else {"--out": out}
    check_outputs(inputs, json, other | written, figure=figure, html=html)
    for path in written.values():
        check_replaceable(path)
    if out is not None:
        check_results(Path(out))
        check_writable(out)
    source = source_of(context, html, inputs, seed)
    if figure is not None:
        from beamstiff.report.figures import check_format

        check_format(figure)
    examiner = Examiner(_diagnose(), controls=_controls() if compare else {}, reports=_folder(reports))
    if sets is not None:
        if robot is not None or plan is not None or out is not None or classes:
            raise BeamstiffError("--sets: found other options of what to examine, expected the folder only")
        settings: dict[str, Any] = {"sets": sets}
        records = examine_folder(Path(sets), examiner, processes=processes, scheduler=scheduler)
    else:
        asked = _exam(robot, plan, seed, classes, quiet)
        settings = asked.settings()
        records = _simulated(asked, cases, examiner, processes, scheduler, out, quiet)
    console = people(quiet, json)
    for shown in plan_tables(records) if plan else exam_tables(records):
        console.print(shown)
        console.print()
    if figure is not None:
        write_figure(reliability_figure(by_design(records)[0]), figure)
    facts = {"exam": settings, **table_dict(records)}
    if html is not None and source is not None:
        from beamstiff.outputs import write_output
        from beamstiff.report.html.exam import exam_html

        examined = robot or sets or "Robots of the exam"
        write_output(html, exam_html(records, examined, source, facts, plan=plan is not None))
    write_json(facts, json)


def _simulated(
    asked: Exam,
    cases: int,
    examiner: Examiner,
    processes: int,
    scheduler: str | None,
    out: str | None,
    quiet: bool,
) -> list[Record]:
    from beamstiff.exam.run import run_exam

    with _bar(cases, quiet) as progress:
        records = run_exam(
            asked,
            cases,
            examiner,
            processes=processes,
            scheduler=scheduler,
            results=None if out is None else Path(out),
            progress=progress,
        )
    if not records:
        raise BeamstiffError(
            f"exam: none of {cases} cases could be simulated, expected another robot or plan"
        )
    if len(records) < cases:
        say(f"note: {cases - len(records)} of {cases} cases could not be simulated and count nowhere", quiet)
    return records


def _exam(robot: str | None, plan: str | None, seed: int, classes: Sequence[str] | None, quiet: bool) -> Exam:
    """Return the exam that was asked for."""
    from beamstiff.exam.cases import PLAN_SHARES, SHARES, Exam
    from beamstiff.exam.names import EFFECTS
    from beamstiff.measure.reader import read_measurements
    from beamstiff.robot.reader import load_robot

    if plan is not None and robot is None:
        raise BeamstiffError(
            "--plan: found a plan without a robot, expected: beamstiff exam ROBOT --plan CSV"
        )
    description = None if robot is None else load_robot(robot)
    if description is not None and description.effects:  # the exam's own simulator does not know them
        note_effects(description, "the exam, neither of its machines nor of its models", quiet)
        description = description.model_copy(update={"effects": ()})
    shares, effects = (PLAN_SHARES if plan else SHARES), EFFECTS
    if classes:
        shares, effects = parse_classes(classes)
    if description is not None:
        effects = _possible(description, effects, quiet)
        if "single" in shares and classes:
            shares = {**shares, "single": len(effects)}
    laid_out = None
    if plan is not None and description is not None:
        laid_out = read_measurements(plan, description, require_measured=False)
        if laid_out.sigma_position is None:
            noise = 1e3 * Exam(seed).noise[0]
            say(f"note: {plan} states no sigma_position; {noise:g} mm is assumed", quiet)
    return Exam(seed=seed, shares=shares, effects=effects, robot=description, plan=laid_out)


def _possible(robot: Robot, effects: tuple[str, ...], quiet: bool) -> tuple[str, ...]:
    from beamstiff.exam.cases import possible_effects

    possible = possible_effects(robot, effects)
    missing = [effect for effect in effects if effect not in possible]
    if not possible:
        raise BeamstiffError(f"exam: robot {robot.name!r} can have none of {listed(effects)}")
    if missing:
        say(f"note: robot {robot.name} cannot have {listed(missing, 20)}", quiet)
    return possible


def parse_classes(texts: Sequence[str]) -> tuple[dict[Kind, int], tuple[str, ...]]:
    """Return the share of each kind of case, and the effects asked, from texts such as ``"null,backlash"``.

    Every name gets an equal share; ``single`` stands for all effects.

    Raises
    ------
    BeamstiffError
        When a name is neither a kind nor an effect.

    Examples
    --------
    >>> parse_classes(["null,backlash", "hysteresis"])
    ({'null': 1, 'single': 2}, ('backlash', 'hysteresis'))
    """
    from beamstiff.exam.names import EFFECTS
    from beamstiff.exam.record import KINDS

    names = list(dict.fromkeys(name.strip() for text in texts for name in text.split(",")))
    unknown = [name for name in names if name not in (*KINDS, *EFFECTS)]
    if unknown:
        known = (*KINDS, *EFFECTS)
        raise BeamstiffError(
            f"--classes: found {unknown[0]!r}{suggest(unknown[0], known)}, "
            f"expected {listed(known, len(known))}"
        )
    effects = EFFECTS if "single" in names else tuple(name for name in names if name in EFFECTS)
    shares: dict[Kind, int] = {kind: 1 for kind in KINDS if kind in names and kind != "single"}
    if effects:
        shares["single"] = len(effects)
    return shares, effects or EFFECTS


def _reports(folder: str, sets: str | None, cases: int) -> dict[str, str]:
    """Return the files that ``--reports`` will write, by their names."""
    from beamstiff.exam.blind import report_name
    from beamstiff.exam.labelled import set_names

    if sets is not None:
        names = [f"{name}.json" for name in set_names(Path(sets))]
    else:
        names = [report_name(case) for case in range(cases)]
    return {f"--reports {name}": str(Path(folder, name)) for name in names}


def _folder(reports: str | None) -> Path | None:
    if reports is None:
        return None
    from beamstiff.files import remove_drafts

    folder = Path(reports)
    try:
        folder.mkdir(exist_ok=True)
        remove_drafts(folder)
    except OSError as error:
        raise BeamstiffError(f"--reports {reports}: cannot be made: {error.strerror or error}") from None
    return folder


def _diagnose() -> Diagnose:
    """Return the diagnosis; loaded only here, because it takes its time."""
    diagnose: Diagnose = import_module("beamstiff.diagnosis.diagnose").diagnose
    return diagnose


def _controls() -> dict[str, Control]:
    """Return the plain methods that the diagnosis is compared with."""
    return {"plain regression, best BIC": import_module("beamstiff.diagnosis.plain_regression").plain_bic}


@contextmanager
def _bar(cases: int, quiet: bool) -> Iterator[Callable[[Record | Void], None]]:
    """Show on stderr how far the exam is, if it is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True, quiet=quiet)
    if quiet or not console.is_terminal:
        yield lambda _: None
        return
    columns = (TextColumn("examining"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("cases", total=cases)
        yield lambda _: bar.advance(task)
