"""What commands print and write: tables for people, JSON for programs, messages on stderr."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console

from beamstiff.errors import BeamstiffError, optional
from beamstiff.files import check_writable, target_of
from beamstiff.outputs import check_distinct, check_replaceable, write_output
from beamstiff.stages import LISTENER

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from beamstiff.robot.description import Robot

STDOUT = "-"
TYPED: ContextVar[Sequence[str]] = ContextVar("TYPED", default=())  # the words of the command
JSON: ContextVar[str | None] = ContextVar("JSON", default=None)  # where --json goes
QUIET: ContextVar[bool] = ContextVar("QUIET", default=False)
WRITTEN: ContextVar[list[str]] = ContextVar("WRITTEN")  # what is to be said of files, at the command's end
PIPE_WIDTH = 200  # columns where there is no terminal to fit into


def people() -> Console:
    """Return the console for people's tables: silent when they asked for quiet, or stdout is for JSON."""
    quiet = QUIET.get() or JSON.get() == STDOUT
    console = _console(quiet=quiet)
    return console if console.is_terminal else _console(quiet=quiet, width=PIPE_WIDTH)


def say(message: str, quiet: bool = False) -> None:
    """Print one line on stderr, its beginning up to the colon in red where a terminal shows colours."""
    line = str(BeamstiffError(message))  # one line, no control characters
    head, colon, rest = line.partition(":")
    console = _console(quiet=quiet, stderr=True)
    console.print(f"{head}{colon}", style="red" if colon else None, end="", soft_wrap=True)
    console.print(rest, soft_wrap=True)


def note(message: str) -> None:
    """Print a note on stderr, unless they asked for quiet."""
    say(f"note: {message}", QUIET.get())


def write(path: str, content: str | bytes, holds: str = "", *, as_it_is: bool = False) -> None:
    """Write an output as `write_output`, and say so, and what it `holds`, when the command ends."""
    write_output(path, content, as_it_is=as_it_is)
    written(path, holds)


def write_robot(
    path: str, robot: Robot, source: Path, std: Mapping[str, float], head: str, holds: str = ""
) -> None:
    """Write a robot as YAML with lines `head`, or as the path's ending says, and note what that loses."""
    from beamstiff.functions.convert import applied_text
    from beamstiff.robot.yaml_edit import robot_yaml

    if simulator := for_simulators(path):
        text, lost = applied_text(robot, path, source)
        for item in lost:
            note(item)
    else:
        text = robot_yaml(robot, source, std, head)
    write(path, text, holds, as_it_is=simulator)


def for_simulators(path: str) -> bool:
    """Return whether a robot's file is one that other programs read."""
    return Path(path).suffix.lower() in (".xml", ".urdf", ".sdf")


def written(path: str, holds: str = "") -> None:
    """Remember an output, of which people are told behind the result."""
    WRITTEN.get().append(f"written: {path} ({holds})" if holds else f"written: {path}")


@contextmanager
def files_last() -> Iterator[None]:
    """Say which files a command has written when it ends, in whatever way."""
    WRITTEN.set([])
    try:
        yield
    finally:
        for line in WRITTEN.get():
            people().print(line, soft_wrap=True)


@contextmanager
def working(what: str, still: bool = False) -> Iterator[None]:
    """Show on stderr what long work is at, if it is a terminal; numbers that overflow are bad input.

    `what`: the work, such as "identifying". `still`: show nothing, since the work shows itself.
    """
    import numpy as np

    console = _console(quiet=QUIET.get(), stderr=True)
    try:
        with (
            console.status(f"{what} ...") if console.is_terminal and not still else nullcontext() as status,
            np.errstate(over="raise"),
        ):
            tell = None if status is None else lambda name: status.update(f"{what}: {name} ...")
            heard = LISTENER.set(tell)
            try:
                yield
            finally:
                LISTENER.reset(heard)
    except (FloatingPointError, OverflowError) as error:  # numpy's, and Python's own
        raise BeamstiffError(
            f"{what}: numbers out of range ({error}), expected lengths, loads and stiffness of a real "
            "machine; check their units"
        ) from None


@contextmanager
def progress(
    what: str, *columns: str, total: float | None, live: bool = True, **fields: Any
) -> Iterator[Callable[..., None] | None]:
    """Yield what moves a bar on stderr (`completed`, `advance`, `total`); None where it is no terminal.

    `columns`: what stands behind the bar: names of columns of rich, or texts. `live`: drawn by a thread; else
    when there is news, since a thread keeps processes from beginning as copies.
    """
    from rich import progress as parts

    console = Console(stderr=True)
    if QUIET.get() or not console.is_terminal:
        yield None
        return
    behind = [getattr(parts, one)() if one.endswith("Column") else parts.TextColumn(one) for one in columns]
    bar = parts.Progress(
        *(parts.TextColumn(what), parts.BarColumn(), *behind),
        console=console,
        transient=True,
        auto_refresh=live,
    )
    with bar:
        task = bar.add_task(what, total=total, **fields)
        yield lambda **news: bar.update(task, refresh=not live, **news)


