"""A base that the real robot taught by three points: the workpiece stands where its tool was."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff.compensation.formats import read_program
from beamstiff.compensation.rewrite import Compensated
from beamstiff.errors import BeamstiffError
from beamstiff.functions.compensate import compensate
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, pose_of, posture
from beamstiff.robot.parts import AddedEffect, Frame, Mass
from beamstiff.robot.reader import load_robot
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array, rotation_from_vector, transform, vector_from_rotation
from tests.compensation.test_path_correction import BACKLASH

TEXT = "".join(f"LIN {{X {x},Y {y},Z 20,A 10,B 30,C 180}}\n" for x, y in ((0, 0), (250, 40), (400, 300)))
BASE = transform(rotation_from_vector(np.array([0.02, -0.03, 0.4])), np.array([1.3, -0.2, 0.8]))
POINTS = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.1, 0.3, 0.0]])
LOAD = [300.0, -200.0, -900.0, 0.0, 0.0, 0.0]


def rigid(robot: Robot) -> Robot:
    return robot.with_parameters(dict.fromkeys(stiffness_parameters(robot), np.inf))


def bent() -> Robot:
    """Return a rigid KR500 whose second axis has another zero and whose arm is longer."""
    robot = rigid(load_robot("kr500"))
    changes = {"f2": {"theta": "q2 + 0.002"}, "f4": {"r": "1027 mm"}}
    nodes = tuple(
        node.model_copy(update={"at": (-0.055, 1.027, 0.0)}) if node.name == "n4a" else node
        for node in robot.nodes
    )
    frames = tuple(frame.model_copy(update=changes.get(frame.name, {})) for frame in robot.frames)
    return robot.model_copy(update={"frames": frames, "nodes": nodes})


def shifted(robot: Robot) -> Robot:
    """Return a robot that stands elsewhere on the floor, and askew, with all that it is."""
    frames = tuple(
        frame.model_copy(update={"parent": "floor"}) if frame.parent == "base" else frame
        for frame in robot.frames
    )
    floor = Frame(name="floor", gamma=0.01, b=0.005, alpha=0.004, d=-0.003, theta=0.002, r=0.001)
    nodes = tuple(
        node.model_copy(update={"frame": "floor"}) if node.frame == "base" else node for node in robot.nodes
    )
    return robot.model_copy(update={"frames": (floor, *frames), "nodes": nodes})


def corrected(folder: Path, actual: Robot, points: Array | None = POINTS, **more: object) -> Compensated:
    (folder / "a.src").write_text(TEXT)
    options = {"base": BASE, "base_taught": points} | more
    return compensate("kr500", folder / "a.src", actual=actual, **options)  # type: ignore[arg-type]


def test_a_robot_that_stands_elsewhere_taught_its_errors_away(tmp_path: Path) -> None:
    real = shifted(rigid(load_robot("kr500")))
    assert np.abs(corrected(tmp_path, real, None).correction.before[:, :3]).min() > 1e-4
    found = corrected(tmp_path, real)
    assert np.abs(found.correction.before).max() < 1e-9
    assert found.content == TEXT.encode()  # the commands stay in the controller's base, as they were
    # the workpiece stands where the base frame of the robot went
    floor = pose_of(compile_kinematics(real), posture(compile_kinematics(real), np.zeros((1, 6))), "n0")[0]
    np.testing.assert_allclose(found.taught_base, floor @ BASE, atol=1e-9)


def test_the_error_is_what_forward_kinematics_alone_say(tmp_path: Path) -> None:
    """The joint values are checked by the controller's kinematics, the rest is done by hand."""
    real, found = bent(), corrected(tmp_path, bent())
    taught = found.correction.taught_base
    assert taught is not None

    def at(robot: Robot, q: Array) -> Array:
        return pose_of(compile_kinematics(robot), posture(compile_kinematics(robot), q), "n6b")

    targets = read_program(tmp_path / "a.src").path.poses
    sent = transform((BASE @ targets[0])[:3, :3], (BASE[:3, :3] @ POINTS.T).T + BASE[:3, 3])
    np.testing.assert_allclose(at(load_robot("kr500"), taught.q), sent, atol=1e-8)
    origin, on_x, in_plane = at(real, taught.q)[:, :3, 3]
    x = (on_x - origin) / np.linalg.norm(on_x - origin)
    y = in_plane - origin - x * (x @ (in_plane - origin))
    y /= np.linalg.norm(y)
    base = transform(np.array([x, y, np.cross(x, y)]).T, origin)
    q = found.correction.q_before
    np.testing.assert_allclose(at(load_robot("kr500"), q), BASE @ targets, atol=1e-8)
    landed, meant = at(real, q), base @ targets
    np.testing.assert_allclose(
        found.correction.before[:, :3], landed[:, :3, 3] - meant[:, :3, 3], rtol=0, atol=1e-8
    )
    turned = vector_from_rotation(landed[:, :3, :3] @ meant[:, :3, :3].swapaxes(1, 2))
    np.testing.assert_allclose(found.correction.before[:, 3:], turned, rtol=0, atol=1e-8)
    assert np.abs(found.correction.before[:, :3]).max() > 1e-5
    assert np.abs(found.after).max() < 2e-6
    said = found.to_dict()["base_taught"]
    np.testing.assert_allclose(said, [*origin, *vector_from_rotation(base[:3, :3])], atol=1e-8)


