"""Displacements and joint values that no robot of that size and these limits has."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.errors import UnusableError
from beamstiff.measure.coerce import doubts_of
from beamstiff.measure.range_plausibility import require_displacements, require_limits
from beamstiff.robot.description import Robot
from tests.diagnosis.machines import at_random, kr240
from tests.measure.test_load_plausibility import pushed


@pytest.mark.parametrize(
    ("factor", "asked"),
    [
        (1e3, "is d[xyz] in um, and read in mm, or in mm, and read in m[?]"),
        (1e6, "is d[xyz] in um, and read in m[?]"),
    ],
)
def test_displacements_in_another_unit_are_refused_with_their_row(factor: float, asked: str) -> None:
    table = pushed("displacement")
    large = replace(table, displacement=factor * table.displacement)
    size = np.linalg.norm(large.displacement[:, :3], axis=1)
    place = table.place(int((size > 0.32).argmax()))  # a tenth of 3.2 m
    with pytest.raises(UnusableError, match=rf"^{place}: d[xyz]: the tool would have moved .*: {asked}$"):
        doubts_of(kr240(), [large])


def test_one_row_far_off_is_no_unit() -> None:
    table = pushed("displacement")
    moved = table.displacement.copy()
    moved[4, 2] = -1.5
    with pytest.raises(UnusableError, match=rf"^{table.place(4)}: dz: .* moved 1.5 m.* this row misread"):
        require_displacements(replace(table, displacement=moved), kr240())
    moved[4, 2] = -0.1  # a slip
    require_displacements(replace(table, displacement=moved), kr240())


@pytest.mark.parametrize("kind", ["displacement", "absolute"])
def test_degrees_read_in_radians_are_refused_by_the_limits(kind: str) -> None:
    table = pushed(kind)
    require_limits(table, kr240())
    asked = r"are the joint columns in degrees\? Write q\d \[deg\]"
    with pytest.raises(UnusableError, match=rf"^<arrays>:\d+: q\d: .* rad lies more than a turn.*{asked}"):
        doubts_of(kr240(), [replace(table, q=np.degrees(table.q))])


def test_limits_that_are_hardly_exceeded_or_unknown_refuse_nothing() -> None:
    table = at_random(kr240(), 20, seed=3)
    wound = table.q.copy()
    wound[:, 5] += 2 * np.pi
    require_limits(replace(table, q=wound), kr240())
    few = table.q.copy()
    few[:9] = np.degrees(few[:9])
    require_limits(replace(table, q=few), kr240())
    endless = [one.model_copy(update={"limits": None}) for one in kr240().variables]
    robot: Robot = kr240().model_copy(update={"variables": tuple(endless)})
    require_limits(replace(table, q=np.degrees(table.q)), robot)
