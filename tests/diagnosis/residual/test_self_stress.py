"""Wrenches in rigid loops against virtual work, elastic twins, and a dense formulation with multipliers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import block_diag, null_space

from beamstiff import Frame, Node, Robot, Strut, load_robot
from beamstiff.diagnosis.inference.library import Library, build_library
from beamstiff.diagnosis.notes import undetermined_at
from beamstiff.diagnosis.residual.baseline import nominal_pose
from beamstiff.diagnosis.residual.internal_wrench import Places, find_places
from beamstiff.diagnosis.residual.place import Place
from beamstiff.diagnosis.residual.whitened import whiten
from beamstiff.measure.table import Measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.se3 import Array, rotation_from_vector, vector_from_rotation
from benchmarks.rigid_loops import elastic_twin, rigid_four_bar
from tests.arms import planar_arm
from tests.diagnosis.machines import at_random, nominal, rows_of
from tests.fem.builders import frame
from tests.fem.random_frames import RandomFrame, machine_frame
from tests.fem.reference_frame import any_axes

AXIAL, RADIAL, TURN, TILT = 0, [1, 2], 3, [4, 5]
STEP = 1e-5  # rad, of differences of forward kinematics
DRIVES = {"J12": 0, "J18": 1}


def four_bar_rows(robot: Robot, count: int = 6, plane: bool = False) -> Measurements:
    rows = at_random(robot, count, seed=3, reach=0.4)
    return rows_of(robot, rows.q, rows.wrench * [1, 0, 1, 0, 1, 0]) if plane else rows


def jacobian(robot: Robot, rows: Measurements) -> Array:
    """Return how the tool moves with each drive, (N, 6, A), by differences with the loops closed."""
    columns = []
    for at in range(rows.q.shape[1]):
        by = STEP * np.eye(rows.q.shape[1])[at]
        (low, below), (high, above) = (nominal_pose(robot, replace(rows, q=rows.q + s * by)) for s in (-1, 1))
        turned = vector_from_rotation(above @ below.swapaxes(-1, -2))
        columns.append(np.concatenate([high - low, turned], axis=1) / (2 * STEP))
    return np.stack(columns, axis=-1)


def tilted(robot: Robot) -> Robot:
    """Return the robot on a base that is turned: its plane lies across all coordinate axes."""
    x, y, z = rotation_from_vector(np.array([0.3, -0.5, 0.7])).T
    # Khalil and Kleinfinger: rot(z, gamma) rot(x, alpha) rot(z, theta)
    gamma, theta = np.arctan2(z[0], -z[1]), np.arctan2(x[2], y[2])
    angles = {"gamma": gamma, "alpha": np.arccos(z[2]), "theta": theta}
    ground = Frame(name="ground", **{name: f"{float(angle)!r} rad" for name, angle in angles.items()})
    frames = [
        one.model_copy(update={"parent": "ground"}) if one.parent == "base" else one for one in robot.frames
    ]
    nodes = [
        one.model_copy(update={"frame": "ground"}) if one.frame == "base" else one for one in robot.nodes
    ]
    return robot.model_copy(update={"frames": (ground, *frames), "nodes": tuple(nodes)})


@pytest.mark.parametrize("base", ["level", "tilted"])
def test_the_torque_of_a_drive_in_a_rigid_loop_is_virtual_work(base: str) -> None:
    robot = rigid_four_bar() if base == "level" else tilted(rigid_four_bar())
    rows = four_bar_rows(robot)
    moved = jacobian(robot, rows)
    for locked in ((), ("J12",), ("J12", "J18")):
        held = robot.with_parameters({f"{name}.torsional": RIGID for name in locked})
        places = find_places(held, rows).joints
        for name, at in DRIVES.items():
            torque = np.einsum("na,na->n", moved[:, :, at], rows.wrench)
            np.testing.assert_allclose(places[name].load[:, TURN], torque, atol=1e-8 * np.abs(torque).max())
            np.testing.assert_allclose(places[name].shift[:, :, TURN], moved[:, :, at], atol=1e-8)


@pytest.mark.parametrize("base", ["level", "tilted"])
def test_what_holds_a_planar_loop_across_its_plane_is_undetermined_and_nothing_else(base: str) -> None:
    robot = rigid_four_bar() if base == "level" else tilted(rigid_four_bar())
    places = find_places(robot, four_bar_rows(robot))
    for name, place in places.joints.items():
        assert place.undetermined.tolist() == [True, False, False, False, True, True], name
        assert not place.load[:, place.undetermined].any()
        assert not place.shift[:, :, place.undetermined].any()
    # a link in its plane: along it, across it, and bent about the plane's normal
    for name in ("swing", "crank", "coupler", "lever"):
        assert places.links[name].undetermined.sum() == 3, name
    assert not places.links["arm"].undetermined.any()
    assert not places.links["column"].undetermined.any()
    assert set(places.held) == {*places.joints, "swing", "crank", "coupler", "lever"}
    for why in places.held.values():
        assert "J12.axial, J12.tilting" in why
        assert "radial" not in why
        assert "torsional" not in why


@cache
def rigid_and_elastic() -> tuple[Places, Places]:
    rigid = rigid_four_bar()
    rows = four_bar_rows(rigid)
    return find_places(rigid, rows), find_places(elastic_twin(1e3), rows)


@pytest.mark.parametrize("name", ["J12", "J18", "J33", "J99", "J1010"])
def test_in_its_plane_an_elastic_twin_passes_the_same(name: str) -> None:
    """There a four-bar is statically determinate: its links' stiffness does not matter."""
    one, other = (places.joints[name] for places in rigid_and_elastic())
    for of_one, of_other in ((one.load, other.load), (one.shift, other.shift)):
        for some in (RADIAL, [TURN]):
            size = np.abs(of_other[..., some]).max()
            np.testing.assert_allclose(of_one[..., some], of_other[..., some], atol=1e-6 * size)


