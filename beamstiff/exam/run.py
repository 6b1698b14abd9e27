"""Runs an exam: over processes or machines, results line by line in a file, taken up after a break."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Generic, NoReturn, TypeVar

from pydantic import TypeAdapter

from beamstiff.errors import BeamstiffError
from beamstiff.exam.blind import Examiner, examined, keep_report, report_name
from beamstiff.exam.cases import Exam, draw_case
from beamstiff.exam.crowded.blind import examined_crowded
from beamstiff.exam.crowded.cases import CrowdedExam, draw_crowded_case
from beamstiff.exam.crowded.record import CrowdedRecord
from beamstiff.exam.record import Record, record_from
from beamstiff.files import held, is_device, read_text, remove_drafts, target_of, write_new
from beamstiff.parallel import parallel_map

FORMAT = "beamstiff-exam/2"


@dataclass(frozen=True)
class Void:
    """A case that the simulator could not make; it counts nowhere."""

    case: int
    why: str


R = TypeVar("R", Record, CrowdedRecord)
Write = Callable[[dict[str, Any]], None]


@dataclass(frozen=True)
class Procedure(Generic[R]):
    """How the cases of a sort of exam are drawn, examined and read again."""

    draw: Callable[[Any, int], Any]  # a case, with its ``label``, from the exam and a number
    examined: Callable[[Any, Any, Examiner], tuple[R, dict[str, Any]]]  # record and report of a case
    record_from: Callable[[Mapping[str, Any]], R]  # the record, from its plain data


SINGLE = Procedure(draw_case, examined, record_from)
CROWDED = Procedure(draw_crowded_case, examined_crowded, TypeAdapter(CrowdedRecord).validate_python)


def run_exam(exam: Exam, count: int, examiner: Examiner, **more: Any) -> list[Record]:
    """Return the records of cases 0 to `count` - 1 of single effects, in their order; see `run_cases`."""
    return run_cases(SINGLE, exam, count, examiner, **more)


def run_cases(
    procedure: Procedure[R],
    exam: Exam | CrowdedExam,
    count: int,
    examiner: Examiner,
    *,
    processes: int = 1,
    scheduler: str | None = None,
    results: Path | None = None,
    progress: Callable[[R | Void], None] = lambda _: None,
) -> list[R]:
    """Return the records of cases 0 to `count` - 1, in their order.

    `results`, a file of JSON lines, gets the exam's settings, every case's seal (SHA-256 of the label) before
    it is given out, and its record once it is opened; records that are there are not asked for again, and a
    line that was cut short goes. `examiner`: pickled for several processes or a scheduler of dask.
    `progress`: called after every case.

    Raises BeamstiffError when `results` is another exam's or cannot be written, or processes fail.
    """
    if count < 1 or processes < 1:
        raise BeamstiffError(
            f"exam: found {count} cases and {processes} processes, expected 1 or more of each"
        )
    with _resumed(results, exam.settings()) as (kept, write):
        found: dict[int, R | Void] = {case: item for case, item in kept.items() if case < count}
        for item in found.values():
            progress(item)

        def sealed(done: Any) -> list[Any]:
            """Write a case's seal before anybody is given the case."""
            if isinstance(done, Void | tuple):
                return []
            write({"sealed": done.label.case, "label_sha256": done.label.digest()})
            return [done]

        missing = (case for case in range(count) if case not in found)
        step = partial(_step, procedure, exam, examiner)
        for _, done in parallel_map(step, missing, processes=processes, scheduler=scheduler, then=sealed):
            if isinstance(done, Void):
                write({"void": done.case, "why": done.why})
                found[done.case] = done
                progress(done)
            elif isinstance(done, tuple):
                record, report = done
                if report is not None:
                    keep_report(examiner, report_name(record.label.case), report)
                write({"record": record.to_dict()})
                found[record.label.case] = record
                progress(record)
    return [item for _, item in sorted(found.items()) if not isinstance(item, Void)]


def _step(procedure: Procedure[R], exam: Exam | CrowdedExam, examiner: Examiner, task: Any) -> Any:
    """Return the case of a number, or record and report of what the examiner answered to a case."""
    number = task if isinstance(task, int) else task.label.case
    try:
        if isinstance(task, int):
            return procedure.draw(exam, task)
        record, report = procedure.examined(exam, task, examiner)
    except BeamstiffError as error:
        return Void(number, str(error))
    return record, None if examiner.reports is None else report


