"""Whether a program prints what a page shows, on any machine: the last digit may be another one."""

from __future__ import annotations

import re

# numbers that were rounded; others are counts, names and versions
ROUNDED = r"(?<![\d.])-?\d+(?:\.\d+(?![\d.]*\d)|(?=\s+%|\s+to\s+\d+\s+%))"
UNITS = 1.001  # of the last digit


def prints(shown: str, printed: str) -> bool:
    """Return whether a text is what is shown, in which ``...`` stands for anything and all space is alike."""
    parts = [re.split(f"({ROUNDED})", part) for part in shown.split("...")]
    pattern = ".*?".join(
        "".join(_like(text) if at % 2 else _plain(text) for at, text in enumerate(part)) for part in parts
    )
    found = re.fullmatch(rf"\s*{pattern}\s*", printed, re.DOTALL)
    wanted = [number for part in parts for number in part[1::2]]
    return found is not None and all(map(_near, wanted, found.groups()))


def _near(number: str, other: str) -> bool:
    near = abs(float(number) - float(other)) <= UNITS * 10.0 ** -len(number.partition(".")[2])
    return near and not (other.startswith("-") and float(other) == 0.0)


def _like(number: str) -> str:
    """Return a pattern of numbers with as many decimals."""
    decimals = len(number.partition(".")[2])
    return rf"(-?\d+\.\d{{{decimals}}})(?!\d)" if decimals else r"(-?\d+)"


def _plain(text: str) -> str:
    return r"\s+".join(re.escape(word) for word in re.split(r"\s+", text))
