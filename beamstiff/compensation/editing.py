"""Numbers replaced in a text, all else byte for byte as it was.

Files are taken as Latin-1, in which every byte is a character and back: no encoding, line end or stray byte
is lost. A number keeps its sign of plus, its leading zeros, its exponent and its decimals, and gets more of
these only where the change would not fit into them.
"""

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from pathlib import Path

from beamstiff.errors import BeamstiffError
from beamstiff.files import read_data

ENCODING = "latin-1"
NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
UNCHANGED = 1e-3  # of the last decimal needed: what is rounding of the way there and back
LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n|\Z)")

_PARTS = re.compile(
    r"(?P<sign>[+-]?)(?P<whole>[0-9]*)(?P<point>\.?)(?P<decimals>[0-9]*)"
    r"(?:(?P<e>[eE])(?P<esign>[+-]?)(?P<exponent>[0-9]+))?"
)


@dataclass(frozen=True)
class Slot:
    """A number in a text."""

    start: int  # where it stands
    text: str
    unit: float  # what 1 is in SI
    decimals: int  # that a corrected number needs at least, in the unit of the file

    @property
    def end(self) -> int:
        """Where the text after it begins."""
        return self.start + len(self.text)

    @property
    def value(self) -> float:
        """The number in SI."""
        inverse = round(1 / self.unit) if self.unit < 1 else 0
        number = float(self.text)
        return number / inverse if inverse and inverse * self.unit == 1.0 else number * self.unit


def read_bytes(path: str | Path) -> str:
    """Return a file as text of which every byte is a character."""
    data = read_data(path)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in data:
        raise BeamstiffError(f"{path}: found UTF-16 or binary data, expected a text of one byte a character")
    if not data.strip():
        raise BeamstiffError(f"{path}: is empty, expected a robot file, a table or a program")
    return data.decode(ENCODING)


def proper(text: str) -> str:
    r"""Return text of a file as people wrote it: as UTF-8 where it is that, else as Latin-1.

    >>> proper("\xc3\xa4"), proper("\xe4")
    ('ä', 'ä')
    """
    try:
        return text.encode(ENCODING).decode("utf-8")
    except UnicodeDecodeError:
        return text


def line_of(text: str, at: int) -> int:
    """Return the line, from 1, of a place in a text."""
    return bisect_right(_line_starts(text), at)


@lru_cache(maxsize=4)
def _line_starts(text: str) -> list[int]:
    return [0, *(match.end() for match in re.finditer(r"\r\n|\r|\n", text))]


def rewritten(text: str, value: float, decimals: int) -> str:
    """Return a number in the form of another `text`, with the decimals that it needs or had, if more."""
    parts = _PARTS.fullmatch(text)
    if parts is None:
        raise ValueError(text)
    if abs(value - float(text)) <= UNCHANGED * 10.0**-decimals:
        return text
    if parts["e"]:
        new = _with_exponent(parts, value, decimals)
    else:
        number = f"{Decimal(abs(value)):.{max(decimals, len(parts['decimals']))}f}"
        new = _signed(parts, number, value)
    return text if Decimal(new) == Decimal(text) else new


def _with_exponent(parts: re.Match[str], value: float, decimals: int) -> str:
    power = Decimal(abs(value)).adjusted() if value else 0
    digits = max(decimals + power, len(parts["decimals"]), 0)
    mantissa, exponent = f"{Decimal(abs(value)):.{digits}e}".split("e")
    power = int(exponent)
    sign = "-" if power < 0 else "+" if parts["esign"] else ""
    tail = f"{parts['e']}{sign}{abs(power):0{len(parts['exponent'])}d}"
    return _signed(parts, mantissa, value) + tail


def _signed(parts: re.Match[str], number: str, value: float) -> str:
    """Return digits with the sign and the zeros in front that the number had."""
    whole, point, rest = number.partition(".")
    if not parts["whole"] and whole == "0" and rest:
        whole = ""
    elif len(parts["whole"]) > 1 and parts["whole"].startswith("0"):
        whole = whole.zfill(len(parts["whole"]))
    digits = whole + (point or (parts["point"] if not rest else "")) + rest
    negative = value < 0 and any(digit not in "0." for digit in digits)
    return ("-" if negative else "+" if parts["sign"] == "+" else "") + digits


def replaced(text: str, changes: Iterable[tuple[Slot, float]]) -> str:
    """Return a text with new values, SI, of numbers; one aligned by blanks grows into them, but for one."""
    parts, at = [], 0
    for slot, value in sorted(changes, key=lambda change: change[0].start):
        new = rewritten(slot.text, value / slot.unit, slot.decimals)
        start = slot.start
        grown = len(new) - len(slot.text)
        if new != slot.text and text[max(start - 2, at) : start] == "  ":
            blanks = len(text[at:start]) - len(text[at:start].rstrip(" "))
            if grown > 0:
                start -= min(grown, blanks - 1)
            else:
                new = " " * -grown + new
        parts += [text[at:start], new]
        at = slot.end
    return "".join([*parts, text[at:]])


def masked(text: str, comment: str) -> str:
    r"""Return the text with comments, from a mark to the end of the line, and ``"strings"`` made blank.

    >>> masked('p "a;b" 1 ; not 2\nq', ";")
    'p       1        \nq'
    """
    pattern = re.compile(rf'"[^"\r\n]*"?|{re.escape(comment)}[^\r\n]*')
    return pattern.sub(lambda found: " " * len(found[0]), text)


def lines(text: str) -> Iterator[tuple[int, int, str]]:
    """Yield number, place and text of every line, without its end."""
    at = 0
    for number, match in enumerate(LINE.finditer(text), start=1):
        if match[0]:
            yield number, at, match[0].rstrip("\r\n")
        at = match.end()
