"""Columns of forces that cannot be those that moved the tool."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamstiff.errors import UnusableError
from beamstiff.measure import Measurements
from beamstiff.measure.load_plausibility import load_doubts, require_loads, work_between
from beamstiff.measure.plausibility import doubts
from beamstiff.measure.rows import subset
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array
from tests.diagnosis.machines import arm_at, at_random, kr240, rows_of

STIFFNESS = np.array([6e6, 7e6, 4e6, 9e5, 9e5, 6e5])  # N m/rad, about those of the robot file
STEP = 1e-5  # rad


def under_loads(turn: Array) -> Measurements:
    """Return positions of the KR240 under its weight and two loads a posture, read in a turned frame."""
    q = np.repeat(at_random(kr240(), 8, seed=5).q, 3, axis=0)
    wrench = np.zeros((24, 6))
    wrench[1::3, 2], wrench[2::3, :2] = -800.0, (500.0, -300.0)
    soft = 2e-6  # m/N, as in every direction: what a load does is along it
    position = (arm_at(q).tip + soft * wrench[:, :3]) @ turn.T + [1.0, -2.0, 0.5]
    rows = rows_of(kr240(), q, wrench, position=position)
    return replace(rows, sigma=np.full((24, 6), 3e-5))


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (0.4, -0.9, 2.0)])
def test_loads_of_the_wrong_sign_under_absolute_positions_are_refused(vector: tuple[float, ...]) -> None:
    turn = Rotation.from_rotvec(vector).as_matrix()
    table = under_loads(turn)
    more = np.array([800.0**2, 500.0**2 + 300.0**2]) * 2e-6
    np.testing.assert_allclose(np.sort(work_between(table, kr240())), np.sort(np.tile(more, 8)), rtol=1e-2)
    require_loads(table, kr240())
    with pytest.raises(UnusableError, match="all 16 rows that tell"):
        require_loads(replace(table, wrench=-table.wrench), kr240())


def test_some_loads_of_the_wrong_sign_and_what_noise_hides_are_not_refused() -> None:
    table = under_loads(np.eye(3))
    some = table.wrench.copy()
    some[:18] *= -1.0
    require_loads(replace(table, wrench=some), kr240())
    require_loads(replace(table, wrench=-table.wrench, sigma=np.full((24, 6), 1e-3)), kr240())


def pushed(kind: str, spread: float = 0.3, along: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Measurements:
    """Return what a KR240 of drive springs does under forces: torques by virtual work, of differences.

    The springs are off by up to `spread` with the angle of their joint, as no drive of the model is.
    """
    q = at_random(kr240(), 30, seed=6).q
    force = np.random.default_rng(7).standard_normal((30, 3)) * 800.0 * np.array(along)
    slopes = [(arm_at(q + STEP * one).tip - arm_at(q - STEP * one).tip) / (2 * STEP) for one in np.eye(6)]
    torque = np.einsum("anx,nx->na", np.array(slopes), force)
    turned = torque / STIFFNESS * (1.0 + spread * np.sin(q))
    moved = arm_at(q + turned).tip - arm_at(q).tip
    wrench = np.concatenate([force, np.zeros((30, 3))], axis=1)
    if kind == "displacement":
        seen = np.concatenate([moved, np.full((30, 3), np.nan)], axis=1)
        return rows_of(kr240(), q, wrench, displacement=seen)
    turn = Rotation.from_rotvec((0.4, -0.9, 2.0)).as_matrix()
    place = np.concatenate([arm_at(q).tip, arm_at(q).tip + moved]) @ turn.T + [1.0, -2.0, 0.5]
    return rows_of(kr240(), np.tile(q, (2, 1)), np.concatenate([0 * wrench, wrench]), position=place)


def said(table: Measurements) -> list[str]:
    """Return what is said of the loads."""
    return [one for one in doubts(table, kr240()) if "loads move" in one or "against" in one]


def changed(table: Measurements, wrong: Callable[[Array], Array]) -> Measurements:
    """Return a table with other forces."""
    return replace(table, wrench=np.concatenate([wrong(table.wrench[:, :3]), table.wrench[:, 3:]], axis=1))


@pytest.mark.parametrize("kind", ["displacement", "absolute"])
@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda f: f[:, [1, 0, 2]], "fx and fy swapped ("),
        (lambda f: f[:, [1, 2, 0]], "fx fy fz in the columns fz fx fy ("),
        (lambda f: f * [1, -1, 1], "fy reversed ("),
        (lambda f: f * [1, 1, 1e-3], "fz in kN, and read in N ("),
        (lambda f: f * [1e3, 1, 1], "fx in N, and read in kN ("),
    ],
)
def test_columns_of_forces_are_named(wrong: Callable[[Array], Array], told: str, kind: str) -> None:
    table = changed(pushed(kind), wrong)
    (note,) = said(table)
    assert told in note
    if kind == "displacement":
        with pytest.raises(UnusableError, match=re.escape(told)):
            require_loads(table, kr240())
    else:  # which are held against the geometry that they fit
        require_loads(table, kr240())


@pytest.mark.parametrize(
    ("factor", "kind", "told"),
    [
        (1e-3, "absolute", "are fx fy fz in kN, and read in N? Or is"),
        (1e3, "absolute", "are fx fy fz in N, and read in kN? Or is"),
        (1e-3, "displacement", "are dx dy dz in um, and read in mm, or fx fy fz in kN, and read in N? Or is"),
        (1e3, "displacement", "are dx dy dz in mm, and read in um, or fx fy fz in N, and read in kN? "),
    ],
)
def test_units_of_forces_or_displacements_are_named(factor: float, kind: str, told: str) -> None:
    table = changed(pushed(kind), lambda f: factor * f)
    (note,) = said(table)
    assert told in note
    if kind == "displacement" and factor > 1.0:  # stiffer than any robot; softer ones may be soft
        with pytest.raises(UnusableError, match="N/m is no robot; if it is one, state its stiffness"):
            require_loads(table, kr240())
    else:
        require_loads(table, kr240())


def test_forces_along_the_axes_of_the_tool_are_named() -> None:
    table = pushed("displacement")
    turn = arm_at(table.q).tool
    (note,) = said(changed(table, lambda f: np.einsum("nji,nj->ni", turn, f)))
    assert "fx, fy, fz along the axes of the tool (" in note


def test_of_exchanges_that_are_the_same_the_simplest_is_named() -> None:
    table = pushed("displacement", along=(0.0, 0.0, 1.0))
    (note,) = said(changed(table, lambda f: f[:, [2, 1, 0]]))
    assert "fx and fz swapped (" in note


@pytest.mark.parametrize("kind", ["displacement", "absolute"])
@pytest.mark.parametrize("spread", [0.0, 0.8])
def test_of_right_columns_and_of_few_postures_nothing_is_said(kind: str, spread: float) -> None:
    table = pushed(kind, spread)
    assert not said(table)
    few = np.isin(table.pose, np.unique(table.pose)[:5])
    swapped = subset(changed(table, lambda f: f[:, [1, 0, 2]]), few)
    assert not [one for one in said(swapped) if "fits springs" in one]


@pytest.mark.parametrize("name", ["five-bar", "delta", "gantry", "ir663-screws"])
def test_other_machines_that_move_as_their_model_says_are_not_doubted(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(0)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = 0.5 * (low + high) + 0.1 * (high - low) * rng.uniform(-1, 1, (30, len(low)))
    wrench = np.concatenate([500 * rng.standard_normal((30, 3)), np.zeros((30, 3))], axis=1)
    table = rows_of(robot, q, wrench)
    table = replace(table, displacement=predict_displacements(robot, table))
    assert not list(load_doubts(table, robot))
    swapped = changed(table, lambda f: f[:, [1, 0, 2]])
    assert "fx and fy swapped" in next(load_doubts(swapped, robot))
