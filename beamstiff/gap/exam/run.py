"""Runs an exam: any number of processes, results line by line in a file, taken up again after a break."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from beamstiff.errors import BeamstiffError
from beamstiff.files import read_text
from beamstiff.gap.exam.blind import Examiner, examine
from beamstiff.gap.exam.cases import Case, Exam, draw_case
from beamstiff.gap.exam.record import Record, record_from

FORMAT = "beamstiff-exam/1"
AHEAD = 2  # cases given out for each process before the first of them is back


@dataclass(frozen=True)
class Void:
    """A case that the simulator could not make; it counts nowhere.

    Attributes
    ----------
    case : int
    why : str
    """

    case: int
    why: str


def run_exam(
    exam: Exam,
    count: int,
    examiner: Examiner,
    *,
    processes: int = 1,
    results: Path | None = None,
    progress: Callable[[Record | Void], None] = lambda _: None,
) -> list[Record]:
    """Return the records of cases 0 to `count` - 1, in their order.

    With `results`, a file of JSON lines: first the exam's settings, then for every case its seal (SHA-256
    of the label) before it is given out, and its record once it is opened. Cases whose record is there
    already are not examined again; a line that an interruption cut short is taken off.

    Parameters
    ----------
    exam : Exam
    count : int
    examiner : Examiner
        With several processes it is pickled: its functions are those of modules.
    processes : int
    results : path, optional
    progress : function of Record or Void
        Called after every case, those of the file included.

    Raises
    ------
    BeamstiffError
        When `results` is another exam's or cannot be written, or a number is not positive.
    """
    if count < 1 or processes < 1:
        raise BeamstiffError(
            f"exam: found {count} cases and {processes} processes, expected 1 or more of each"
        )
    done = {} if results is None else _resume(results, exam)
    found: dict[int, Record | Void] = {case: item for case, item in done.items() if case < count}
    for item in found.values():
        progress(item)
    with _writer(results) as write:
        if results is not None and not results.stat().st_size:
            write({"format": FORMAT, "exam": exam.settings()})
        missing = (case for case in range(count) if case not in found)
        for case, item in _examined(exam, missing, examiner, processes, write):
            write(
                {"void": item.case, "why": item.why} if isinstance(item, Void) else {"record": item.to_dict()}
            )
            found[case] = item
            progress(item)
    return [item for _, item in sorted(found.items()) if isinstance(item, Record)]


def read_results(path: Path) -> tuple[dict[str, Any], list[Record]]:
    """Return the settings and the records of a file of results, by case.

    Raises
    ------
    BeamstiffError
        When it is no such file.
    """
    settings, items = _read(path)
    return settings, [item for _, item in sorted(items.items()) if isinstance(item, Record)]


Write = Callable[[dict[str, Any]], None]


def _examined(
    exam: Exam, cases: Iterable[int], examiner: Examiner, processes: int, write: Write
) -> Iterator[tuple[int, Record | Void]]:
    if processes == 1:
        for case in cases:
            drawn = _draw(exam, case)
            _seal(drawn, write)
            yield case, _one(exam, examiner, drawn)
        return
    before = set(multiprocessing.active_children())
    left = iter(cases)
    drawing: set[Future[Case | Void]] = set()
    answering: dict[Future[Record | Void], int] = {}
    with _one_thread_each():
        pool = ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))
        try:
            while True:
                for case in islice(left, AHEAD * processes - len(drawing) - len(answering)):
                    drawing.add(pool.submit(_draw, exam, case))
                if not drawing and not answering:
                    break
                either: list[Future[Any]] = [*drawing, *answering]
                done = wait(either, return_when=FIRST_COMPLETED).done
                for ready in [future for future in drawing if future in done]:
                    drawing.remove(ready)
                    drawn = ready.result()
                    _seal(drawn, write)
                    answering[pool.submit(_one, exam, examiner, drawn)] = _number(drawn)
                for answered in [future for future in answering if future in done]:
                    yield answering.pop(answered), answered.result()
            pool.shutdown()
        except BaseException:  # Ctrl-C too: nobody waits for cases that are not wanted any more
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(multiprocessing.active_children()) - before:
                child.terminate()
            raise


def _draw(exam: Exam, case: int) -> Case | Void:
    try:
        return draw_case(exam, case)
    except BeamstiffError as error:
        return Void(case, str(error))


def _number(drawn: Case | Void) -> int:
    return drawn.case if isinstance(drawn, Void) else drawn.label.case


def _seal(drawn: Case | Void, write: Write) -> None:
    """Write a case's seal before anybody is given the case."""
    if not isinstance(drawn, Void):
        write({"sealed": drawn.label.case, "label_sha256": drawn.label.digest()})


def _one(exam: Exam, examiner: Examiner, drawn: Case | Void) -> Record | Void:
    if isinstance(drawn, Void):
        return drawn
    try:
        return examine(exam, drawn.label.case, examiner, drawn)
    except BeamstiffError as error:
        return Void(drawn.label.case, str(error))


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that start meanwhile calculate on one thread: they share the machine already."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    old = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in old.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _writer(results: Path | None) -> Iterator[Write]:
    """Give a function that appends a line to the file and sees it onto the disk; nothing without a file."""
    if results is None:
        yield lambda _: None
        return
    try:
        file = results.open("ab")
    except OSError as error:
        raise BeamstiffError(f"{results}: cannot be written: {error.strerror or error}") from None
    with file:

        def write(line: dict[str, Any]) -> None:
            file.write(json.dumps(line, allow_nan=False).encode("utf-8") + b"\n")
            file.flush()
            os.fsync(file.fileno())

        yield write


def _resume(results: Path, exam: Exam) -> dict[int, Record | Void]:
    """Return what a file of results holds already, after a line that is not whole was cut off its end."""
    if not results.exists() or not results.stat().st_size:
        return {}
    try:
        data = results.read_bytes()
        if not data.endswith(b"\n"):
            with results.open("r+b") as file:
                file.truncate(data.rfind(b"\n") + 1)
    except OSError as error:
        raise BeamstiffError(f"{results}: cannot be read: {error.strerror or error}") from None
    if b"\n" not in data:
        return {}
    settings, items = _read(results)
    mine = exam.settings()
    if settings != mine:
        other = next(name for name in mine if settings.get(name) != mine[name])
        raise BeamstiffError(
            f"{results}: holds the results of another exam ({other}: {str(settings.get(other))[:60]} there, "
            f"{str(mine[other])[:60]} asked), expected a new file, or the same settings"
        )
    return items


def _read(path: Path) -> tuple[dict[str, Any], dict[int, Record | Void]]:
    settings: dict[str, Any] = {}
    items: dict[int, Record | Void] = {}
    for number, text in enumerate(read_text(path).splitlines(), start=1):
        try:
            line = json.loads(text)
            if number == 1:
                if line["format"] != FORMAT:
                    raise KeyError
                settings = line["exam"]
            elif "record" in line:
                record = record_from(line["record"])
                items[record.label.case] = record
            elif "void" in line:
                items[line["void"]] = Void(line["void"], line["why"])
        except (ValueError, KeyError, TypeError):
            raise BeamstiffError(
                f"{path}:{number}: found {text[:40]!r}, expected a line of the results of an exam ({FORMAT})"
            ) from None
    return settings, items
