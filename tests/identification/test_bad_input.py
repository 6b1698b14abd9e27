"""What cannot be identified is refused or reported by name, never a silent number."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beamstiff import load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.identification.identify import identify
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.description import Robot

ROBOT = load_robot("kr240-2")
RANDOM = np.random.default_rng(0)
POSES = RANDOM.uniform(-1, 1, (10, 6))
LOADS = np.concatenate([RANDOM.normal(size=(10, 3)) * 500, RANDOM.normal(size=(10, 3)) * 100], axis=1)


def measured(
    q: Any = POSES, wrench: Any = LOADS, robot: Robot = ROBOT, sigma: float | None = 3e-5, **others: Any
) -> Measurements:
    """Return what the robot does, without noise, the rotations read too."""
    table = make_measurements(
        [variable.name for variable in robot.actuated],
        q,
        tcp=robot.tcp,
        wrench=wrench,
        sigma_position=sigma,
        sigma_rotation=sigma,
        **others,
    )
    return replace(table, displacement=predict_displacements(robot, table))


def test_a_joint_that_is_never_loaded_is_named_and_gets_no_value() -> None:
    # forces through the axis of joint 6, which the tool's point lies on
    forces = LOADS * [1, 1, 1, 0, 0, 0]
    found = identify(ROBOT, measured(wrench=forces))
    last = found["J6.torsional"]
    assert (last.value, last.std, last.lower_bound, last.identifiable) == (None, None, 0.0, False)
    assert last.reason == "J6.torsional is never loaded: its stiffness cannot be identified"
    assert last.reason in found.notes
    assert all(found[f"J{at}.torsional"].identifiable for at in range(1, 6))
    assert found.robot.parameter("J6.torsional") == ROBOT.parameter("J6.torsional")


def test_nothing_but_joints_never_loaded_is_refused() -> None:
    forces = LOADS * [1, 1, 1, 0, 0, 0]
    with pytest.raises(BeamstiffError, match=r"J6\.torsional is never loaded: its stiffness cannot be ident"):
        identify(ROBOT, measured(wrench=forces), ["J6.torsional"])


def test_one_test_repeated_is_reported_and_gives_only_sums() -> None:
    q, wrench = np.tile(POSES[:1], (10, 1)), np.tile([[300.0, 200, -500, 0, 0, 0]], (10, 1))
    table = measured(q, wrench)
    found = identify(
        ROBOT, replace(table, displacement=table.displacement * [1, 1, 1, np.nan, np.nan, np.nan])
    )
    assert any("of one pose" in note for note in found.notes)
    # one displacement, three numbers
    assert sum(item.identifiable for item in found.parameters) <= 3
    assert {name for item in found.degenerate for name in item.parameters}
    assert found.rms_held_out is None


def test_one_pose_under_many_loads_is_identified_and_said_to_be_one() -> None:
    found = identify(ROBOT, measured(np.tile(POSES[:1], (10, 1)), LOADS))
    assert any("all 10 rows are of one pose" in note for note in found.notes)
    assert all(item.identifiable for item in found.parameters)


@pytest.mark.parametrize("sigma", [0.0, -1e-5, np.nan, np.inf])
def test_noise_of_zero_is_refused(sigma: float) -> None:
    with pytest.raises(BeamstiffError, match="sigma_position"):
        measured(sigma=sigma)


def test_no_noise_stated_and_none_left_is_said() -> None:
    found = identify(ROBOT, measured(sigma=None))
    assert any("the standard deviations say nothing" in note for note in found.notes)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda t: replace(t, displacement=t.displacement * [1e3, 1e3, 1e3, 1, 1, 1]),
            "displacement over load",
        ),
        (lambda t: replace(t, wrench=t.wrench * 1e-3), "displacement over load"),
        (lambda t: replace(t, sigma=t.sigma * 1e3), "noise of positions"),
    ],
)
def test_files_that_contradict_one_another_by_their_units_are_refused(change: Any, says: str) -> None:
    one, two = measured(source="one.csv"), change(measured(source="two.csv"))
    with pytest.raises(
        BeamstiffError, match=rf"(one|two)\.csv and (one|two)\.csv: conflicting units\? {says}"
    ):
        identify(ROBOT, [one, two])


def test_files_of_other_poses_loads_and_noise_go_together() -> None:
    q = np.random.default_rng(5).uniform(-2, 2, (10, 6))
    other = replace(measured(q, -0.2 * LOADS, source="two.csv"), sigma=np.full((10, 6), 1e-4))
    found = identify(ROBOT.with_parameters({"J2.torsional": 1e7}), [measured(source="one.csv"), other])
    assert found["J2.torsional"].value == pytest.approx(ROBOT.parameter("J2.torsional"), rel=1e-6)


@pytest.mark.parametrize("option", ["parameters", "fixed", "ties", "bounds", "priors"])
def test_a_parameter_that_does_not_exist_is_named_with_the_one_meant(option: str) -> None:
    wrong = "J2.tosional"
    value: dict[str, Any] = {
        "parameters": [wrong],
        "fixed": [wrong],
        "ties": [[wrong, "J1.torsional"]],
        "bounds": {wrong: (1.0, None)},
        "priors": {wrong: (1e6, 2.0)},
    }
    with pytest.raises(BeamstiffError, match=r"'J2\.tosional'.*did you mean 'J2\.torsional'"):
        identify(ROBOT, measured(), **{option: value[option]})


def test_a_value_at_its_bound_is_said() -> None:
    high = 2 * ROBOT.parameter("J2.torsional")
    found = identify(ROBOT, measured(), bounds={"J2.torsional": (high, None)})
    assert any(f"J2.torsional lies at the least value allowed, {high:.4g}" in note for note in found.notes)


@pytest.mark.parametrize("actual", [1e5, 1e8, 1e11])
def test_a_stiffness_that_the_robot_calls_rigid_is_found_whatever_its_size(actual: float) -> None:
    truth = ROBOT.with_parameters({"J1.tilting": actual})
    table = measured(robot=truth, sigma=1e-9 * 1e5 / actual)
    found = identify(truth.with_parameters({"J1.tilting": np.inf}), table, ["J2.torsional", "J1.tilting"])
    assert found["J1.tilting"].value == pytest.approx(actual, rel=1e-3)
    assert found["J2.torsional"].value == pytest.approx(ROBOT.parameter("J2.torsional"), rel=1e-3)
