"""Fake poses: the real tool comes to rest where it was meant to."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from beamstiff.compensation.machine import Machine
from beamstiff.compensation.online import OnlineCompensation
from beamstiff.compensation.path import Frames, ToolPath
from beamstiff.compensation.path_correction import (
    DEFORMATION,
    EFFECTS,
    GEOMETRY,
    correct_path,
    error_parts,
    errors_of,
)
from beamstiff.compensation.posture import StatedPosture
from beamstiff.compensation.process.load import Constant, FromPath, Together
from beamstiff.compensation.uncertainty import from_start_values
from beamstiff.errors import BeamstiffError
from beamstiff.measure.table import make_measurements
from beamstiff.model.fuzzy_compliance import FuzzyCompliance
from beamstiff.model.fuzzy_inference import FuzzySystem, Partition
from beamstiff.model.model_file import with_model
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import AddedEffect, Mass
from beamstiff.robot.reader import load_robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array, rotation_from_vector, transform

START = np.array([0.2, -1.2, 1.5, 0.3, 0.8, 0.1])
LOAD = Constant((300.0, -200.0, -900.0, 10.0, -20.0, 30.0))


def kr500(**change: object) -> Robot:
    return load_robot("kr500").model_copy(update=change)


def path_of(robot: Robot, count: int = 6, turns: bool = True) -> ToolPath:
    kinematics = compile_kinematics(robot)
    q = START + np.linspace(0, 0.2, count)[:, None] * [1, -1, 0.5, 1, 1, 1]
    poses = pose_of(kinematics, posture(kinematics, q), robot.tcp)
    names = tuple(f"P{at}" for at in range(count))
    return ToolPath("path", names, np.arange(1, count + 1), poses, np.full(count, turns))


BACKLASH = AddedEffect(
    effect="backlash",
    component="q3",
    shape="flank within 0.03",
    parameters={"half_width": "0.1 mrad"},
    scales={"torque": 2000.0},
)


def heavy() -> Robot:
    """Return a KR500 with a tool, backlash and an encoder that is off."""
    robot = load_robot("kr500")
    frames = tuple(
        frame.model_copy(update={"theta": "q2 + 0.0005"}) if frame.name == "f2" else frame
        for frame in robot.frames
    )
    return robot.model_copy(
        update={
            "frames": frames,
            "masses": (Mass(node="n6b", mass=180.0, at=(0.05, 0.0, 0.2)), Mass(node="n3b", mass=300.0)),
            "effects": (BACKLASH,),
        }
    )


def test_the_corrected_tool_is_at_its_targets_in_position_and_rotation() -> None:
    machine, path = Machine(kr500(), heavy()), path_of(kr500())
    found = correct_path(machine, path, LOAD, start=START)
    assert np.linalg.norm(found.before[:, :3], axis=1).min() > 1e-3
    assert np.linalg.norm(found.before[:, 3:], axis=1).min() > 1e-3
    assert np.abs(found.after).max() < 2e-8
    assert not found.reasons
    assert found.rounds <= 6


@dataclass(frozen=True, eq=False)
class Jumping(Machine):
    """A rigid robot whose tool sags by 1 mm, or by less where it is sent more than a step above 1 m."""

    step: float = 0.97e-3
    less: float = 0.95e-3

    def moved(self, q: Array, wrench: Array, tip: Array, approached: Array | None = None) -> Array:
        sag = np.zeros((len(q), 6))
        sag[:, 2] = np.where(self.undeformed(q)[:, 2, 3] > 1.0 + self.step, -self.less, -1e-3)
        return sag


@pytest.mark.parametrize(("step", "less", "kept"), [(0.97e-3, 0.95e-3, True), (0.8e-3, 0.6e-3, False)])
def test_where_no_command_is_exact_the_best_is_taken_if_it_leaves_little(
    step: float, less: float, kept: bool
) -> None:
    """To be at 1 m it has to be sent 1 mm above, where it sags less; or less far, where it sags by 1 mm."""
    path = path_of(kr500(), 1)
    poses = path.poses.copy()
    poses[0, 2, 3] = 1.0
    machine = Jumping(kr500(), step=step, less=less)
    found = correct_path(machine, path.moved_to(poses), start=START)
    assert found.before[0, 2] == pytest.approx(-1e-3)
    assert found.corrected.tolist() == [kept]
    with pytest.raises(BeamstiffError, match=r"not corrected: no command (is exact|found)"):
        OnlineCompensation(machine, _q=START).correct(poses[0], np.zeros(6))
    if kept:
        np.testing.assert_allclose(found.partly[0], found.after[0], atol=1e-12)
        assert 0.02e-3 <= np.abs(found.partly[0]).max() < 0.05e-3
    else:
        assert re.fullmatch(r"no command found: 0\.\d+ mm and \S+ deg remain", found.reasons[0])
        assert not found.partly


def test_the_first_fake_pose_takes_away_most_and_the_next_the_rest() -> None:
    machine, path = Machine(kr500(), heavy()), path_of(kr500())
    found = correct_path(machine, path, LOAD, start=START)
    once = path.poses.copy()
    once[:, :3, 3] -= found.before[:, :3]
    once[:, :3, :3] = rotation_from_vector(-found.before[:, 3:]) @ once[:, :3, :3]
    rest = errors_of(machine, found, once, LOAD)
    assert 1e-4 < np.abs(rest).max() / np.abs(found.before).max() < 0.02
    assert np.abs(found.after).max() < 1e-2 * np.abs(rest).max()


def test_effects_of_measuring_move_no_tool() -> None:
    askew = AddedEffect(effect="frame-misalignment", shape="shift", parameters={"x": "1 mm"})
    real = heavy()
    machine = Machine(kr500(), real.model_copy(update={"effects": (*real.effects, askew)}))
    assert [one.effect for one in machine.real.effects] == ["backlash"]
    assert machine.set_aside == (askew,)


def test_a_rigid_robot_without_weight_needs_no_correction() -> None:
    robot = kr500(gravity=(0.0, 0.0, 0.0))
    rigid = robot.with_parameters(dict.fromkeys(stiffness_parameters(robot), np.inf))
    path = path_of(robot)
    found = correct_path(Machine(rigid), path, LOAD, start=START)
    assert np.abs(found.before).max() < 1e-9
    np.testing.assert_array_equal(found.commands, path.poses)


def test_a_model_of_the_robots_file_deforms_it_and_the_springs_do_where_it_is_open() -> None:
    robot, path = kr500(gravity=(0.0, 0.0, 0.0)), path_of(kr500())
    push = Constant((0.0, 0.0, -900.0, 0.0, 0.0, 0.0))
    conclusions = np.full((2, 6, 6), np.nan)
    conclusions[:, 2, 2] = [1e-6, 3e-6]  # m/N, along z alone, linear between two values of q1
    system = FuzzySystem(Partition(("q1",), (np.array([0.0, 0.5]),)), conclusions)
    names = tuple(variable.name for variable in robot.actuated)
    rows = make_measurements(names, START[None], tcp=robot.tcp, displacement=np.zeros((1, 6)))
    real = with_model(robot, FuzzyCompliance(names, system), rows)
    by_springs = correct_path(Machine(robot), path, push, start=START)
    by_model = correct_path(Machine(robot, real), path, push, start=START)
    others = [0, 1, 3, 4, 5]
    np.testing.assert_allclose(by_model.before[:, others], by_springs.before[:, others], rtol=1e-3, atol=1e-8)
    q1 = START[0] + np.linspace(0.0, 0.2, len(path))
    np.testing.assert_allclose(by_model.before[:, 2], -900.0 * (1e-6 + 4e-6 * q1), rtol=1e-3)


def test_frames_of_path_and_tool_only_change_what_the_numbers_count_from() -> None:
    path = path_of(kr500())
    base = transform(rotation_from_vector(np.array([0.2, -0.4, 1.1])), np.array([0.3, 0.2, -0.5]))
    tool = transform(rotation_from_vector(np.array([1.0, 0.3, -0.2])), np.array([0.05, 0.02, 0.25]))
    plain = correct_path(Machine(kr500(), heavy()), path, start=START)
    frames = Frames(base, tool)
    there = frames.to_base(replace(path, poses=np.linalg.inv(base) @ path.poses @ tool))
    turned = correct_path(Machine(kr500(), heavy(), frames=frames), there, start=START)
    np.testing.assert_allclose(turned.commands @ np.linalg.inv(tool), plain.commands, atol=1e-8)
    np.testing.assert_allclose(turned.q, plain.q, atol=1e-8)


def test_the_load_acts_at_the_tip_of_the_tool() -> None:
    robot = kr500(gravity=(0.0, 0.0, 0.0))
    path = path_of(robot)
    tool = transform(np.eye(3), np.array([0.0, 0.0, 0.3]))
    machine = Machine(robot, frames=Frames(tool=tool))
    tips = replace(path, poses=path.poses @ tool)
    force = Constant((0.0, 0.0, -1000.0, 0.0, 0.0, 0.0))
    found = correct_path(machine, tips, force, start=START)
    arm = path.poses[:, :3, :3] @ [0.0, 0.0, 0.3]
    moment = np.cross(arm, [0.0, 0.0, -1000.0])
    at_flange = np.hstack([np.tile([0.0, 0.0, -1000.0], (len(path), 1)), moment])
    flange = correct_path(Machine(robot), replace(path, wrench=at_flange), FromPath(), start=START)
    np.testing.assert_allclose(found.before[:, 3:], flange.before[:, 3:], rtol=2e-3)
    np.testing.assert_allclose(
        found.before[:, :3], flange.before[:, :3] + np.cross(flange.before[:, 3:], arm), rtol=2e-3, atol=1e-7
    )


def test_taught_targets_are_corrected_for_the_load_alone() -> None:
    machine, path = Machine(kr500(), heavy()), path_of(kr500())
    assert np.abs(correct_path(machine, path, start=START).before).max() > 1e-3
    still = correct_path(machine, path, start=START, taught=True)
    assert np.abs(still.before).max() < 1e-12
    np.testing.assert_allclose(still.commands, path.poses, atol=1e-12)
    loaded = correct_path(machine, path, LOAD, start=START, taught=True)
    assert np.abs(loaded.before).max() > 1e-4
    assert np.abs(loaded.after).max() < 2e-8


def test_an_error_is_the_sum_of_geometry_deformation_and_effects() -> None:
    real, path = heavy(), path_of(kr500())
    machine = Machine(kr500(), real)
    found = correct_path(machine, path, LOAD, start=START)
    parts = error_parts(machine, found, LOAD)
    np.testing.assert_allclose(sum(parts.values()), found.before, atol=1e-12)
    bare = real.model_copy(update={"effects": ()})
    rigid = bare.with_parameters(dict.fromkeys(stiffness_parameters(bare), np.inf))
    still = correct_path(Machine(kr500(), rigid), path, start=START).before
    np.testing.assert_allclose(parts[GEOMETRY], still, atol=1e-9)
    without = correct_path(Machine(kr500(), bare), path, LOAD, start=START).before
    np.testing.assert_allclose(parts[DEFORMATION], without - still, atol=1e-9)
    assert np.abs(parts[EFFECTS][:, :3]).max() > 1e-5
    # of taught targets the load's share alone, which no geometry has
    taught = correct_path(machine, path, LOAD, start=START, taught=True)
    shares = error_parts(machine, taught, LOAD, taught=True)
    assert [*shares] == [DEFORMATION, EFFECTS]
    np.testing.assert_allclose(sum(shares.values()), taught.before, atol=1e-12)
    alone = correct_path(Machine(kr500(), bare), path, LOAD, start=START, taught=True).before
    np.testing.assert_allclose(shares[DEFORMATION], alone, atol=1e-7)


def test_what_start_values_add_is_what_a_robot_rigid_there_lacks() -> None:
    robot = heavy()
    names = ("J1.torsional", "J2.torsional", "J4.torsional")  # J3 has the backlash
    guessed = robot.model_copy(update={"unmeasured": names})
    rigid = robot.with_parameters(dict.fromkeys(names, np.inf))
    path = path_of(robot)
    q = START + np.linspace(0, 0.2, 6)[:, None] * [1, -1, 0.5, 1, 1, 1]
    wrench = LOAD.wrench(path.poses, path)
    whole, without = (Machine(one).moved(q, wrench, path.poses) for one in (guessed, rigid))
    found = from_start_values(Machine(guessed), q, wrench, path.poses)
    # the loaded machine's stiffness is of second order in the deflection
    np.testing.assert_allclose(found, whole - without, atol=0.02 * np.abs(whole - without).max())
    assert not from_start_values(Machine(robot), q, wrench, path.poses).any()


def test_positions_alone_keep_their_orientations() -> None:
    machine, path = Machine(kr500(), heavy()), path_of(kr500())
    found = correct_path(machine, path, LOAD, start=START, positions_only=True)
    np.testing.assert_array_equal(found.commands[:, :3, :3], path.poses[:, :3, :3])
    assert np.abs(found.after[:, :3]).max() < 2e-8
    assert np.abs(found.after[:, 3:]).max() > 1e-3
    by_file = correct_path(machine, path_of(kr500(), turns=False), LOAD, start=START)
    np.testing.assert_allclose(by_file.commands, found.commands, atol=1e-12)


def test_a_planar_robot_is_corrected_in_its_plane() -> None:
    robot = load_robot("ir663")
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 0, 3], poses[:, 2, 3] = np.linspace(1.6, 1.8, 5), 1.0
    none = np.zeros(5, dtype=np.bool_)
    path = ToolPath("p", tuple("ABCDE"), np.arange(5), poses, none, stated=False)
    found = correct_path(Machine(robot), path, Constant((0.0, 300.0, -900.0, 0.0, 0.0, 0.0)))
    assert not found.reasons
    assert np.abs(found.before[:, [0, 2]]).max() > 1e-3
    assert np.abs(found.after[:, [0, 2]]).max() < 2e-8
    np.testing.assert_allclose(found.after[:, 1], found.before[:, 1], rtol=0.01)  # nothing moves that way


def test_a_target_that_cannot_be_reached_stays_and_is_told() -> None:
    path = path_of(kr500())
    path.poses[2, :3, 3] += [5.0, 0, 0]
    found = correct_path(Machine(kr500()), path, LOAD, start=START)
    assert list(found.reasons) == [2]
    np.testing.assert_array_equal(found.commands[2], path.poses[2])
    assert np.isnan(found.before[2]).all()
    assert np.isnan(found.after[2]).all()
    assert np.abs(found.after[found.corrected]).max() < 2e-8


def test_a_correction_beyond_the_reach_is_told() -> None:
    # the arm is stretched: square to it, where the load pushes the tool, there is no way back on a longer arm
    kinematics = compile_kinematics(kr500())
    stretched = float(-np.arctan2(0.055, 1.025))
    poses = pose_of(kinematics, posture(kinematics, [[0.0, -0.5, stretched, 0.0, 0.3, 0.0]]), "n6b")
    path = ToolPath("p", ("A",), np.array([7]), poses, np.ones(1, dtype=np.bool_))
    load = Constant((0.0, 0.0, -9000.0, 0.0, 0.0, 0.0))
    found = correct_path(Machine(kr500()), path, load, positions_only=True)
    assert found.reasons[0].startswith("its correction is out of reach by")
    np.testing.assert_array_equal(found.commands, poses)
    np.testing.assert_allclose(found.after, found.before, atol=1e-9)


@dataclass(frozen=True)
class Wall:
    """A stiff spring along z at the tool: far stiffer than the robot."""

    stiffness: float
    height: float

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        load = np.zeros((len(tool), 6))
        load[:, 2] = -self.stiffness * (tool[:, 2, 3] - self.height)
        return load


def test_a_process_stiffer_than_the_robot_is_in_equilibrium_with_it() -> None:
    robot = kr500(gravity=(0.0, 0.0, 0.0))
    path = path_of(robot, 1)
    height = float(path.poses[0, 2, 3]) + 1e-3
    unit = correct_path(Machine(robot), path, Constant((0, 0, 1.0, 0, 0, 0)), start=START).before[0, 2]
    for stiffness in (0.3 / unit, 3.0 / unit):
        found = correct_path(Machine(robot), path, Wall(stiffness, height), start=START)
        # two springs in series: the tool moves a share of the way to where the wall wants it
        share = stiffness * unit / (1 + stiffness * unit)
        assert found.before[0, 2] == pytest.approx(share * 1e-3, rel=1e-3)
        assert np.abs(found.after).max() < 1e-7


def test_loads_of_the_path_and_others_add_up() -> None:
    path = path_of(kr500())
    loads = np.tile([100.0, 0, -300, 0, 0, 0], (len(path), 1))
    both = Together((FromPath(), Constant((200.0, -200.0, -600.0, 10.0, -20.0, 30.0))))
    machine = Machine(kr500())
    summed = correct_path(machine, replace(path, wrench=loads), both, start=START)
    np.testing.assert_allclose(
        summed.before, correct_path(machine, path, LOAD, start=START).before, rtol=1e-9
    )


def test_robots_with_other_joints_are_refused() -> None:
    with pytest.raises(
        BeamstiffError, match="found the actuated variables q2, q8, expected those of 'kr500'"
    ):
        Machine(kr500(), load_robot("ir663"))


def test_orientations_are_needed_where_postures_follow_from_them() -> None:
    path = replace(path_of(kr500()), stated=False)
    with pytest.raises(BeamstiffError, match="path: found no orientations, expected columns a, b, c"):
        correct_path(Machine(kr500()), path, LOAD)


def test_the_robot_takes_postures_like_those_it_was_measured_in_unless_the_path_states_its_own() -> None:
    robot, path = kr500(), path_of(kr500())
    wrist = START + np.array([0.0, 0.0, 0.0, np.pi, -2 * START[4], -np.pi])  # turned over: the same pose
    names = [variable.name for variable in robot.actuated]
    for middle in (START, wrist):
        around = {name: (at - 0.5, at + 0.5) for name, at in zip(names, middle.tolist(), strict=True)}
        machine = Machine(robot, robot.with_fitted_rows([], around))
        assert correct_path(machine, path, LOAD).q[0] == pytest.approx(middle, abs=0.05)
        stated = replace(path, stated_postures=(StatedPosture("S 2", wrist_down=True),) * len(path))
        assert correct_path(machine, stated, LOAD).q[0] == pytest.approx(START, abs=0.05)


def test_a_tool_on_a_planar_robot_is_refused() -> None:
    machine = Machine(load_robot("ir663"), frames=Frames(tool=transform(np.eye(3), np.array([0.1, 0, 0]))))
    with pytest.raises(BeamstiffError, match="fewer than six joints: its tool has to be its TCP"):
        correct_path(machine, path_of(kr500()), LOAD)


def test_without_correction_a_load_acts_where_its_tool_came_to() -> None:
    # its lever about the flange, 0.4 m long, has turned with the tool
    tool = transform(rotation_from_vector(np.array([0.3, -0.2, 0.5])), np.array([0.1, 0.05, 0.4]))
    machine, path = Machine(kr500(), heavy(), frames=Frames(tool=tool)), path_of(kr500())
    kinematics = compile_kinematics(kr500())
    tip = path.moved_to(path.poses @ tool)
    found = correct_path(machine, tip, LOAD, start=START)
    q = START + np.linspace(0, 0.2, len(path))[:, None] * [1, -1, 0.5, 1, 1, 1]
    assert np.allclose(pose_of(kinematics, posture(kinematics, q), "n6b"), path.poses)
    at = tip.poses
    for _ in range(8):
        wrench = np.tile(LOAD.value, (len(path), 1))
        at = machine.displaced(machine.undeformed(q), machine.moved(q, wrench, at))
    expected = at[:, :3, 3] - tip.poses[:, :3, 3]
    np.testing.assert_allclose(found.before[:, :3], expected, rtol=0, atol=1e-9)


def test_beside_a_stretched_wrist_a_command_is_found() -> None:
    # the correction turns the tool by as much as the wrist is bent: a small step of it turns joint 4 far
    kinematics = compile_kinematics(kr500())
    q = np.tile(START, (5, 1))
    q[:, 4] = [1e-2, 3e-3, 1e-3, 3e-4, -1e-3]
    poses = pose_of(kinematics, posture(kinematics, q), "n6b")
    path = ToolPath("path", tuple("abcde"), np.arange(1, 6), poses, np.full(5, True))
    found = correct_path(Machine(kr500(), heavy()), path, LOAD, start=q[0])
    assert not found.reasons
    assert np.abs(found.before[:, 3:]).min(axis=0).max() > 1e-4
    assert np.abs(found.after).max() < 4e-7


def test_lost_motion_follows_the_way_of_the_path_as_programmed() -> None:
    half = 2e-4
    lost = AddedEffect(
        effect="approach-direction",
        component="q2",
        shape="direction of the last motion",
        parameters={"half_lost_motion": f"{half} rad"},
    )
    robot = kr500()
    path = path_of(robot)  # on which q2 falls
    found = correct_path(Machine(robot, kr500(effects=(lost,))), path, start=START)
    assert np.abs(found.after).max() < 1e-8
    commanded = found.q - found.q_before
    np.testing.assert_allclose(commanded[1:, 1], half, atol=1e-6)
    np.testing.assert_allclose(commanded[0], 0.0, atol=1e-9)  # from which side it comes nobody knows