def test_what_is_undetermined_depends_on_links_that_the_rigid_model_does_not_know() -> None:
    """Two elastic twins with the same rigid limit differ there; in the determined directions they agree."""
    rows = four_bar_rows(rigid_four_bar())
    stiff = elastic_twin(1e5)
    other = stiff.with_parameters({"coupler.E": stiff.parameter("coupler.E")}).model_copy(
        update={
            "sections": stiff.sections | {"coupler": stiff.sections["arm"], "swing": stiff.sections["hub"]}
        }
    )
    one, two = (find_places(robot, rows).joints["J1010"].load for robot in (stiff, other))
    assert np.abs(one - two)[:, TILT].max() > 0.05 * np.abs(one[:, TILT]).max()
    np.testing.assert_allclose(one[:, RADIAL], two[:, RADIAL], atol=1e-4 * np.abs(one[:, RADIAL]).max())


def test_the_drives_hold_all_the_energy_of_a_machine_that_is_rigid_else() -> None:
    robot = rigid_four_bar()
    rows = four_bar_rows(robot)
    places = find_places(robot, rows).joints
    stored = sum(places[name].load[:, TURN] ** 2 / robot.parameter(f"{name}.torsional") for name in DRIVES)
    work = np.einsum("na,na->n", predict_displacements(robot, rows), rows.wrench)
    np.testing.assert_allclose(stored, work, rtol=1e-9)


def carriage(left: float, right: float, offset: float = 0.3) -> tuple[Robot, Measurements]:
    """Return a carriage that two screws in parallel push along x, and a push in line with neither."""
    points = [(0, -1, 0), (0, -1, 0), (0, 1, 0), (0, 1, 0), (0, offset, 0)]
    springs = ((0, 1, left), (2, 3, right))
    screws = [(a, b, (1, 0, 0), (stiffness, RIGID, RIGID, RIGID)) for a, b, stiffness in springs]
    robot = frame(points, rigids=[(1, 3), (3, 4)], joints=screws, fixed=(0, 2), tcp=4)
    return robot, rows_of(robot, np.zeros((1, 0)), [[1000.0, 0, 0, 0, 0, 0]])


def test_two_screws_in_parallel_share_a_load_as_their_stiffness_says() -> None:
    robot, rows = carriage(2e8, 3e8)
    places = find_places(robot, rows)
    for name, share in (("j0", 0.4), ("j1", 0.6)):
        place = places.joints[name]
        assert place.load[0, AXIAL] == pytest.approx(1000.0 * share, rel=1e-12)
        # what slips in the one strains the other too
        np.testing.assert_allclose(place.shift[0, :, AXIAL], [share, 0, 0, 0, 0, 0], atol=1e-12)
        assert place.undetermined.tolist() == [False, True, True, True, True, True]


