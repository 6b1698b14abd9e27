"""A robot's variables may be called like anything that a map holds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from beamstiff import Robot, map_workspace
from beamstiff.maps.quantities import OWN, dimension_names
from beamstiff.maps.summary import summary
from beamstiff.report.workspace import map_figure, map_tables
from tests.maps.robots import planar_arm

CHOSEN: Any = {"quantities": ["stiffness", "displacement", "compliance"], "wrench": [0, -900, 0, 0, 0, 0]}
Q1, Q2 = np.linspace(-1.0, 1.0, 4), np.linspace(0.3, 1.5, 3)


def renamed(name: str) -> Robot:
    """Return the planar arm with its first variable called otherwise."""
    arm = planar_arm()
    return Robot(
        **{
            **{key: getattr(arm, key) for key in type(arm).model_fields},
            "variables": [arm.variables[0].model_copy(update={"name": name}), arm.variables[1]],
            "frames": [arm.frames[0].model_copy(update={"theta": name}), arm.frames[1]],
            "joints": [arm.joints[0].model_copy(update={"variable": name}), arm.joints[1]],
        }
    )


@pytest.fixture(scope="module")
def expected() -> xarray.Dataset:
    return map_workspace(planar_arm(), {"q1": Q1, "q2": Q2}, **CHOSEN)


@pytest.mark.parametrize("name", OWN)
def test_a_variable_of_any_name_has_the_map_of_another(
    name: str, expected: xarray.Dataset, tmp_path: Path
) -> None:
    found = map_workspace(renamed(name), {name: Q1, "q2": Q2}, **CHOSEN, out=tmp_path / "map.nc")
    with xarray.open_dataset(tmp_path / "map.nc") as written:
        for one in (found, written):
            assert one.stiffness.dims == (f"variable_{name}", "q2")
            assert one[f"variable_{name}"].attrs["variable"] == name
            for key in (*CHOSEN["quantities"], "reason"):
                np.testing.assert_array_equal(one[key].values, expected[key].values)
    told = summary(found)
    assert list(told["axes"]) == list(told["quantities"]["stiffness"]["worst"]["at"]) == [name, "q2"]
    assert "q" not in told["quantities"]["stiffness"]["worst"]
    list(map_tables(told))
    assert map_figure(found).axes[0].get_ylabel().startswith(f"{name}, deg")


def test_over_positions_such_a_variable_is_found_by_its_name() -> None:
    found = map_workspace(renamed("q"), {"x": [0.8, 0.9], "y": [0.1, 0.2]}, held={"q": 0.1, "q2": 0.8})
    assert found.q.dims == ("x", "y", "joint")
    assert found.joint.values.tolist() == ["q", "q2"]
    assert list(summary(found)["quantities"]["stiffness"]["worst"]["q"]) == ["q", "q2"]


def test_names_that_clash_with_nothing_stay() -> None:
    assert dimension_names(["q1", "x", "variable"]) == {"q1": "q1", "x": "x", "variable": "variable"}
    assert len(set(dimension_names(["q", "variable_q", "variable_variable_q"]).values())) == 3
