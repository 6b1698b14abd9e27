"""Whatever is saved loads, and is the same robot."""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamstiff import load_robot, robot_names, save_robot
from beamstiff.errors import BeamstiffError
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.stiffness_parameters import stiffness_parameters

BUNDLED = {name: load_robot(name) for name in robot_names()}


def saved(robot: Robot) -> Robot:
    with tempfile.TemporaryDirectory() as folder:
        save_robot(robot, Path(folder) / "robot.yaml")
        return load_robot(Path(folder) / "robot.yaml")


@st.composite
def changed(draw: st.DrawFn) -> tuple[str, dict[str, float]]:
    """Draw a bundled robot with some of its stiffness as a fit or a reduction may leave it."""
    name = draw(st.sampled_from(sorted(BUNDLED)))
    own = stiffness_parameters(BUNDLED[name])
    names = draw(st.lists(st.sampled_from(sorted(own)), unique=True, max_size=4)) if own else []
    sizes = st.floats(1e3, 1e13)
    ends = st.sampled_from([RIGID, FREE])
    return name, {one: draw(sizes if one.endswith(".E") else sizes | ends) for one in names}


@settings(max_examples=20, deadline=None)
@given(changed())
def test_a_robot_with_other_stiffness_loads_as_the_same_robot(what: tuple[str, dict[str, float]]) -> None:
    name, values = what
    robot = BUNDLED[name].with_parameters(values)
    assert saved(robot) == robot


# a beam is never rigid: robots whose first value is that of a joint
@pytest.mark.parametrize(
    "name", sorted(n for n, robot in BUNDLED.items() if robot.identify and robot.identify[0][-2:] != ".E")
)
def test_what_became_rigid_is_not_to_be_identified_any_more(name: str) -> None:
    gone, *left = BUNDLED[name].identify
    robot = BUNDLED[name].with_parameters({gone: RIGID})
    assert saved(robot).identify == tuple(left)


def test_a_robot_that_would_not_load_is_not_written(tmp_path: Path) -> None:
    robot = BUNDLED["kr500"].model_copy(update={"tcp": "nowhere"})
    file = tmp_path / "robot.yaml"
    file.write_text("old")
    with pytest.raises(BeamstiffError, match=r"robot.yaml: cannot be written.*tcp: unknown node 'nowhere'"):
        save_robot(robot, file)
    assert file.read_text() == "old"
