"""Compensation on line against the exact one, and its line protocol."""

from pathlib import Path

import numpy as np
import pytest

from beamstiff import compensate, compensate_online, load_robot
from beamstiff.compensation.stream import OnlineTargets
from beamstiff.errors import BeamstiffError
from beamstiff.robot.parts import AddedEffect
from beamstiff.robot.stiffness_parameters import stiffness_parameters

TEXT = "PTP {X 2500,Y 100,Z 1600,A 0,B 90,C 10,S 2}\nLIN {X 2500,Y 140,Z 1600,A 0,B 90,C 10}\n"
LOAD = np.array([300.0, -200, -900, 20, 30, -10])


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a program of two targets."""
    path = tmp_path_factory.mktemp("online") / "cell.src"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def targets(program: Path) -> OnlineTargets:
    """Return the program made ready."""
    return compensate_online("kr500", program, load_std=[5, 5, 20, 1, 1, 1])


@pytest.mark.parametrize("scale", [0.0, 1.0, -2.0])
def test_a_warm_call_is_the_exact_correction(program: Path, targets: OnlineTargets, scale: float) -> None:
    exact = compensate("kr500", program, wrench=scale * LOAD, load_std=[5, 5, 20, 1, 1, 1])
    for row in range(2):
        answer = targets.command(row, scale * LOAD)
        assert answer.warm
        np.testing.assert_allclose(answer.command, exact.correction.commands[row], atol=1e-6)
        np.testing.assert_allclose(answer.q, exact.correction.q[row], atol=1e-4)
        assert exact.std is not None
        np.testing.assert_allclose(answer.std, exact.std[row], rtol=0.02, atol=1e-9)


def test_a_pose_elsewhere_is_answered_cold_and_then_warm(targets: OnlineTargets) -> None:
    pose = targets.poses[0].copy()
    pose[:3, 3] += [-0.3, 0.2, -0.2]
    first, second = (targets.command_at(pose, LOAD) for _ in range(2))
    assert (first.warm, second.warm) == (False, True)
    np.testing.assert_allclose(first.command, second.command, atol=1e-9)


def test_standard_deviations_are_those_of_the_stiffness(program: Path) -> None:
    robot = load_robot("kr500")
    known = stiffness_parameters(robot)
    name = "J2.torsional"
    found = compensate(robot, program, wrench=LOAD, std={name: 0.1 * known[name]})
    # a second formulation: the correction of a robot whose joint is a hundredth softer
    softer = compensate(robot.with_parameters({name: 0.999 * known[name]}), program, wrench=LOAD)
    moved = (softer.correction.before - found.correction.before) / 0.001 * 0.1
    assert found.std is not None
    np.testing.assert_allclose(found.std, np.abs(moved), rtol=0.01, atol=1e-8)


def test_effects_whose_parameters_were_fitted_together_have_no_standard_deviation(program: Path) -> None:
    """Their correlation is not in the file: as independent ones they would count many times what they are."""
    sides = {"shape": "flank within 0.03, asymmetric", "parameters": {"width_up": 1e-4, "width_down": 2e-4}}
    one, both = (BACKLASH | sides | {"std": dict.fromkeys(names, 1e-5)} for names in (SIDES[:1], SIDES))
    result = {}
    for name, entry in (("one", one), ("both", both)):
        real = load_robot("kr500").model_copy(update={"effects": (AddedEffect(**entry),)})
        result[name] = compensate("kr500", program, actual=real, wrench=LOAD, leave_doubtful=True)
    assert result["one"].std is not None
    assert result["both"].std is not None
    assert result["one"].std[0, :3].max() > 1e-6
    assert not result["both"].std[0].any()
    said = "leave out backlash:q3: its parameters were fitted together"
    assert any(said in note for note in result["both"].notes)
    assert not any(said in note for note in result["one"].notes)


def test_doubtful_corrections_are_left_alone_on_request(program: Path) -> None:
    weak, strong = 0.02 * LOAD, LOAD
    for load, left in ((weak, True), (strong, False)):
        online = compensate_online("kr500", program, load_std=0.1 * np.abs(LOAD), leave_doubtful=True)
        assert online.command(0, load).left_alone == left
        result = compensate("kr500", program, wrench=load, load_std=0.1 * np.abs(LOAD), leave_doubtful=True)
        assert (result.left_alone == (0, 1)) == left
        assert (result.content == TEXT.encode()) == left


def test_the_protocol_answers_every_line(targets: OnlineTargets) -> None:
    lines = [
        "target PTP 1 300 -200 -900 20 30 -10\n",
        "target #2\n",
        "\n",
        "pose 2.5 0.1 1.6 0 1.5707963267948966 0\n",
        "target LIM 2\n",
        "target #3\n",
        "target PTP 1 1 2 x 0 0 0\n",
        "pose 1 2\n",
        "pose 9 9 9 0 0 0\n",
        "quit\n",
        "target #1\n",
    ]
    out: list[str] = []
    targets.serve(lines, out.append)
    assert out[0] == "ready beamstiff-stream/1 2 6"
    answers = out[1:]
    assert [answer.split()[0] for answer in answers] == [*["ok"] * 3, *["error"] * 5]
    words = answers[0].split()
    assert len(words) == 1 + 6 + 6 + 6 + 2
    np.testing.assert_allclose(
        np.array(words[1:4], dtype=float), targets.command(0, LOAD).command[:3, 3], atol=1e-8
    )
    assert "found no target 'LIM 2' (did you mean 'LIN 2'?)" in answers[3]
    assert "found target number 3, expected 1 to 2" in answers[4]
    assert "expected numbers, SI" in answers[5]
    assert "out of reach" in answers[7]


SIDES = ("width_up", "width_down")
BACKLASH = {
    "effect": "backlash",
    "component": "q3",
    "shape": "flank within 0.03",
    "parameters": {"half_width": 1e-4},
    "std": {"half_width": 1e-5},
    "scales": {"torque": 3000.0},
}
HARDENING = {
    "effect": "hardening",
    "component": "q2",
    "shape": "cubic",
    "parameters": {"softening_at_largest_torque": 3e-4},
    "scales": {"torque": 3000.0},
}


def test_slips_by_a_torque_are_warm_on_both_sides_of_their_kink(program: Path) -> None:
    effects = tuple(AddedEffect(**entry) for entry in (BACKLASH, HARDENING))
    real = load_robot("kr500").model_copy(update={"effects": effects})
    load_std = np.array([5.0, 5, 20, 1, 1, 1])
    online = compensate_online("kr500", program, actual=real, load_std=load_std)
    slips = []
    for push in np.linspace(-200.0, 200.0, 9):  # through the torque's zero, in steps within the flank
        load = np.array([0.2 * push, 0.0, push, 0, 0, 0])
        answer = online.command(0, load)
        assert answer.warm
        slips.append(answer.correction[2])
        if push in (-200.0, 50.0):
            exact = compensate("kr500", program, actual=real, wrench=load, load_std=load_std)
            np.testing.assert_allclose(answer.command, exact.correction.commands[0], atol=1e-6)
            assert exact.std is not None
            np.testing.assert_allclose(answer.std, exact.std[0], rtol=0.05, atol=1e-7)
    bends = np.abs(np.diff(slips, 2))
    assert bends.max() > 1e-5  # the kink is in it


def test_a_robot_of_fewer_joints_is_refused(program: Path) -> None:
    with pytest.raises(BeamstiffError, match="fewer than six joints"):
        compensate_online("ir663", program)
