import numpy as np
import pytest

from beamstiff import Beam, Material, Node, Section
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.effects.link_bending import GAUSS, flexibility
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.se3 import Array
from tests.diagnosis.machines import (
    arm_at,
    at_random,
    bent,
    close,
    elbow,
    kr240,
    lift,
    nominal,
    rows_of,
    shape_of,
    unexplained,
)


@pytest.fixture(scope="module")
def campaign() -> Baseline:
    return nominal(kr240(), at_random(kr240(), 8, seed=1))


@pytest.mark.parametrize("link", ["link0", "link1", "link2", "link3", "link5"])
def test_uniform_bending_is_the_same_robot_with_a_beam_for_the_link(link: str, campaign: Baseline) -> None:
    # first order in 1/EI is exact here: statics alone gives the forces; what it stretches is in both
    one, two = (predict_displacements(bent(kr240(), link, EI), campaign.rows) for EI in (1e7, 5e6))
    close(shape_of(campaign, "link-bending", link, "uniform").columns[..., 0], (two - one) * 1e7, 1e-7)


def test_each_plane_bends_as_a_beam_that_is_not_round() -> None:
    robot = elbow()
    rows = at_random(robot, 10, seed=2)
    columns = shape_of(nominal(robot, rows), "link-bending", "fore", "by plane").columns.reshape(60, 5)
    rigid = next(item for item in robot.rigids if item.name == "fore")
    section = Section(A=1e-3, Iy=4e-5, Iz=1e-5, J=2e-5)
    update = {
        "rigids": tuple(item for item in robot.rigids if item is not rigid),
        "beams": (Beam(name="fore", nodes=rigid.nodes, section="s", material="m", up=(0.0, 1.0, 2.0)),),
        "sections": {"s": section},
        "materials": {"m": Material(E=2e11, G=8e10)},
    }
    moved = predict_displacements(robot.model_copy(update=update), rows) - predict_displacements(robot, rows)
    found, rest, _, _ = np.linalg.lstsq(columns / columns.std(axis=0), moved.ravel())
    found /= columns.std(axis=0)
    assert np.sqrt(rest[0]) < 1e-9 * np.linalg.norm(moved)
    y, z, yz, twist, stretch = found
    assert twist == pytest.approx(1 / (8e10 * 2e-5), rel=1e-6)
    assert stretch == pytest.approx(1 / (2e11 * 1e-3), rel=1e-6)
    # Mohr's circle of the two planes, whatever the local axes: 1/EIy and 1/EIz come out
    middle, radius = (y + z) / 2, np.hypot((y - z) / 2, yz)
    assert sorted([middle - radius, middle + radius]) == pytest.approx([1 / 8e6, 1 / 2e6], rel=1e-6)


def test_a_link_round_a_corner_is_two_beams_that_meet_there() -> None:
    robot = elbow()
    rows = at_random(robot, 12, seed=5)
    there = nominal(robot, rows)
    rigid = next(item for item in robot.rigids if item.name == "fore")
    corner = Node(name="corner", frame="f2", at=(0.3, 0.2, 0.15))
    beams = tuple(
        Beam(name=name, nodes=nodes, section="s", material="m", up=(0.0, 1.0, 2.0))
        for name, nodes in (("one", ("pin", "corner")), ("other", ("corner", "tip")))
    )
    update = {
        "nodes": (*robot.nodes, corner),
        "rigids": tuple(item for item in robot.rigids if item is not rigid),
        "beams": beams,
        "sections": {"s": Section(A=1e-3, Iy=4e-5, Iz=1e-5, J=2e-5)},
        "materials": {"m": Material(E=2e11, G=8e10)},
    }
    moved = predict_displacements(robot.model_copy(update=update), rows) - predict_displacements(robot, rows)
    round_it = shape_of(there, "link-bending", "fore", "any, as round a corner").columns
    assert unexplained(moved, round_it) < 1e-9
    assert unexplained(moved, shape_of(there, "link-bending", "fore", "by plane").columns) > 0.05


def mohr(q: Array, wrench: Array, joint: int, weight: Array) -> Array:
    """Return what a link from one joint's point to the next one's does to the tool by bending alone."""
    arm = arm_at(q)
    start, end = arm.point[:, joint], arm.point[:, joint + 1]
    length = np.linalg.norm(end - start, axis=1)[0]
    along = (end - start) / length
    total = np.zeros((len(q), 6))
    stations = (np.arange(weight.size) + 0.5) / weight.size
    for s, share in zip(stations, weight / weight.size, strict=True):
        lever = arm.tip - (start + s * (end - start))
        moment = wrench[:, 3:] + np.cross(lever, wrench[:, :3])
        moment -= along * (along * moment).sum(axis=1, keepdims=True)
        turned = share * length * moment
        total += np.concatenate([np.cross(turned, lever), turned], axis=1)
    return total


