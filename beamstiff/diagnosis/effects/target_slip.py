"""`target-slip`: the reflector, or the tool, moves on the robot at some row and stays there.

From that row on the point is off by p, constant along the axes in which the robot file says where it sits.
Every row of a point is a possible moment, and a slip says nothing of other campaigns: the target is glued on
anew.
"""

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape
from beamstiff.diagnosis.effects.external import shift_alone
from beamstiff.diagnosis.residual.baseline import Baseline, nominal_pose
from beamstiff.measure.rows import history_order

SIZE = 5e-4  # m
SLIPS = tuple(Quantity(f"slip_{axis}", "m", SIZE, posture_specific=True) for axis in "xyz")
MOMENTS = 200  # at most, of one target: of longer campaigns every second, third, ... row is one
FEWEST = 3  # rows before a slip and after it: fewer are gross errors


def slip_row(shape: str) -> int:
    """Return the row (from 0) at which a shape's target slips.

    >>> slip_row("from row 54 on")
    54
    """
    return int(shape.split()[2])


def _components(baseline: Baseline) -> list[str | None]:
    if not baseline.absolute or baseline.stated is not None:
        return []
    robot, rows = baseline.nominal, baseline.fit.rows
    points, counts = np.unique(rows.point, return_counts=True)
    return [
        None if name == robot.tcp else str(name)
        for name, count in zip(points, counts, strict=True)
        if count >= 2 * FEWEST
    ]


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    rows, point = baseline.rows, component or baseline.nominal.tcp
    own = [row for row in history_order(rows).tolist() if rows.point[row] == point]
    moved = shift_alone(nominal_pose(baseline.nominal, rows, point)[1])
    after = np.zeros(len(rows))
    after[own[FEWEST:]] = 1.0
    shapes = []
    last = len(own) - FEWEST
    every = max(1, -(-(last - FEWEST) // MOMENTS))
    for at in range(FEWEST, last + 1):
        after[own[at - 1]] = 0.0
        if (at - FEWEST) % every == 0:
            shapes.append(
                Shape(f"from row {own[at]} on", moved * after[:, None, None], SLIPS, prior_factor=30.0)
            )
    return shapes


EFFECT = Effect(
    name="target-slip",
    family="measurement",
    meaning="The reflector, or the tool, moves on the robot at some row and stays there.",
    components=_components,
    shapes=_shapes,
    separation="read the reference pose again; add a second reflector",
    look_alikes=("thermal-drift", "outliers"),
    sources="a public set of a 6R arm: 5 mm at one row, smaller slips at three others",
)