def heavy() -> Robot:
    slack = AddedEffect(**{**BACKLASH.model_dump(), "std": {"half_width": "0.01 mrad"}})
    spindle = Mass(node="n6b", mass=300.0, at=(0.0, 0.0, 0.3))
    return shifted(load_robot("kr500")).model_copy(update={"effects": (slack,), "masses": (spindle,)})


def test_weight_load_and_effects_are_corrected_against_the_taught_base(tmp_path: Path) -> None:
    found = corrected(tmp_path, heavy(), wrench=LOAD)
    measured = corrected(tmp_path, heavy(), None, wrench=LOAD)
    before = np.linalg.norm(found.correction.before[:, :3], axis=1)
    assert before.min() > 1e-4
    assert before.max() < 0.5 * np.linalg.norm(measured.correction.before[:, :3], axis=1).min()
    assert np.abs(found.after).max() < 2e-6  # what rounding leaves
    assert np.abs(found.correction.after).max() < 2e-8
    # geometry, deformation and effects each teach a base of their own, and add up to the error
    np.testing.assert_allclose(sum(found.parts.values()), found.correction.before, atol=1e-12)
    assert np.abs(found.parts["geometry"]).max() < 1e-9  # the robot stands elsewhere, no more


def test_the_base_is_taught_under_weight_and_without_the_load_of_the_process(tmp_path: Path) -> None:
    """It stands where targets at the three points, taught by the same unloaded robot, are."""
    loaded, free = (corrected(tmp_path, heavy(), **more) for more in ({"wrench": LOAD}, {}))
    assert loaded.taught_base is not None
    np.testing.assert_allclose(loaded.taught_base, free.taught_base, atol=1e-12)
    (tmp_path / "points.src").write_text(
        "".join(f"LIN {{X {x},Y {y},Z 0,A 10,B 30,C 180}}\n" for x, y, _ in 1e3 * POINTS)
    )
    q = loaded.correction.q_before[0]
    points = compensate("kr500", tmp_path / "points.src", actual=heavy(), base=BASE, q=q, taught=True)
    origin, on_x, in_plane = points.correction.targets[:, :3, 3]
    inverse = np.linalg.inv(loaded.taught_base)
    seen = [(inverse @ [*point, 1.0])[:3] for point in (origin, on_x, in_plane)]
    np.testing.assert_allclose(seen[0], 0, atol=1e-9)
    np.testing.assert_allclose(seen[1][1:], 0, atol=1e-9)
    assert seen[1][0] > 0
    assert abs(seen[2][2]) < 1e-9
    assert seen[2][1] > 0


def test_each_point_is_touched_as_the_tool_stands_at_the_target_nearest_to_it(tmp_path: Path) -> None:
    """So the errors are those of the targets, whatever their order, and touched targets keep their plane."""
    places = ((0, 0, 30), (400, 0, 10), (100, 300, -10))
    lines = [f"LIN {{X {x},Y {y},Z 0,A 10,B {turn},C 180}}\n" for x, y, turn in places]
    errors = []
    for order in ((0, 1, 2), (2, 1, 0)):
        (tmp_path / "a.src").write_text("".join(lines[one] for one in order))
        found = compensate("kr500", tmp_path / "a.src", actual=heavy(), base=BASE, base_taught=POINTS)
        errors.append(found.correction.before[np.argsort(order)])
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-8)
    np.testing.assert_allclose(errors[0][:, :3] @ BASE[:3, 2], 0, atol=1e-5)
    np.testing.assert_allclose(errors[0][0, :3], 0, atol=1e-8)  # the first point is met


