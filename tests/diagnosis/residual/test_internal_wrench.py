from dataclasses import replace

import numpy as np
import pytest

from beamstiff import Beam, Frame, Material, Node, Rigid, Robot, Strut, Variable, load_robot
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import fit_baseline
from beamstiff.diagnosis.residual.internal_wrench import across, find_places, has_loops
from beamstiff.diagnosis.residual.place import Place
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.sections import Section, section_properties
from beamstiff.se3 import Array
from tests.diagnosis.machines import FORE, UPPER, at_random, bent, by_compliance_of, elbow, kr240, rows_of
from tests.fem.reference_frame import flexibility

Q = np.array([0.3, -0.8])


def points(rows: Measurements) -> dict[str, Array]:
    """Return where the elbow arm has its joints and its tip, (N, 3)."""
    first, both = rows.q[:, 0], rows.q.sum(axis=1)

    def level(length: float, angle: Array) -> Array:
        return length * np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=-1)

    second = level(UPPER, first)
    return {"J1": np.zeros((len(first), 3)), "J2": second, "tip": second + level(FORE, both)}


def in_base(place: Place, screw: Array) -> Array:
    """Return a place's screws (N, 6) in the axes of the base."""
    parts = [np.einsum("nab,nb->na", place.turn, screw[:, s]) for s in (slice(3), slice(3, 6))]
    return np.concatenate(parts, axis=1)


def carried(force: Array, moment: Array, arm: Array) -> Array:
    return np.concatenate([force, moment + np.cross(arm, force)], axis=1)


@pytest.fixture(scope="module")
def arm_rows() -> Measurements:
    return at_random(elbow(), 8, seed=1)


@pytest.mark.parametrize("joint", ["J1", "J2"])
def test_the_wrench_at_a_joint_is_the_load_carried_there(joint: str, arm_rows: Measurements) -> None:
    place = find_places(elbow(), arm_rows).joints[joint]
    at, wrench = points(arm_rows), arm_rows.wrench
    expected = carried(wrench[:, :3], wrench[:, 3:], at["tip"] - at[joint])
    np.testing.assert_allclose(in_base(place, place.load), expected, rtol=1e-10, atol=1e-8)
    np.testing.assert_allclose(place.turn[:, :, 0], np.tile([0, 0, 1], (8, 1)), atol=1e-12)


@pytest.mark.parametrize(("link", "end"), [("upper", "J2"), ("fore", "tip")])
def test_the_wrench_at_a_link_is_the_load_at_its_far_end(link: str, end: str, arm_rows: Measurements) -> None:
    place = find_places(elbow(), arm_rows).links[link]
    at, wrench = points(arm_rows), arm_rows.wrench
    expected = carried(wrench[:, :3], wrench[:, 3:], at["tip"] - at[end])
    np.testing.assert_allclose(in_base(place, place.load), expected, rtol=1e-10, atol=1e-8)
    start = {"upper": at["J1"], "fore": at["J2"]}[link]
    np.testing.assert_allclose(place.turn[:, :, 0] * place.length[:, None], at[end] - start, atol=1e-12)
    np.testing.assert_allclose(place.length, {"upper": UPPER, "fore": FORE}[link], rtol=1e-12)


def test_the_weight_at_the_tip_passes_through_both_joints(arm_rows: Measurements) -> None:
    places = find_places(elbow(mass=40.0, gravity=(1.0, -2.0, -9.0)), arm_rows)
    weight = np.tile(40.0 * np.array([1.0, -2.0, -9.0]), (8, 1))
    at = points(arm_rows)
    for joint in ("J1", "J2"):
        expected = carried(weight, 0 * weight, at["tip"] - at[joint])
        place = places.joints[joint]
        np.testing.assert_allclose(in_base(place, place.dead), expected, atol=1e-8)
    np.testing.assert_allclose(places.base.dead, carried(weight, 0 * weight, at["tip"]), atol=1e-8)
    np.testing.assert_allclose(
        in_base(places.flange, places.flange.dead), carried(weight, 0 * weight, 0 * at["tip"]), atol=1e-8
    )


@pytest.mark.parametrize("name", ["J1", "J2", "upper", "fore", "base", "flange"])
def test_a_slip_of_a_place_moves_the_tip_as_a_rigid_body_about_it(name: str, arm_rows: Measurements) -> None:
    places = find_places(elbow(), arm_rows)
    place = {**places.joints, **places.links, "base": places.base, "flange": places.flange}[name]
    at = points(arm_rows)
    centre = {**at, "upper": at["J2"], "fore": at["tip"], "base": at["J1"], "flange": at["tip"]}[name]
    slip = np.random.default_rng(2).standard_normal((8, 6))
    d, r = np.split(in_base(place, slip), 2, axis=1)
    expected = np.concatenate([d + np.cross(r, at["tip"] - centre), r], axis=1)
    np.testing.assert_allclose(np.einsum("nab,nb->na", place.shift, slip), expected, atol=1e-12)


