"""Screws that are compliant by their free length, where the model has them as struts or prismatic joints."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Robot, Strut, load_robot
from beamstiff.diagnosis.apply import extended
from beamstiff.diagnosis.diagnose import diagnose
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.free_length import NAME, screws
from beamstiff.diagnosis.residual.baseline import Baseline, predict
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.kinematics import twist_jacobian
from tests.diagnosis.machines import POSITION, at_random, by_compliance_of, close, nominal, rows_of, shape_of
from tests.robots.machine import at, inside, values
from tests.robots.slider_cranks import lever_arm

SCREWS = load_robot("ir663-screws")
SPRINGS = load_robot("ir663")
FIXED = 0.3  # m
DRIVEN = {"r2": "screw2", "r8": "screw8"}


@pytest.fixture(scope="module")
def campaign() -> Baseline:
    q = np.repeat(inside(SCREWS, 12), 2, axis=0)
    wrench = np.random.default_rng(1).normal(0, 1000, (24, 6)) * [1, 1, 1, 0.2, 0.2, 0.2]
    return nominal(SCREWS, rows_of(SCREWS, q, wrench))


def stretched(name: str, EA: float, share: float = 0.0) -> Robot:
    """Return the robot with `EA` on one screw, whose ends lose `share` of the compliance that they had."""
    struts = [
        Strut(
            **{**dict(one), "EA": EA, "fixed_length": FIXED, "stiffness": one.stiffness / (1 - share)}
            if one.name == name
            else dict(one)
        )
        for one in SCREWS.struts
    ]
    return SCREWS.model_copy(update={"struts": tuple(struts)})


@pytest.mark.parametrize("variable", DRIVEN)
def test_a_screw_is_the_derivative_of_a_strut_with_a_free_length(campaign: Baseline, variable: str) -> None:
    length = campaign.rows.q[:, list(DRIVEN).index(variable)]
    shape = shape_of(campaign, "actuator-lever", variable, NAME)
    here, first, second = (
        predict_displacements(robot, campaign.rows)
        for robot in (SCREWS, *(stretched(DRIVEN[variable], 1 / step) for step in (1e-12, 2e-12)))
    )
    derivative = (4 * first - second - 3 * here) / 2e-12  # by 1/EA
    # the mean over the rows is the strut's own compliance, which is fitted already
    constant = by_compliance_of(SCREWS, campaign.rows, DRIVEN[variable]) * (length.mean() - FIXED)
    close(shape.columns[..., 0], derivative - constant, 1e-5)
    assert shape.parameters[0].unit == "1/N"


def test_about_its_axis_a_screw_is_compliant_by_its_length_over_its_lever_squared(campaign: Baseline) -> None:
    # force, and slip, of a lever about axis 2: theta2 as the constant springs have it
    rows = campaign.rows
    theta = np.stack([values(at(SCREWS, rows.q), name) for name in ("th2", "th8")], axis=1)
    structure, posture = at(SPRINGS, theta)
    jacobian = twist_jacobian(structure.kinematics, posture, SPRINGS.tcp)
    angle = np.radians(115.0 + 160.0) - theta[:, 0]
    lever = lever_arm(0.220, 0.750, angle)
    torque = np.einsum("na,na->n", jacobian[:, :, 0], rows.wrench)
    turned = (rows.q[:, 0] - rows.q[:, 0].mean()) / lever**2 * torque
    found = shape_of(campaign, "actuator-lever", "r2", NAME).columns[..., 0]
    close(found, jacobian[:, :, 0] * turned[:, None], 1e-7)


def test_every_variable_that_drives_a_strut_has_one_and_no_other(campaign: Baseline) -> None:
    driven = {name: one.struts for name, one in screws(campaign).items()}
    assert driven == {"r2": ("screw2",), "r8": ("screw8",)}
    assert EFFECTS["actuator-lever"].components(campaign) == ["r2", "r8"]
    platform = load_robot("stewart")
    legs = screws(nominal(platform, at_random(platform, 4, 0)))
    assert list(legs) == [f"r{leg}" for leg in range(1, 7)]
    assert all(one.grows == pytest.approx(1.0) for one in legs.values())
    delta = load_robot("delta")  # its rods keep their lengths
    assert not screws(nominal(delta, at_random(delta, 4, 0)))


def test_two_screws_on_one_variable_are_one_drive() -> None:
    twin = SCREWS.struts[0].model_copy(update={"name": "twin"})
    robot = SCREWS.model_copy(update={"struts": (*SCREWS.struts, twin), "identify": ("screw8",)})
    rows = rows_of(robot, inside(robot, 6), np.random.default_rng(2).normal(0, 1000, (6, 6)))
    there = nominal(robot, rows)
    assert screws(there)["r2"].struts == ("screw2", "twin")
    both = sum(by_compliance_of(robot, rows, name) for name in ("screw2", "twin"))
    follows = rows.q[:, 0] - rows.q[:, 0].mean()
    close(shape_of(there, "actuator-lever", "r2", NAME).columns[..., 0], both * follows[:, None], 1e-5)


def test_a_prismatic_drive_follows_its_slide() -> None:
    gantry = load_robot("gantry")
    rows = at_random(gantry, 8, 0)
    follows = rows.q[:, 2] - rows.q[:, 2].mean()
    shape = shape_of(nominal(gantry, rows), "actuator-lever", "qz", NAME)
    expected = by_compliance_of(gantry, rows, "Z.axial") * follows[:, None]
    expected[:, 3:] = 0.0  # nothing turns: what the difference has there is rounding
    close(shape.columns[..., 0], expected, 1e-5, 1e-9)
    assert not shape.parameters[0].positive  # which end the bearing is at is not in the model


@pytest.mark.slow
def test_a_screw_with_a_free_length_is_found_by_a_model_with_constant_screws() -> None:
    variable = "r2"
    rng = np.random.default_rng(3)
    q = np.repeat(inside(SCREWS, 30), 2, axis=0)
    rows = rows_of(SCREWS, q, rng.normal(0, 3000, (60, 6)) * [1, 1, 1, 0, 0, 0], sigma_position=POSITION)
    stiffness, share = SCREWS.parameter(DRIVEN[variable]), 0.5
    mean = q[:, list(DRIVEN).index(variable)].mean()
    EA = (mean - FIXED) * stiffness / share  # half of the compliance is the free length's
    machine = stretched(DRIVEN[variable], EA, share)
    measured = predict(machine, rows) + np.where(np.arange(6) < 3, rng.normal(0, POSITION, (60, 6)), np.nan)
    found = diagnose(SCREWS, replace(rows, displacement=measured))
    told = found.to_dict()
    assert (told["verdict"]["effect"], told["verdict"]["component"]) == ("actuator-lever", variable)
    size = told["which"][0]["parameters"]["length_compliance"]
    assert abs(size["value"] - 1 / EA) < 3 * size["std"]

    fresh = rows_of(SCREWS, inside(SCREWS, 20, 9), rng.normal(0, 3000, (20, 6)) * [1, 1, 1, 0, 0, 0])
    expected = predict(machine, fresh)[:, :3]
    before, after = (
        np.sqrt(((predict(robot, fresh)[:, :3] - expected) ** 2).sum(axis=1).mean())
        for robot in (found.baseline.robot, extended(found))
    )
    assert after < 0.2 * before