def test_what_is_told_to_remain_with_a_taught_base_has_all_of_the_process_load(tmp_path: Path) -> None:
    """What a load moves everywhere alike is in no base: the robot touched off without it."""
    told = corrected(tmp_path, heavy(), None, wrench=LOAD).differs_mm
    taught = corrected(tmp_path, heavy(), wrench=LOAD).correction.before[:, :3]
    assert told == pytest.approx(1e3 * np.sqrt((taught**2).sum(axis=1).mean()), rel=0.3)
    unloaded = corrected(tmp_path, heavy(), None).differs_mm
    assert unloaded is not None
    assert unloaded < 0.5 * told


def test_standard_deviations_count_from_the_taught_base(tmp_path: Path) -> None:
    """Beside finite differences: another half width moves robot and base."""
    names = ("J2.torsional", "J3.torsional")
    real = heavy()
    std = {name: 0.05 * stiffness_parameters(real)[name] for name in names}
    found = corrected(tmp_path, real, std=std, wrench=LOAD)
    assert found.std is not None
    wider = real.effects[0].model_copy(update={"parameters": {"half_width": "0.11 mrad"}})
    others = [real.model_copy(update={"effects": (wider,)})]
    others += [real.with_parameters({name: stiffness_parameters(real)[name] + std[name]}) for name in names]
    changes = [
        corrected(tmp_path, other, wrench=LOAD).correction.before - found.correction.before
        for other in others
    ]
    expected = np.sqrt(sum(change**2 for change in changes))
    np.testing.assert_allclose(found.std, expected, rtol=0.1, atol=2e-7)
    alone = corrected(tmp_path, real, None, std=std, wrench=LOAD)
    assert alone.std is not None
    assert np.linalg.norm(found.std[0, :3]) < 0.7 * np.linalg.norm(alone.std[0, :3])


def test_start_values_count_from_the_taught_base(tmp_path: Path) -> None:
    real = heavy().model_copy(update={"unmeasured": ("J2.torsional",)})
    stiff = real.with_parameters({"J2.torsional": np.inf})
    gone = [corrected(tmp_path, robot, wrench=LOAD).correction.before for robot in (real, stiff)]
    most = 1e3 * np.linalg.norm((gone[0] - gone[1])[:, :3], axis=1).max()
    [said] = [one for one in corrected(tmp_path, real, wrench=LOAD).notes if "start values" in one]
    assert float(said.split()[2]) == pytest.approx(most, rel=0.05)


def test_the_taught_base_needs_points_that_make_a_frame_within_reach(tmp_path: Path) -> None:
    line, far = POINTS.copy(), POINTS.copy()
    line[2] = [0.9, 0.0, 0.0]
    far[1, 0] = 9.0
    for points, told in (
        (POINTS[:2], r"base_taught: found 2 points, expected three: the origin, a point on x and"),
        (np.vstack([POINTS, POINTS[:1]]), "base_taught: found 4 points, expected three"),
        (np.zeros(3), r"base_taught: found an array of shape \(3,\), expected three"),
        (line, "base_taught: found three points on one line"),
        (np.zeros((3, 3)), "base_taught: found three points on one line"),
        (far, "base_taught: the point on x is out of reach by"),
    ):
        with pytest.raises(BeamstiffError, match=told):
            corrected(tmp_path, heavy(), points)


def test_the_taught_base_goes_with_one_frame_and_no_taught_targets(tmp_path: Path) -> None:
    with pytest.raises(BeamstiffError, match="base_taught: found together with taught, expected one of"):
        corrected(tmp_path, heavy(), taught=True)
    with pytest.raises(BeamstiffError, match="base_taught: found together with measured, expected one of"):
        corrected(tmp_path, heavy(), measured=[tmp_path / "run.csv"])
    several = "$BASE={X 1300,Y 0,Z 0,A 0,B 0,C 0}\n" + TEXT + "$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}\n" + TEXT
    (tmp_path / "b.src").write_text(several)
    with pytest.raises(BeamstiffError, match="base_taught: found a path of several frames, expected one"):
        compensate("kr500", tmp_path / "b.src", base_taught=POINTS)
