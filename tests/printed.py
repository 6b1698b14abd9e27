"""Whether a program prints what a page shows, on any machine: last digits may be others.

Iterations end a little elsewhere where products are rounded in another order.
"""

import re

# numbers that were rounded; others are counts, names and versions
ROUNDED = r"(?<![\d.])-?\d+(?:\.\d+(?![\d.]*\d)|(?=\s+%|\s+to\s+\d+\s+%))"
UNITS, SHARE = 1.001, 0.005  # of the last digit, of the number


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
    digit = UNITS * 10.0 ** -len(number.partition(".")[2])
    near = abs(float(number) - float(other)) <= max(digit, SHARE * abs(float(number)))
    return near and not (other.startswith("-") and float(other) == 0.0)


def _like(number: str) -> str:
    """Return a pattern of numbers with as many decimals."""
    decimals = len(number.partition(".")[2])
    return rf"(-?\d+\.\d{{{decimals}}})(?!\d)" if decimals else r"(-?\d+)"


def _plain(text: str) -> str:
    return r"\s+".join(re.escape(word) for word in re.split(r"\s+", text))