@pytest.mark.parametrize(("at", "law"), [(0, lambda s: 3 * (1 - s) ** 2), (1, lambda s: 3 * s**2)])
def test_a_taper_is_mohrs_integral_of_a_softer_end(at: int, law: object, campaign: Baseline) -> None:
    weight = law((np.arange(4000) + 0.5) / 4000)
    expected = mohr(campaign.rows.q, campaign.rows.wrench, 1, weight)
    close(shape_of(campaign, "link-bending", "link2", "tapered").columns[..., at], expected, 1e-6)


def test_the_flexibility_of_a_uniform_cantilever_is_the_textbooks() -> None:
    even = np.ones(GAUSS.size)
    found = flexibility(even, "xy")
    np.testing.assert_allclose(found[np.ix_([1, 5], [1, 5])], [[1 / 3, 1 / 2], [1 / 2, 1]], rtol=1e-12)
    found = flexibility(even, "xz")
    np.testing.assert_allclose(found[np.ix_([2, 4], [2, 4])], [[1 / 3, -1 / 2], [-1 / 2, 1]], rtol=1e-12)
    assert flexibility(even, "twist")[3, 3] == pytest.approx(1.0)


def test_every_link_of_some_length_is_a_component(campaign: Baseline) -> None:
    assert set(campaign.places.links) == {"link0", "link1", "link2", "link3", "link5"}  # 4 has no length


@pytest.mark.parametrize(("link", "joint"), [("link1", 0), ("link2", 1)])
@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
def test_a_weak_section_is_a_hinge_on_springs(link: str, joint: int, at: float, campaign: Baseline) -> None:
    arm, wrench = arm_at(campaign.rows.q), campaign.rows.wrench
    start, end = arm.point[:, joint], arm.point[:, joint + 1]
    lever = arm.tip - start - at * (end - start)
    turned = wrench[:, 3:] + np.cross(lever, wrench[:, :3])
    expected = np.concatenate([np.cross(turned, lever), turned], axis=1)
    shape = shape_of(campaign, "link-bending", link, "weak at several sections")
    own = [one.name in {f"section_compliance_{a}{a}_at_{at:g}" for a in "xyz"} for one in shape.parameters]
    close(shape.columns[..., own].sum(axis=-1), expected, 1e-6)
    if at == 0.0:
        root = shape_of(campaign, "link-bending", link, "weak at its root")
        np.testing.assert_allclose(root.columns, shape.columns[..., :6], atol=1e-18)


def test_of_a_soft_machine_much_is_expected() -> None:
    arm = kr240()
    softer = arm.with_parameters({name: 0.1 * arm.parameter(name) for name in arm.identify})
    rows = at_random(arm, 4, seed=1)
    for effect in ("link-bending", "bearing-tilt", "tool-compliance"):
        for component in EFFECTS[effect].components(nominal(arm, rows))[:2]:
            pairs = [EFFECTS[effect].shapes(nominal(robot, rows), component)[0] for robot in (arm, softer)]
            for one, other in zip(*(shape.parameters for shape in pairs), strict=True):
                assert other.size == pytest.approx(10 * one.size)


@pytest.mark.parametrize(("link", "joint"), [("link2", 1), ("link3", 2), ("link5", 4)])
@pytest.mark.parametrize("axis", range(3))
def test_a_hinge_about_an_axis_of_the_link_is_one_of_them(link: str, joint: int, axis: int) -> None:
    q = np.repeat(at_random(kr240(), 20, seed=6).q, 2, axis=0)
    wrench = np.random.default_rng(7).standard_normal((40, 6)) * [800, 800, 800, 200, 200, 200]
    rows = rows_of(kr240(), q, wrench)
    own = shape_of(nominal(kr240(), rows), "link-bending", link, "weak at its root").columns
    arm = arm_at(q)
    kinematics = compile_kinematics(kr240())
    turn = pose_of(kinematics, posture(kinematics, q), f"n{joint + 1}b")[:, :3, axis]  # of the link's frame
    moment = arm.moment(rows.wrench)[:, joint]
    moved = arm.turned(turn * (turn * moment).sum(axis=1, keepdims=True), joint)
    assert unexplained(moved, own) < 1e-6


def test_a_column_that_grows_bends_as_a_beam_of_its_length_in_each_posture() -> None:
    column = lift()
    rows = at_random(column, 12, seed=3)
    one, two = (predict_displacements(bent(column, "column", EI), rows) for EI in (1e7, 5e6))
    found = shape_of(nominal(column, rows), "link-bending", "column", "uniform").columns[..., 0]
    close(found, (two - one) * 1e7, 1e-7)
