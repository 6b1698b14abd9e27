from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Joint, JointStiffness, Node, Robot
from tests.diagnosis.machines import (
    arm_at,
    at_random,
    by_compliance_of,
    close,
    elbow,
    kr240,
    nominal,
    rows_of,
    shape_of,
    unexplained,
)

SOUND = {"axial": 1e9, "radial": 1e9, "torsional": 1e8, "tilting": 1e8}


def on_springs() -> Robot:
    """Return the elbow arm on a joint between floor and foot, about the vertical."""
    robot = elbow()
    floor = Joint(
        name="J0", nodes=["floor", "foot"], frame="base", axis="z", stiffness=JointStiffness(**SOUND)
    )
    update = {
        "nodes": (Node(name="floor"), *robot.nodes),
        "joints": (floor, *robot.joints),
        "fixed": ("floor",),
    }
    return robot.model_copy(update=update)


@pytest.mark.parametrize(
    ("shape", "columns", "kind"),
    [
        ("tilt", [0], "tilting"),
        ("rotation", [0, 1], "tilting"),
        ("rotation", [2], "torsional"),
        ("soil", [3, 4], "radial"),
        ("soil", [5], "axial"),
    ],
)
def test_columns_are_derivatives_by_springs_under_the_foot(shape: str, columns: list[int], kind: str) -> None:
    rows = at_random(elbow(), 8, seed=1)
    found = (
        shape_of(nominal(elbow(), rows), "base-compliance", None, shape).columns[..., columns].sum(axis=-1)
    )
    close(found, by_compliance_of(on_springs(), rows, f"J0.{kind}"), 1e-6)


def test_all_of_it_is_any_symmetric_6x6_compliance_of_the_floor() -> None:
    there = nominal(kr240(), at_random(kr240(), 12, seed=2))
    arm, wrench = arm_at(there.rows.q), there.rows.wrench
    factor = np.random.default_rng(3).standard_normal((6, 6))
    passed = np.concatenate([wrench[:, :3], wrench[:, 3:] + np.cross(arm.tip, wrench[:, :3])], axis=1)
    d, r = np.split(passed @ (factor @ factor.T), 2, axis=1)
    moved = np.concatenate([d + np.cross(r, arm.tip), r], axis=1)
    every = shape_of(there, "base-compliance", None, "all").columns
    assert every.shape[2] == 21
    assert unexplained(moved, every) < 1e-9


@pytest.mark.parametrize("at", range(6))
def test_under_eight_times_the_load_contacts_give_four_times_as_much(at: int) -> None:
    rows = at_random(elbow(), 8, seed=4)
    eight = rows_of(elbow(), rows.q, 8 * rows.wrench)
    stated = {"force": 1e3, "moment": 1e3}
    once, more = (
        shape_of(replace(nominal(elbow(), some), stated=stated), "base-compliance", None, "all, stiffening")
        for some in (rows, eight)
    )
    names = [item.name for item in once.parameters]
    column = names.index(f"{('rotation', 'translation')[at // 3]}_at_contacts_{'xyz'[at % 3]}")
    close(more.columns[..., column], 4 * once.columns[..., column])
    # under the load that is stated they give what the parameter says
    load = rows_of(elbow(), [0, 0], 1e3 * np.eye(6)[(at + 3) % 6])
    alone = shape_of(
        replace(nominal(elbow(), load), stated=stated), "base-compliance", None, "all, stiffening"
    ).columns[0, :, column]
    assert alone[(at + 3) % 6] == pytest.approx(1.0)
