"""The verdict that a result begins with: a headline coloured by gap over noise, the data, the next action."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from rich.text import Text

from beamstiff.errors import listed
from beamstiff.measure.table import Measurements
from beamstiff.report.tables import counted

Level = Literal["agrees", "doubtful", "differs", "plain"]

BEYOND_NOISE = 1.5  # times the noise: from a dozen rows on no chance any more
NOTHING = 1e-6  # mm: no instrument reads it
FAR_BEYOND = 5.0  # times the noise: noise hardly adds to such a gap
BADGES: dict[Level, str] = {
    "agrees": "within noise",
    "doubtful": "beyond noise",
    "differs": "far beyond noise",
}
COLOURS: dict[Level, str] = {"agrees": "green", "doubtful": "yellow", "differs": "red", "plain": ""}


@dataclass(frozen=True)
class Verdict:
    """What a reader sees first."""

    headline: str  # the answer in a line
    level: Level = "plain"  # green, amber or red; plain where nothing is judged
    data: str = ""  # which files, how many rows
    action: str = ""  # the one thing to do next

    @property
    def badge(self) -> str:
        """What the colour means, in words; empty where nothing is judged."""
        return BADGES.get(self.level, "")

    def lines(self) -> Iterator[Text]:
        """Yield what a terminal shows of it, an empty line last."""
        yield Text(self.headline, style=f"bold {COLOURS[self.level]}".strip())
        if self.data:
            yield Text(f"Data: {self.data}.")
        if self.action:
            yield Text(f"Next: {self.action}")
        yield Text("")


def level_of(ratio: float) -> Level:
    """Return the level of a gap that is so many times the noise."""
    if ratio <= BEYOND_NOISE:
        return "agrees"
    return "doubtful" if ratio <= FAR_BEYOND else "differs"


def data_of(rows: Measurements) -> str:
    """Return, in words, which files were read, and how many rows and poses they hold."""
    files = listed([Path(source).name for source in rows.sources], 3)
    return f"{files}, {counted(len(rows), 'row')} at {counted(len(np.unique(rows.q, axis=0)), 'posture')}"


def rounded(value: float) -> str:
    """Return a positive number with two digits, without a power of ten; less than 1e-6 is rounding.

    Examples
    --------
    >>> rounded(0.0704), rounded(0.4149), rounded(12.4), rounded(0.0), rounded(4.5e-15)
    ('0.070', '0.41', '12', '0', '0')
    """
    if 0.0 <= value < NOTHING:
        return "0"
    if not 0.0 < value < np.inf:
        return f"{value:g}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(value))))}f}"