def test_what_is_loaded_or_seen_before_a_place_does_not_pass_through_it() -> None:
    rows = rows_of(elbow(), Q, np.ones((2, 6)), load_point=["end", "tip"], point=["tip", "end"])
    places = find_places(elbow(), rows)
    np.testing.assert_allclose(places.joints["J2"].load[0], 0, atol=1e-9)
    np.testing.assert_allclose(places.joints["J2"].shift[1], 0, atol=1e-12)
    np.testing.assert_allclose(places.links["fore"].load[0], 0, atol=1e-9)
    assert places.joints["J1"].load[0].any()
    assert not places.flange.load[0].any()
    assert not places.flange.shift[1].any()


def by_place(place: Place, directions: list[int]) -> Array:
    return np.einsum("nai,ni->na", place.shift[:, :, directions], place.load[:, directions])


DIRECTIONS = {"axial": [0], "radial": [1, 2], "torsional": [3], "tilting": [4, 5]}


@pytest.mark.parametrize("robot", ["ir663", "kr240-2"])
def test_shift_times_load_is_the_derivative_by_the_compliance_of_any_joint(robot: str) -> None:
    machine = load_robot(robot)
    rows = at_random(machine, 6, seed=3, reach=0.4)
    if robot == "ir663":  # its wrist is left out, and its bearings hold sideways rigidly
        rows = rows_of(machine, rows.q, rows.wrench * [1, 0, 1, 0, 1, 0])
    places = find_places(machine, rows)
    assert set(places.joints) == {joint.name for joint in machine.joints}
    for name, place in places.joints.items():
        for kind, some in DIRECTIONS.items():
            value = machine.parameter(f"{name}.{kind}")
            if value == 0.0:
                np.testing.assert_allclose(place.load[:, some], 0, atol=1e-6)
                continue
            expected = by_compliance_of(machine, rows, f"{name}.{kind}")
            found = by_place(place, some)
            scale = max(np.abs(expected).max(), np.abs(rows.wrench).max())
            np.testing.assert_allclose(found, expected, atol=2e-5 * scale, err_msg=f"{name}.{kind}")


@pytest.mark.parametrize("beam", ["column", "swing", "crank", "coupler", "lever", "arm"])
def test_shift_times_load_is_the_derivative_by_the_flexibility_of_a_beam_in_a_loop(beam: str) -> None:
    machine = load_robot("ir663")
    rows = at_random(machine, 6, seed=4, reach=0.4)
    rows = rows_of(machine, rows.q, rows.wrench * [1, 0, 1, 0, 1, 0])
    place = find_places(machine, rows).links[beam]
    own = next(item for item in machine.beams if item.name == beam)
    section, material = section_properties(machine.sections[own.section]), machine.materials[own.material]
    L, E = float(place.length[0]), material.E  # as long in every posture
    # of a cantilever, per unit 1/E
    properties = {name: getattr(section, name) for name in ("A", "Iy", "Iz", "J")}
    bends = E * flexibility(L, E=E, G=material.G, **properties)
    found = np.einsum("nab,bc,nc->na", place.shift, bends, place.load)
    expected = by_compliance_of(machine, rows, f"{beam}.E")
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_shift_times_load_is_the_derivative_by_the_flexibility_of_a_rigid_link() -> None:
    rows = at_random(kr240(), 6, seed=5)
    place = find_places(kr240(), rows).links["link2"]
    bends = flexibility(float(place.length[0]), E=1.0, G=1 / 1.3, A=np.inf, Iy=1.0, Iz=1.0, J=1.0)
    found = np.einsum("nab,bc,nc->na", place.shift, bends, place.load)
    # first order is exact: statics alone gives the forces; what the beam stretches is the same in both
    one, two = (predict_displacements(bent(kr240(), "link2", EI), rows) for EI in (1e7, 5e6))
    expected = (two - one) * 1e7
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_loops_are_seen_with_the_floor_as_one_node() -> None:
    assert not has_loops(elbow())
    assert not has_loops(kr240())
    assert has_loops(load_robot("ir663"))
    assert has_loops(elbow().model_copy(update={"fixed": ("foot", "tip")}))


def test_a_loop_that_closes_where_it_was_measured_needs_no_limits() -> None:
    machine = load_robot("tripod")
    rows = at_random(machine, 2, seed=6)
    open_ended = tuple(item.model_copy(update={"limits": None}) for item in machine.variables)
    found = find_places(machine.model_copy(update={"variables": open_ended}), rows)
    assert set(found.joints) == set(find_places(machine, rows).joints)


def test_places_that_rigid_parts_of_a_loop_hold_are_named_with_the_reason() -> None:
    machine = load_robot("tripod")
    places = find_places(machine, at_random(machine, 2, seed=6))
    rigid = {item.name for item in machine.rigids}
    assert set(places.held) <= rigid | {joint.name for joint in machine.joints}
    assert not set(places.held) & (set(places.joints) | set(places.links))
    assert all(why for why in places.held.values())


