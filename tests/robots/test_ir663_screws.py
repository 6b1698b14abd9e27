"""The IR-663 on its ball screws: the paper's closed form, the law of cosines, springs in series.

The geometry of the slider-cranks, as the robots' files say: l12, l32 and l18, l38 are two sides of a triangle
whose third is the screw; the angle between them turns with theta2 or theta8.
"""

import numpy as np
import pytest

from beamstiff import Robot, Section, load_robot
from beamstiff.errors import BeamstiffError
from beamstiff.expression_graph.graph import MANY
from beamstiff.measure.table import make_measurements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.robot.fields import RIGID
from beamstiff.robot.inverse import inverse_geometry
from beamstiff.robot.kinematics import twist_jacobian
from beamstiff.robot.parts import Strut
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.se3 import Array
from tests.robots.machine import at, compliance, inside, limits, point, values
from tests.robots.slider_cranks import lever_arm, marie_theta, third_side, wrapped

SCREWS, BEAMS, SPRINGS = (load_robot(name) for name in ("ir663-screws", "ir663-screws-beams", "ir663"))
SWING, CRANK = (0.220, 0.750), (0.250, 0.750)
NO_BEARINGS = {"J12.radial": RIGID, "J18.radial": RIGID}


def between(q: Array) -> tuple[Array, Array]:
    """Return the angles at axes 2 and 8 between lug and bracket, for (theta2, theta8)."""
    # clockwise from forward: brackets at 115 and 147.5 deg, swing at theta2 - 90 deg, its lug 70 deg behind,
    # crank at theta8, its lug 170 deg behind
    swing = np.radians(115.0) - (q[:, 0] - np.radians(90.0 + 70.0))
    crank = np.radians(147.5) - (q[:, 1] - np.radians(170.0))
    return swing, crank


def lengths(q: Array) -> Array:
    """Return the lengths of both screws (P, 2) for (theta2, theta8)."""
    swing, crank = between(q)
    return np.stack([third_side(*SWING, swing), third_side(*CRANK, crank)], axis=1)


@pytest.mark.parametrize("robot", [SCREWS, BEAMS], ids=lambda robot: robot.name)
def test_both_angles_are_those_of_the_papers_closed_form(robot: Robot) -> None:
    r = inside(robot, 2000)
    expected = marie_theta(r[:, 0], np.radians(-110), np.radians(-155), *SWING, branch=1)
    assert np.abs(wrapped(values(at(robot, r), "th2") - expected)).max() < 1e-12
    # theta8 counts from level and not from upright, as theta2 does: a quarter turn goes into kappa8
    lug, bracket = np.radians(170 + 180), np.radians(-147.5)
    expected = marie_theta(r[:, 1], lug - np.pi / 2, np.pi / 2 - bracket, *CRANK, branch=1)
    assert np.abs(wrapped(values(at(robot, r), "th8") - expected)).max() < 1e-12


def test_screw_lengths_obey_the_law_of_cosines_and_the_limits_are_those_of_the_angles() -> None:
    r = inside(SCREWS, 2000)
    posed = at(SCREWS, r)
    assert np.abs(lengths(np.stack([values(posed, "th2"), values(posed, "th8")], axis=1)) - r).max() < 1e-12
    ends = lengths(limits(SPRINGS).T).T
    assert np.abs(ends - limits(SCREWS)).max() < 1e-3


def test_the_tool_is_where_the_angles_put_it() -> None:
    q = inside(SPRINGS, 500)
    q = q[(np.abs(q - limits(SPRINGS).mean(axis=1)) < 0.49 * np.ptp(limits(SPRINGS), axis=1)).all(axis=1)]
    assert point(at(SCREWS, lengths(q)), "n7") == pytest.approx(point(at(SPRINGS, q), "n7"), abs=1e-12)


def test_inverse_geometry_finds_the_lengths_for_a_tool_position() -> None:
    q = inside(SPRINGS, 60)
    q = q[(np.abs(q - limits(SPRINGS).mean(axis=1)) < 0.45 * np.ptp(limits(SPRINGS), axis=1)).all(axis=1)]
    structure, _ = at(SCREWS, lengths(q))
    found = inverse_geometry(structure.kinematics, point(at(SPRINGS, q), "n7"), seed=1)
    assert found.reached.all()
    assert found.q == pytest.approx(lengths(q), abs=1e-8)


def test_a_screw_moves_its_angle_by_its_lever_arm() -> None:
    r = inside(SCREWS, 300)
    structure, posture = at(SCREWS, r)
    angles = np.stack([values((structure, posture), name) for name in ("th2", "th8")], axis=1)
    rates = twist_jacobian(structure.kinematics, posture, "n3")[:, 4, 0]  # of the swing about y
    assert rates * lever_arm(*SWING, between(angles)[0]) == pytest.approx(np.ones(300), rel=1e-10)


def test_a_screw_is_a_spring_about_its_axis_of_stiffness_times_lever_arm_squared() -> None:
    q = inside(SPRINGS, 12)
    arms = [lever_arm(*sides, angle) for sides, angle in zip((SWING, CRANK), between(q), strict=True)]
    found = compliance(SCREWS.with_parameters(NO_BEARINGS), lengths(q))
    for pose in range(len(q)):
        about = {
            "J12.torsional": SCREWS.parameter("screw2") * float(arms[0][pose]) ** 2,
            "J18.torsional": SCREWS.parameter("screw8") * float(arms[1][pose]) ** 2,
        }
        expected = compliance(SPRINGS.with_parameters({**NO_BEARINGS, **about}), q[pose])[0]
        assert np.abs(found[pose] - expected).max() < 1e-9 * np.abs(expected).max()


