"""Whether a program prints what a page shows, on any machine: the last digit may be another one."""

from __future__ import annotations

import re

ROUNDED = r"-?\d+(?:\.\d+|(?=\s+%))"  # numbers that were rounded; others are counts and names
UNITS = 1.001  # of the last digit


def prints(shown: str, printed: str) -> bool:
    """Return whether a text is what is shown, in which ``...`` stands for anything and all space is alike."""
    parts = [re.split(rf"({ROUNDED})", part) for part in re.split(r"\.\.\.", shown)]
    pattern = ".*?".join(
        "".join(f"({ROUNDED})" if at % 2 else _plain(text) for at, text in enumerate(part)) for part in parts
    )
    found = re.fullmatch(rf"\s*{pattern}\s*", printed, re.DOTALL)
    wanted = [number for part in parts for number in part[1::2]]
    return found is not None and all(
        abs(float(number) - float(other)) <= UNITS * 10.0 ** -len(number.partition(".")[2])
        for number, other in zip(wanted, found.groups(), strict=True)
    )


def _plain(text: str) -> str:
    return r"\s+".join(re.escape(word) for word in re.split(r"\s+", text))