def check_results(path: Path) -> None:
    """Refuse, by the line that is none, a file that is there and holds no results of an exam."""
    if path.exists() and not is_device(path) and path.stat().st_size:
        _whole(path)


@contextmanager
def _resumed(results: Path | None, settings: dict[str, Any]) -> Iterator[tuple[dict[int, Any], Write]]:
    """Give what a file of results holds already, and a function that appends a line and sees it to the disk.

    The file is held meanwhile, and changed only once all of it is known to be this exam's.
    """
    if results is None:
        yield {}, lambda _: None
        return
    head = {"format": FORMAT, "exam": settings}
    target = target_of(results)
    remove_drafts(target.parent, target.name)
    if not target.exists():
        write_new(target, _line(head))
    busy = f"{results}: another exam is writing to it: wait until it ends, or choose another file"
    try:
        with ExitStack() as stack:
            number = stack.enter_context(nullcontext(None) if is_device(target) else held(target, busy))
            empty = number is not None and not target.stat().st_size
            items, size = ({}, 0) if number is None or empty else _taken_up(results, settings)
            file = stack.enter_context(target.open("r+b" if number is not None else "wb"))
            if number is not None:
                file.truncate(size)
                file.seek(size)

            def write(line: dict[str, Any]) -> None:
                file.write(_line(line).encode("utf-8"))
                file.flush()
                if number is not None:
                    os.fsync(file.fileno())

            if empty:
                write(head)
            yield items, write
    except OSError as error:
        raise BeamstiffError(f"{results}: cannot be written: {error.strerror or error}") from None


def _line(value: dict[str, Any]) -> str:
    return json.dumps(value, allow_nan=False) + "\n"


def _taken_up(results: Path, mine: dict[str, Any]) -> tuple[dict[int, Any], int]:
    """Return what a file holds of this exam, and how many bytes of it are whole lines."""
    settings, items, size = _whole(results)
    if settings != mine:
        other = next(name for name in (*mine, *settings) if settings.get(name) != mine.get(name))
        raise BeamstiffError(
            f"{results}: holds the results of another exam ({other}: {str(settings.get(other))[:60]} there, "
            f"{str(mine.get(other))[:60]} asked), expected a new file, or the same settings"
        )
    return items, size


def _whole(path: Path) -> tuple[dict[str, Any], dict[int, Any], int]:
    """Return the results of a file that holds nothing else, and how many bytes of it are whole lines."""
    read_text(path)
    data = path.read_bytes()
    size = data.rfind(b"\n") + 1
    tail = data[size:]
    if not size or not any(tail[: len(begin)] == begin[: len(tail)] for begin in _BEGINNINGS):
        _fail(path, data.count(b"\n") + 1, tail.decode("utf-8", "replace"))
    return *read_results(path, size), size


# how a line may begin that a kill cut short; the first is written in one step with its file
_BEGINNINGS = (b'{"sealed": ', b'{"record": ', b'{"void": ')


def _fail(path: Path, number: int, text: str) -> NoReturn:
    raise BeamstiffError(
        f"{path}:{number}: found {text[:40]!r}, expected a line of the results of an exam ({FORMAT})"
    ) from None


def read_results(path: Path, size: int | None = None) -> tuple[dict[str, Any], dict[int, Any]]:
    """Return the settings of a file of results, and its records and void cases by case."""
    settings: dict[str, Any] = {}
    items: dict[int, Any] = {}
    whole = read_text(path) if size is None else path.read_bytes()[:size].decode("utf-8-sig")
    for number, text in enumerate(whole.splitlines(), start=1):
        try:
            line = json.loads(text)
            if number == 1:
                if line["format"] != FORMAT:
                    raise KeyError
                settings = line["exam"]
            elif "record" in line:
                procedure: Procedure[Any] = CROWDED if "crowded" in settings else SINGLE
                record = procedure.record_from(line["record"])
                items[record.label.case] = record
            elif "void" in line:
                items[line["void"]] = Void(line["void"], line["why"])
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            _fail(path, number, text)
    return settings, items