DRAWINGS = ("figure", "recursion", "rules", "sensitivity")  # options of pictures


class Outputs:
    """What a command prints and writes: checked before any work, then its result and what goes beside it.

    The one rule for all commands: an output never falls on an input or on another output, and replaces
    nothing but a file that beamstiff wrote and nobody has edited since (see `beamstiff.outputs`).

    `inputs`: files that the command reads. `elsewhere`: outputs that are checked elsewhere for what they
    replace, by what to call them. `files`: the output files beside --json by the name of their option;
    ``html`` among them is the report. `seed`: that the report states.
    """

    def __init__(
        self,
        inputs: Sequence[str | Path],
        *,
        seed: int = 0,
        elsewhere: Mapping[str, str] | None = None,
        **files: str | None,
    ) -> None:
        wanted = {"json": None if JSON.get() == STDOUT else JSON.get(), **files}
        named = {f"--{option.replace('_', '-')}": path for option, path in wanted.items() if path is not None}
        for option, path in named.items():
            if path == STDOUT:
                raise BeamstiffError(f"{option}: found -, expected the name of a file")
            target_of(path)
        check_distinct(inputs, {**named, **(elsewhere or {})})
        for option, path in named.items():
            try:
                check_replaceable(path)
            except BeamstiffError as error:
                raise BeamstiffError(f"{option} {error}") from None
            check_writable(path)
        for path in filter(None, map(files.get, DRAWINGS)):
            from beamstiff.report.figures import check_format

            check_format(path)
        self.files, self._source = files, None
        self.console = people()
        if files.get("html") is not None:
            from beamstiff.report.html.provenance import provenance

            self._source = provenance(inputs, seed, TYPED.get())

    def result(self, notes: Iterable[str], shown: Iterable[RenderableType], told: Mapping[str, Any]) -> None:
        """Say the notes, print tables and sentences, write the JSON."""
        for text in notes:
            note(text)
        for part in shown:
            self.console.print(part)
        if (path := JSON.get()) == STDOUT:
            sys.stdout.write(f"{json_text(told)}\n")
            sys.stdout.flush()
        elif path is not None:
            write(path, f"{json_text(told)}\n")

    def draw(self, option: str, figure: Callable[[], Figure]) -> None:
        """Write a picture, if the option asks for it."""
        if (path := self.files[option]) is not None:
            from beamstiff.report.figures import figure_bytes

            with optional(path if option != "rules" else f"--rules {path}", note):
                write(path, figure_bytes(figure(), path))

    def page(self, name: str, *given: Any, **more: Any) -> None:
        """Write the report that `report.html` makes under this name, if one was asked for."""
        path = self.files["html"]
        if path is not None and self._source is not None:
            make = getattr(import_module(f"beamstiff.report.html.{name}"), f"{name}_html")  # takes its time
            with optional(path, note):
                write(path, make(*given, provenance=self._source, **more))


def json_text(value: Any, indent: int = 0) -> str:
    """Return JSON with one line a row of numbers; NaN and infinity are refused."""
    listed = isinstance(value, list | tuple)
    flat = listed and not any(isinstance(item, dict | list | tuple) for item in value)
    if not isinstance(value, dict | list | tuple) or not value or flat:
        return json.dumps(value, allow_nan=False)
    named, margin = isinstance(value, dict), " " * (indent + 2)
    heads = [f"{margin}{json.dumps(str(key))}: " for key in value] if named else [margin] * len(value)
    items = list(value.values() if isinstance(value, dict) else value)
    lines = [head + json_text(item, indent + 2) for head, item in zip(heads, items, strict=True)]
    opening, closing = "{}" if named else "[]"
    return f"{opening}\n" + ",\n".join(lines) + f"\n{' ' * indent}{closing}"


class _Console(Console):
    """A console whose reader may go away (``| head``): the command goes on, its files are written."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        silence(sys.stderr if self.stderr else sys.stdout)


def silence(stream: TextIO) -> None:
    """Send nowhere what a stream still holds, and what comes."""
    with suppress(OSError, ValueError):  # a stream of a test has no descriptor
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _console(quiet: bool, stderr: bool = False, width: int | None = None) -> Console:
    # names from files are printed as they are: no markup, no emoji codes, no guessed colours
    return _Console(stderr=stderr, quiet=quiet, width=width, markup=False, emoji=False, highlight=False)