def test_of_two_rigid_screws_in_parallel_neither_force_is_determined() -> None:
    robot, rows = carriage(RIGID, RIGID)
    places = find_places(robot, rows)
    assert all(place.undetermined.all() for place in places.joints.values())
    assert all("j0.axial" in why and "j1.axial" in why for why in places.held.values())


def test_a_rigid_screw_is_the_limit_of_a_stiff_one() -> None:
    exact, *stiff = (
        find_places(*carriage(value, 3e8)).joints["j0"].load[0, AXIAL] for value in (RIGID, 3e11, 3e13, 3e15)
    )
    errors = exact - np.array(stiff)
    np.testing.assert_allclose(errors, 1000.0 / (1 + np.array([1e3, 1e5, 1e7])), rtol=1e-3)


def test_beside_a_spring_a_rigid_screw_takes_all_and_the_spring_nothing() -> None:
    robot, rows = carriage(RIGID, 3e8)
    places = find_places(robot, rows).joints
    assert places["j0"].load[0, AXIAL] == pytest.approx(1000.0, rel=1e-12)
    assert places["j1"].load[0, AXIAL] == 0.0
    assert not places["j0"].undetermined[AXIAL]


@pytest.mark.parametrize("seed", range(5))
def test_in_a_spherical_four_bar_the_drive_alone_is_determined(seed: int) -> None:
    """All axes meet in a point: forces through it run round the loop, and tilt what lies off it."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(4, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    at, tip = axes * rng.uniform(0.5, 1.5, (4, 1)), rng.uniform(-1, 1, 3)
    drive, bearing = (RIGID, RIGID, 2e6, RIGID), (RIGID, RIGID, FREE, RIGID)
    hinges = [(2, 3, axes[1], bearing), (5, 4, axes[2], bearing), (7, 6, axes[3], bearing)]
    joints, links = [(0, 1, axes[0], drive), *hinges], [(1, 2), (3, 4), (5, 6), (3, 8)]
    points = [*np.repeat(at, 2, axis=0), tip]
    robot = frame(points, rigids=links, joints=joints, fixed=(0, 7), tcp=8)
    load = rng.normal(size=6) * 100
    places = find_places(robot, rows_of(robot, np.zeros((1, 0)), [load])).joints
    # both ways round the loop turn the coupler alike: a0 + w1 a1 = w3 a3 + w2 a2
    rates = np.linalg.solve(np.stack([axes[1], -axes[2], -axes[3]], axis=1), -axes[0])
    turned = axes[0] + rates[0] * axes[1]
    torque = load[:3] @ np.cross(turned, tip) + load[3:] @ turned
    assert places["j0"].load[0, TURN] == pytest.approx(torque, rel=1e-9)
    for place in places.values():
        assert place.undetermined.tolist() == [True, True, True, False, True, True]


def wrench_of(made: RandomFrame, load: Array, tcp: int) -> tuple[list[Array], list[Array]]:
    """Return the wrenches (6,) that joints pass, then rigids, base frame, and bases (6, s) of self-stresses.

    By multipliers of least norm: the reference's matrices, the rows of each part in the order of its lists.
    """
    reference = made.reference()
    stiffness, rows = reference.system()
    force = np.zeros(len(stiffness))
    force[6 * tcp : 6 * tcp + 6] = load
    free = null_space(rows, rcond=1e-10)
    moved = free @ np.linalg.solve(free.T @ stiffness @ free, free.T @ force)
    reactions = np.linalg.lstsq(rows.T, force - stiffness @ moved, rcond=1e-11)[0]
    stresses = null_space(rows.T, rcond=1e-10)
    starts, at = [], 6 * len(reference.rigids)
    for _, _, _, values in reference.joints:
        starts.append(slice(at, at := at + int(np.isinf(values).sum())))
    passed, held = [], []
    for (i, j, axis, values), some in zip(reference.joints, starts, strict=True):
        turn, stiff = block_diag(any_axes(axis), any_axes(axis)), np.isinf(values)
        local = turn.T @ reference.relative(i, j) @ moved * np.where(stiff, 0.0, values)
        local[stiff] = reactions[some]
        passed.append(turn @ local)
        held.append(turn[:, stiff] @ stresses[some])
    for k in range(len(reference.rigids)):
        passed.append(reactions[6 * k : 6 * k + 6])
        held.append(stresses[6 * k : 6 * k + 6])
    return passed, held


@given(
    seed=st.integers(0, 2**32 - 1),
    more=st.integers(2, 7),
    loops=st.integers(1, 4),
    rigid=st.sampled_from([0.3, 0.7, 1.0]),
)
def test_random_machines_pass_what_multipliers_say(seed: int, more: int, loops: int, rigid: float) -> None:
    made = machine_frame(seed, more, loops, rigid=rigid, free=0.1)
    assume(made.reference().softness() > 1e-5)
    robot = made.robot()
    tcp = [node.name for node in robot.nodes].index(robot.tcp)
    load = np.random.default_rng(seed).normal(size=6) * 100
    places = find_places(robot, rows_of(robot, np.zeros((1, 0)), [load]))
    passed, held = wrench_of(made, load, tcp)
    names = [f"j{at}" for at in range(len(made.joints))] + [f"r{at}" for at in range(len(made.rigids))]
    for name, wrench, stress in zip(names, passed, held, strict=True):
        place: Place | None = (places.joints | places.links).get(name)
        if place is None:  # rigids without length are no links
            continue
        turn = block_diag(place.turn[0], place.turn[0])
        part = np.linalg.norm(turn.T @ stress, axis=1)
        assume(((part < 1e-9) | (part > 1e-3)).all())  # else rounding decides
        assert place.undetermined.tolist() == (part > 1e-6).tolist(), name
        expected = np.where(part > 1e-6, 0.0, turn.T @ wrench)
        scale = max(np.abs(load).max(), np.abs(wrench).max())
        np.testing.assert_allclose(place.load[0], expected, atol=1e-6 * scale)


def test_a_note_says_once_where_directions_cannot_be_tested() -> None:
    robot = rigid_four_bar()
    (said,) = undetermined_at(nominal(robot, four_bar_rows(robot)))
    assert said.startswith("J12, J18, J33, J99, J1010, swing, crank, coupler, lever: ")
    assert "a self-stress of J12.axial, J12.tilting" in said
    elastic = load_robot("kr240-2")
    assert not list(undetermined_at(nominal(elastic, at_random(elastic, 6, seed=1))))


def library_of(robot: Robot) -> Library:
    baseline = nominal(robot, four_bar_rows(robot, 12))
    return build_library(baseline, whiten(baseline))


def test_on_a_rigid_four_bar_drives_are_tested_and_only_what_is_undetermined_is_not() -> None:
    library = library_of(rigid_four_bar())
    keys = {one.key for one in library.hypotheses}
    for effect in ("backlash", "hardening", "hysteresis", "actuator-lever"):
        assert {f"{effect}:q2", f"{effect}:q8"} <= keys
    assert "joint-coupling:q2+q8" in keys
    for one in library.hypotheses:
        assert one.shape.columns.any() or one.effect not in ("bearing-tilt", "link-bending"), one
    assert not any(one.why.startswith("all joints are rigid") for one in library.untestable)


def test_the_reason_of_what_is_undetermined_names_the_self_stress() -> None:
    """Two rigid hinges in line: what lies between them passes along the axis as much as one likes."""
    robot, rows = carriage(RIGID, RIGID)
    baseline = nominal(robot, rows)
    library = build_library(baseline, whiten(baseline))
    why = {(one.effect, one.component): one.why for one in library.untestable}
    assert "self-stress of j0.axial" in why["bearing-tilt", "j0"]
    assert "j1.axial" in why["bearing-tilt", "j0"]


def test_where_a_posture_is_singular_nothing_of_the_place_is_used_and_the_posture_is_named() -> None:
    """An arm on a rigid strut turns where the strut is in line with it, and nowhere else."""
    arm = planar_arm("arm", (1.0,), (2e6,), "foot hub tip", ("link",))
    robot = arm.model_copy(
        update={
            "nodes": (*arm.nodes, Node(name="wall", at=(3.0, 0, 0))),
            "struts": (Strut(name="prop", nodes=("wall", "tip"), stiffness="rigid"),),
            "fixed": ("foot", "wall"),
        }
    )
    places = find_places(robot, rows_of(robot, [[0.0], [0.5]], 100.0 * np.ones((2, 6))))
    assert places.joints["J1"].undetermined.all()
    assert "pose 1 is a singular position" in places.held["J1"]
    alone = find_places(robot, rows_of(robot, [0.0], 100.0 * np.ones((1, 6)))).joints["J1"]
    assert not alone.undetermined[TURN]
    assert alone.load[0, TURN] == pytest.approx(100.0 + 100.0)  # of mz, and of fy at 1 m
