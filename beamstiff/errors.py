"""The one error type that users of beamstiff see, and the hints it carries."""

import difflib
import reprlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice

_MOST_COMPARED = 1000
_LONGEST_NAME = 200  # characters, as of a name in a robot; a line of a file may have millions


class BeamstiffError(ValueError):
    """Input that cannot be used, said in one line.

    The message names the file, the key or row, what was found and what would be right. The command line
    prints it on stderr and exits with 2; it never comes with a traceback.

    Examples
    --------
    >>> raise BeamstiffError(
    ...     "ir663.yaml:12: joints[0].stiffness: found 'stiff', expected a number, rigid or free"
    ... )
    Traceback (most recent call last):
    ...
    beamstiff.errors.BeamstiffError: ir663.yaml:12: joints[0].stiffness: found 'stiff', expected ...
    """

    def __init__(self, message: str) -> None:
        line = " ".join(str(message).split())
        # a key may hold a terminal's control characters; none of them reaches the terminal
        super().__init__("".join(c if c.isprintable() else repr(c)[1:-1] for c in line))


class OptionError(BeamstiffError):
    """An option of a function that cannot be used; the command line calls it by its own name for it.

    `what`: what was found, and what would be right.

    >>> str(OptionError("folds", "found 1, expected 2 or more"))
    'folds: found 1, expected 2 or more'
    """

    def __init__(self, option: str, what: str) -> None:
        super().__init__(f"{option}: {what}")
        self.option, self.what = option, what


class UnusableError(BeamstiffError):
    """Readings that tell nothing of the machine; the message says all there is to say."""


class UnwritableError(BeamstiffError):
    """A file that cannot be written: no folder, no right, no room on the disk."""


@contextmanager
def optional(what: str, note: Callable[[str], object]) -> Iterator[None]:
    """Run a step that a finished result can do without: where it fails, that becomes a note.

    A file that cannot be written stays an error, and so does any other exception.

    `what`: what is missing then, such as "the figure". `note`: takes the note.

    >>> with optional("the figure", print):
    ...     raise BeamstiffError("robot.yaml: loop_1 does not close")
    the figure is skipped: robot.yaml: loop_1 does not close
    """
    try:
        yield
    except UnwritableError:
        raise
    except BeamstiffError as error:
        note(f"{what} is skipped: {error}")


def suggest(name: object, candidates: Iterable[str]) -> str:
    """Return a hint with the closest of `candidates`, or an empty string when none is close.

    >>> suggest("tosional", ["axial", "torsional"])
    " (did you mean 'torsional'?)"
    >>> suggest("TCP", ["tcp", "fixed"])
    " (did you mean 'tcp'?)"
    >>> suggest("xyz", ["axial", "torsional"])
    ''
    """
    wanted = str(name)[:200].casefold()
    known = {candidate.casefold(): candidate for candidate in candidates}
    if len(known) > _MOST_COMPARED:  # comparing all of 50,000 node names would take seconds
        near = (folded for folded in known if _differs_in_one_place(wanted, folded))
        known = {folded: known[folded] for folded in islice(near, _MOST_COMPARED)}
    close = difflib.get_close_matches(wanted, known, n=1, cutoff=0.6)
    return f" (did you mean '{known[close[0]]}'?)" if close else ""


def _differs_in_one_place(one: str, other: str) -> bool:
    """Tell whether two texts are alike but for at most two characters side by side."""
    if abs(len(one) - len(other)) > 1:
        return False
    shorter = min(len(one), len(other))
    head = next((at for at in range(shorter) if one[at] != other[at]), shorter)
    tail = next((at for at in range(shorter - head) if one[-1 - at] != other[-1 - at]), shorter - head)
    return shorter - head - tail <= 2


def listed(names: Iterable[str], most: int = 8) -> str:
    """Return names joined by commas, cut after `most` of them, and each when long, for use in a message.

    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    names = [name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 3]}..." for name in names]
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def counted(count: int, what: str) -> str:
    """Return a number of things.

    >>> counted(1, "test"), counted(12, "pose")
    ('1 test', '12 poses')
    """
    return f"{count} {what}{'' if count == 1 else 's'}"


class _Short(reprlib.Repr):
    """`repr` that looks at the first few entries only, so that a huge value costs no time."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxdict, self.maxlist, self.maxtuple = 3, 6, 6, 6
        self.maxstring, self.maxother = 60, 60

    def repr_int(self, value: int, level: int) -> str:  # noqa: ARG002 (reprlib's)
        """Return a whole number; Python refuses to write those of thousands of digits."""
        return repr(value) if value.bit_length() < 200 else "a whole number of more than 60 digits"


def shown(value: object) -> str:
    """Return a value as a message shows it: as it was written, cut to some sixty characters, in one line.

    >>> shown("5 parsec"), shown(None), shown(True), shown([1, "a"])
    ("'5 parsec'", 'null', 'true', "[1, 'a']")
    """
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    text = _Short().repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
