"""Figures of rows: what is drawn over the load, and what displacements of absolute positions are off."""

import numpy as np
import pytest

from beamstiff.measure.table import make_measurements
from beamstiff.report.html.rows import OFF_UNDEFORMED, Compared, row_figures
from beamstiff.robot.reader import load_robot


def compared(forces: list[float], kind: str = "displacement") -> Compared:
    """Return rows of a cantilever under forces along z, N, a residual each."""
    robot, count = load_robot("cantilever"), len(forces)
    wrench = np.zeros((count, 6))
    wrench[:, 2] = forces
    read = 1e-3 * np.random.default_rng(0).standard_normal((count, 6))
    seen = {"displacement": read} if kind == "displacement" else {"position": read[:, :3]}
    rows = make_measurements([], np.zeros((count, 0)), tcp=robot.tcp, wrench=wrench, **seen)
    return Compared(robot, rows, read, np.zeros((count, 6)), rows.measured_mask)


@pytest.mark.parametrize(
    ("forces", "drawn"),
    [
        ([-100.0, -200.0], {-100.0, -200.0}),
        ([-100.0, -200.0, 0.0], {-100.0, -200.0}),  # loads tell by themselves
        ([-100.0, -100.0, 0.0], {-100.0, 0.0}),  # of one load beside none
        ([-100.0, -100.0], set()),  # a vertical line
        ([0.0, 0.0], set()),
    ],
)
def test_over_the_load_there_are_two_loads_at_least(forces: list[float], drawn: set[float]) -> None:
    figures = row_figures(compared(forces))[0].figures
    over = [one for one in figures if one.key.startswith("residual-load")]
    assert {x for one in over for trace in one.traces for x in trace["x"]} == drawn


@pytest.mark.parametrize("kind", ["displacement", "absolute"])
def test_of_absolute_positions_the_table_says_what_displacements_are_off(kind: str) -> None:
    (rows,) = (one for one in row_figures(compared([-100.0, -200.0], kind)) if one.key == "rows")
    assert (OFF_UNDEFORMED in rows.texts) == (kind == "absolute")
