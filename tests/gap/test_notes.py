from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff.gap.library import Library
from beamstiff.gap.notes import notes
from beamstiff.gap.screening import Screened, screen
from beamstiff.gap.whitened import whiten
from tests.gap.machines import POSITION, ROTATION, at_random, elbow, nominal, rows_of

SILENCE = Library((), ())


def said(
    noise: tuple[float, float] = (1.0, 1.0),
    outliers: int = 0,
    verdict: str = "none",
    scale: float = 1.0,
    q: Any = None,
    wrench: Any = None,
    **more: Any,
) -> str:
    """Return the notes of a sound campaign of ten postures, changed in one thing."""
    rows = at_random(elbow(), 10, seed=1)
    columns = {"sigma_position": POSITION, "sigma_rotation": ROTATION} | more
    rows = rows_of(elbow(), rows.q if q is None else q, rows.wrench if wrench is None else wrench, **columns)
    there = nominal(elbow(), rows)
    found = replace(
        screen(there, SILENCE), noise=np.array(noise), outliers=np.arange(outliers, dtype=np.intp)
    )
    assert isinstance(found, Screened)
    return "\n".join(notes(found, whiten(there), verdict, scale))


def test_a_sound_campaign_needs_no_note() -> None:
    assert said() == ""


@pytest.mark.parametrize(
    ("changed", "note"),
    [
        ({"wrench": np.eye(6)[1:4] * 500}, "only 16 values beyond those fitted: no confident verdict"),
        ({"q": np.zeros(2)}, "only 1 posture: "),
        ({"sigma_position": None, "sigma_rotation": None}, "states no noise"),
        ({"noise": (2.1, 1.0)}, "the noise of the positions looks 2.1 times what the table claims"),
        ({"noise": (1.0, 0.5)}, "the noise of the rotations looks 0.5 times what the table claims"),
        ({"wrench": np.zeros((10, 6))}, "no row carries a load"),
        ({"wrench": np.linspace(1, 2, 10)[:, None] * np.eye(6)[1] * 500}, "do not span all directions"),
        ({"wrench": np.tile(np.eye(6)[:3], (4, 1))[:10] * 500}, "one load level only"),
        ({"scale": 1.8}, "the fit leaves 1.8 times the noise counted with"),
        ({"outliers": 1}, "1 row that nothing explains left out"),
        ({"outliers": 3}, "3 rows that nothing explains left out"),
    ],
)
def test_what_limits_the_conclusions_is_said_in_a_line(changed: dict[str, Any], note: str) -> None:
    q = changed.pop("q", None)
    if q is None and len(changed.get("wrench", range(10))) != 10:
        q = at_random(elbow(), 3, seed=1).q
    lines = said(q=q, **changed).splitlines()
    assert sum(note in line for line in lines) == 1
    assert all(len(line) < 160 for line in lines)


def test_a_cause_that_was_named_says_itself_what_it_leaves() -> None:
    assert said(verdict="backlash", scale=1.8) == ""
    assert said(verdict="none", scale=1.4) == ""
