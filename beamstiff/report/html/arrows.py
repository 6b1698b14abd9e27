"""A load as arrows: its force, and its moment, at the point where it acts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from beamstiff.report.html.parts import numbers
from beamstiff.report.tables import number
from beamstiff.se3 import Array

HEAD = 0.28  # of an arrow
MOMENT = 0.7  # of a force's arrow


@dataclass(frozen=True)
class Arrows:
    """Arrows from a point: their vectors (n, 3), and what each is."""

    origin: Array
    vectors: Array
    texts: tuple[str, ...]

    def lines(self, moved: Array) -> dict[str, Any]:
        """Return the shafts, with a gap after each, as a trace that moves along."""
        points = [[self.origin, self.origin + 0.9 * one, np.full(3, np.nan)] for one in self.vectors]
        at = np.array(points).reshape(-1, 3)
        return {
            **{name: numbers(at[:, k]) for k, name in enumerate("xyz")},
            **{f"d{name}": value for name, value in zip("xyz", numbers(moved), strict=True)},
            "hovertext": [text for text in self.texts for _ in range(3)],
        }

    def heads(self, moved: Array) -> dict[str, Any]:
        """Return the heads as cones that move along."""
        tips = self.origin + self.vectors
        return {
            **{name: numbers(tips[:, k]) for k, name in enumerate("xyz")},
            **{name: numbers(HEAD * self.vectors[:, k]) for k, name in enumerate("uvw")},
            **{f"d{name}": value for name, value in zip("xyz", numbers(moved), strict=True)},
        }


def force_and_moment(wrench: Array, origin: Array, length: float) -> Arrows:
    """Return the arrows of a wrench (6,) at a point: as long as told, whatever its size.

    The moment's is shorter; what does not act has no arrow.
    """
    vectors, texts = [], []
    for part, what, unit, long in (
        (wrench[:3], "force", "N", length),
        (wrench[3:], "moment", "N m", MOMENT * length),
    ):
        size = float(np.linalg.norm(part))
        if size > 0.0:
            vectors.append(long * part / size)
            texts.append(f"{what} {number(size)} {unit}")
    return Arrows(origin, np.array(vectors).reshape(-1, 3), tuple(texts))