def test_at_mid_stroke_the_screws_are_table_3s_springs() -> None:
    posed = at(SCREWS, limits(SCREWS).mean(axis=1))
    swing, crank = between(np.stack([values(posed, "th2"), values(posed, "th8")], axis=1))
    about_2 = SCREWS.parameter("screw2") * lever_arm(*SWING, swing)[0] ** 2
    about_8 = SCREWS.parameter("screw8") * lever_arm(*CRANK, crank)[0] ** 2
    assert about_2 == pytest.approx(SPRINGS.parameter("J12.torsional"), rel=0.05)
    assert about_8 == pytest.approx(SPRINGS.parameter("J18.torsional"), rel=0.05)


def in_series(r: Array) -> Array:
    """Return the stiffness (2,) of nut, screw and tube in series, for the lengths (2,) of the screws."""
    nuts = np.array([BEAMS.parameter("nut2.axial"), BEAMS.parameter("nut8.axial")])
    screw, tube = 210e9 * np.pi * 0.025**2, 210e9 * np.pi * (0.040**2 - 0.032**2)
    result: Array = 1.0 / (1.0 / nuts + (r - 0.300) / screw + 0.300 / tube)
    return result


def test_screws_as_beams_are_springs_in_series_whose_stiffness_follows_their_length() -> None:
    r = inside(BEAMS, 8)
    found = compliance(BEAMS, r)
    for pose in range(len(r)):
        screw2, screw8 = in_series(r[pose]).tolist()
        expected = compliance(SCREWS.with_parameters({"screw2": screw2, "screw8": screw8}), r[pose])[0]
        assert np.abs(found[pose] - expected).max() < 1e-9 * np.abs(expected).max()


def with_free_lengths() -> Robot:
    """Return the struts with the beams' screws in them: nut and tube in series, the screw up to the nut."""
    screw, tube = 210e9 * np.pi * 0.025**2, 210e9 * np.pi * (0.040**2 - 0.032**2)
    struts = [
        Strut(
            name=strut.name,
            nodes=strut.nodes,
            stiffness=1.0 / (1.0 / BEAMS.parameter(f"nut{strut.name[-1]}.axial") + 0.300 / tube),
            EA=screw,
            fixed_length=0.300,
        )
        for strut in SCREWS.struts
    ]
    return SCREWS.model_copy(update={"struts": tuple(struts)})


@pytest.mark.parametrize("poses", [8, MANY])
def test_struts_with_a_free_length_are_the_screws_as_beams(poses: int) -> None:
    r = inside(BEAMS, poses)
    found, expected = compliance(with_free_lengths(), r), compliance(BEAMS, r)
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_struts_with_a_free_length_are_identified_as_springs_behind_their_rods() -> None:
    robot, rng = with_free_lengths(), np.random.default_rng(3)
    rows = make_measurements(["r2", "r8"], inside(robot, 6), wrench=rng.normal(size=(6, 6)) * 1e3, tcp="n7")
    names = ("screw2", "screw8", "J1010.radial")
    for gravity in (False, True):
        model = reduce_to_ports(robot, rows, names, gravity=gravity)
        values = model.start * rng.uniform(0.5, 2.0, 3)
        changed = robot.with_parameters(dict(zip(names, values.tolist(), strict=True)))
        assert changed.struts[0].EA == robot.struts[0].EA
        expected = reduce_to_ports(changed, rows, ["J12.radial"], gravity=gravity)
        moved = expected.predict(expected.start)
        assert np.abs(model.predict(values) - moved).max() < 1e-9 * np.abs(moved).max()
        step = 1e-5 * np.diag(values)
        slopes = [
            (model.predict(values + one) - model.predict(values - one)) / (2 * one.sum()) for one in step
        ]
        found = model.derivatives(values)[1]
        assert np.abs(found - np.stack(slopes, -1)).max(axis=(0, 1)) == pytest.approx(
            0.0, abs=1e-6 * np.abs(found).max()
        )


def test_a_strut_shorter_than_its_fixed_length_is_refused() -> None:
    robot = with_free_lengths()
    longer = robot.struts[0].model_copy(update={"fixed_length": 0.700})
    with pytest.raises(
        BeamstiffError, match=r"strut 'screw2' is 6\d\d mm long at pose 0, expected more than"
    ):
        compliance(robot.model_copy(update={"struts": (longer, *robot.struts[1:])}), limits(robot)[:, :1].T)
    with pytest.raises(BeamstiffError, match="fixed_length: found one without EA"):
        Strut(name="s", nodes=("a", "b"), stiffness=1e7, fixed_length=0.3)


def test_a_strut_with_a_free_length_is_written_and_read_back() -> None:
    robot = with_free_lengths()
    assert parse_robot(robot_to_yaml(robot)).struts == robot.struts


def test_at_mid_stroke_both_are_equally_stiff() -> None:
    middle = limits(BEAMS).mean(axis=1)
    assert in_series(middle) == pytest.approx(
        [SCREWS.parameter("screw2"), SCREWS.parameter("screw8")], rel=0.01
    )


def test_screw_beams_that_do_not_stretch_leave_the_struts() -> None:
    r = inside(BEAMS, 50)
    area = Section(A=1e3, Iy=3e-7, Iz=3e-7, J=6e-7)  # as slender as before, but in length
    thick = BEAMS.model_copy(update={"sections": {**BEAMS.sections, "screw": area, "tube": area}})
    struts = SCREWS.with_parameters(
        {"screw2": BEAMS.parameter("nut2.axial"), "screw8": BEAMS.parameter("nut8.axial")}
    )
    expected = compliance(struts, r)
    assert np.abs(compliance(thick, r) - expected).max() < 1e-6 * np.abs(expected).max()