def test_a_column_that_grows_beside_a_strut_carries_its_share_at_every_height() -> None:
    E, A, strut = 2e11, 1e-3, 1e8
    robot = Robot(
        name="lift",
        variables=[Variable(name="h", type="prismatic", limits=(0.5, 2.0))],
        frames=[Frame(name="f1", r="h")],
        nodes=[Node(name="foot"), Node(name="cellar", at=(0, 0, -1)), Node(name="top", frame="f1")],
        beams=[Beam(name="column", nodes=["foot", "top"], section="tube", material="steel")],
        struts=[Strut(name="tie", nodes=["cellar", "top"], stiffness=strut)],
        sections={"tube": Section(A=A, Iy=1e-6, Iz=1e-6, J=2e-6)},
        materials={"steel": Material(E=E, G=8e10)},
        fixed=["foot", "cellar"],
        tcp="top",
    )
    heights = np.array([0.5, 1.0, 2.0])
    rows = rows_of(robot, heights[:, None], np.tile(1000.0 * np.eye(6)[2], (3, 1)))
    column = E * A / heights
    found = find_places(robot, rows).links["column"].load[:, 0]
    np.testing.assert_allclose(found, 1000.0 * column / (column + strut), rtol=1e-9)


def test_what_hangs_at_the_tcp_passes_through_the_flange_and_a_beam_that_ends_there_does_not() -> None:
    light = bent(elbow(mass=20.0, gravity=(0.0, -9.81, 0.0)), "fore", EI=1e6)
    steel = light.materials["bent"].model_copy(update={"density": 7850.0})
    heavy = light.model_copy(update={"materials": light.materials | {"bent": steel}})
    rows = at_random(light, 4, seed=2)
    without, found = find_places(light, rows), find_places(heavy, rows)
    assert np.abs(found.joints["J2"].dead - without.joints["J2"].dead).max() > 10.0
    np.testing.assert_array_equal(found.flange.dead, without.flange.dead)
    np.testing.assert_allclose(np.linalg.norm(found.flange.dead[:, :3], axis=1), 20.0 * 9.81)


def test_a_reflector_beside_the_tcp_is_on_the_tool_where_nothing_is_read_at_the_tcp() -> None:
    """Turned about the TCP by r, a point of the same body, p off, moves by ``r x p``."""
    robot = kr240()
    frame = next(node.frame for node in robot.nodes if node.name == robot.tcp)
    ball = Node(name="ball", frame=frame, at=(0.1, 0.2, 0.3))
    arm = Rigid(name="arm", nodes=(robot.tcp, "ball"))
    more = {"nodes": (*robot.nodes, ball), "rigids": (*robot.rigids, arm)}
    robot = robot.model_copy(update=more)
    rows = at_random(robot, 6, seed=1)
    kinematics = compile_kinematics(robot)
    at = posture(kinematics, rows.q).node_positions
    off = at[:, kinematics.node_index["ball"]] - at[:, kinematics.node_index[robot.tcp]]
    found = find_places(robot, replace(rows, point=np.full(6, "ball"))).flange
    turned = found.turn @ [0.1, -0.2, 0.3]
    shown = (found.shift @ [0, 0, 0, 0.1, -0.2, 0.3])[:, :3]
    np.testing.assert_allclose(shown, np.cross(turned, off), atol=1e-12)
    both = replace(rows, point=np.where(np.arange(6) < 3, "ball", robot.tcp))
    assert not find_places(robot, both).flange.shift[:3].any()


@pytest.mark.parametrize("main", range(3))
def test_axes_about_a_link_along_a_coordinate_axis_do_not_swap(main: int) -> None:
    along = np.eye(3)[main] + 1e-3 * np.random.default_rng(main).standard_normal((50, 3))
    chosen = [across(one / np.linalg.norm(one)) for one in along]
    np.testing.assert_array_equal(chosen, np.tile(chosen[0], (50, 1)))
    assert chosen[0] @ np.eye(3)[main] == 0.0


def test_links_that_stand_on_the_ground_are_named_and_the_base_gives_all_that_they_can() -> None:
    assert find_places(elbow(), at_random(elbow(), 4, seed=2)).standing == ()
    closed = load_robot("ir663")
    assert find_places(closed, at_random(closed, 4, seed=2)).standing == ("column",)
    there = fit_baseline(kr240(), at_random(kr240(), 12, seed=2))
    assert there.places.standing == ("link0",)
    rows = at_random(kr240(), 12, seed=2)
    still = replace(rows, q=np.tile(rows.q[0], (12, 1)))  # what does not move in a table may move
    assert find_places(kr240(), still).standing == ("link0",)
    every = next(shape for shape in EFFECTS["base-compliance"].shapes(there, None) if shape.name == "all")
    size = [quantity.size for quantity in every.parameters]
    base = (every.columns * size).reshape(-1, len(size))
    for link, is_the_base in (("link0", True), ("link1", False)):
        for shape in EFFECTS["link-bending"].shapes(there, link):
            own = shape.columns.reshape(-1, len(shape.parameters))
            left = own - base @ np.linalg.lstsq(base, own, rcond=1e-13)[0]
            assert (np.linalg.norm(left) < 1e-6 * np.linalg.norm(own)) == is_the_base, (link, shape.name)
