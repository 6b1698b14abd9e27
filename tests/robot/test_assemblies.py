"""Names of assemblies: the same whatever the guess, the drives' posture and small changes of the geometry."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, Frame, Loop, Node, Robot
from beamstiff.robot.closure import assembly_doubts, close_loops, every_assembly
from beamstiff.robot.frames import Kinematics, compile_frames
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.loops import loop_equations, loop_system
from beamstiff.robot.reader import load_robot, parse_robot
from beamstiff.robot.writer import robot_to_yaml
from tests.robot.machines import (
    D3,
    D10,
    D11,
    LAMBDA2,
    Array,
    four_bar_points,
    four_bar_th3,
    ir663,
    machine,
    prismatic,
    revolute,
    screw_driven_ir663,
    slider_crank,
    slider_crank_theta2,
)


def guessed(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return the robot with guesses anywhere."""
    variables = [
        item.model_copy(update={"guess": float(rng.uniform(-np.pi, np.pi))}) if item.passive else item
        for item in robot.variables
    ]
    return robot.model_copy(update={"variables": tuple(variables)})


def moved(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return the robot with every frame off by up to 1 mm and 1 mrad, within the plane of its loops."""
    frames = []
    for frame in robot.frames:
        along, turn = rng.uniform(-1e-3, 1e-3, 2)
        more = {"d": f"{frame.d} {along:+.6f}", "theta": f"{frame.theta} {turn:+.6f}"}
        frames.append(frame.model_copy(update=more))
    return robot.model_copy(update={"frames": tuple(frames)})


def named(robot: Robot, name: str) -> Kinematics:
    return compile_kinematics(robot.model_copy(update={"assembly": name}))


def sides(kinematics: Kinematics, values: Array) -> list[tuple[int, ...]]:
    """Return on which side each dyad of the screw-driven IR-663 bends, (P): screws 2 and 8, four-bar."""
    at = dict(zip(kinematics.coupling.names, values.T, strict=True))
    bends = (
        at["q2"] - np.pi / 2 - at["s2"],  # lug against screw: crank at q2 - 90 deg
        at["q8"] - at["s8"],
        at["q2"] - np.pi / 2 + at["th3"] + np.pi / 2 - at["q8"] - at["th9"],  # lever against coupler
    )
    return [tuple(row) for row in np.sign(np.sin(np.array(bends))).astype(int).T.tolist()]


def test_the_names_of_planar_loops_are_the_sides_on_which_they_bend_whatever_the_guess_and_geometry() -> None:
    rng, robot = np.random.default_rng(1), screw_driven_ir663()
    known: dict[str, tuple[int, ...]] = {}
    fewest = 8
    for changed in (robot, *(guessed(robot, rng) for _ in range(4)), *(moved(robot, rng) for _ in range(3))):
        kinematics = compile_frames(changed)  # some guesses are equally near to two
        found = every_assembly(kinematics)
        fewest = min(fewest, len({one.name for one in found}))
        free = np.array([one.free for one in found])
        for one, side in zip(found, sides(kinematics, free), strict=True):
            assert known.setdefault(one.name, side) == side
    assert len(known) == len(set(known.values()))
    # of the four ways to bend the screws, two let the four-bar close everywhere, each in two ways
    always = []
    r2, r8 = np.random.default_rng(0).uniform([0.7, 0.75], [1.1, 0.95], (2000, 2)).T
    q2 = np.arcsin((r2**2 - 0.4**2 - 0.8**2) / (2 * 0.4 * 0.8))
    q8 = np.arccos((r8**2 - 0.3**2 - 0.7**2) / (2 * 0.3 * 0.7))
    for swing in (q2, np.pi - q2):
        for crank in (q8, -q8):
            apart = np.linalg.norm(np.subtract(*four_bar_points(swing, crank)), axis=1)
            always.append(((apart > D11 - D10) & (apart < D10 + D11)).all())
    assert fewest >= 2 * sum(always) == 4


def test_a_named_assembly_has_its_name_at_every_posture_of_the_drives() -> None:
    robot = screw_driven_ir663()
    q = np.random.default_rng(0).uniform([0.75, 0.76], [1.05, 0.94], (50, 2))
    for one in every_assembly(compile_kinematics(robot)):
        kinematics = named(robot, one.name)
        closure = close_loops(kinematics, q, strict=False)
        values = closure.values[closure.closed]
        assert len(values)
        assert set(sides(kinematics, values)) == set(sides(kinematics, one.free[None]))
        jacobian = loop_equations(loop_system(kinematics), values)[1][:, :, 2:]
        assert set(kinematics.assembly.patterns(jacobian)) == {one.name}


@pytest.mark.parametrize("constrain", ["position", "plane"])
def test_either_assembly_of_a_four_bar_is_picked_by_name_from_any_guess(constrain: str) -> None:
    rng = np.random.default_rng(2)
    q = rng.uniform([0.0, np.radians(-40), np.radians(20)], [0.0, np.radians(50), np.radians(75)], (40, 3))
    p3, p9 = four_bar_points(q[:, 1], q[:, 2])
    q = q[np.linalg.norm(p3 - p9, axis=1) < D3]  # away from where the branches meet
    robot = ir663(constrain=constrain)
    branch_of = {}
    for changed in (robot, *(guessed(robot, rng) for _ in range(5))):
        for name in "+-":
            kinematics = named(changed, name)
            assert assembly_doubts(kinematics) == ()
            th3 = close_loops(kinematics, q).values[:, kinematics.coupling.names.index("th3")]
            off = {
                branch: np.abs(np.sin(0.5 * (th3 + np.pi / 2 - four_bar_th3(q[:, 1], q[:, 2], branch)))).max()
                for branch in (1, -1)
            }
            branch = min(off, key=lambda at: off[at])
            assert off[branch] < 1e-12
            assert branch_of.setdefault(name, branch) == branch
    assert sorted(branch_of.values()) == [-1, 1]


def test_a_name_decides_where_two_are_equally_near() -> None:
    # in line: both sides of the dead centre are mirror images of one another
    robot = slider_crank(float(np.pi / 2 - LAMBDA2), psi=0.0)
    one = r"phi = .* \(assembly '[+-]'.* off\)"
    both = f"equally near to the guesses: {one}; {one}.* name it .*--assembly"
    with pytest.raises(BeamstiffError, match=both):
        compile_kinematics(robot)
    screw = np.linspace(0.6, 1.2, 20)
    for name in "+-":
        kinematics = named(robot, name)
        theta2 = close_loops(kinematics, screw[:, None]).values[:, kinematics.coupling.names.index("theta2")]
        off = [np.abs(np.sin(0.5 * (theta2 - slider_crank_theta2(screw, at)))).max() for at in (1, -1)]
        assert min(off) < 1e-12


def test_an_unknown_name_is_refused_with_those_there_are() -> None:
    with pytest.raises(
        BeamstiffError, match=r"robot 'machine': found assembly '\+\+', expected one of (\+, -|-, \+)$"
    ):
        named(ir663(), "++")


def tilted(angle: float) -> Robot:
    """Return a four-bar whose plane is skew to the frame that its loop's rows are written in."""
    return machine(
        [revolute("q"), revolute("p", passive=True, guess=-1.0), revolute("r", passive=True, guess=1.0)],
        [
            Frame(name="crank", theta="q"),
            Frame(name="coupler", parent="crank", d=0.5, theta="p"),
            Frame(name="end", parent="coupler", d=1.0, alpha=angle, beta=angle),
            Frame(name="rocker", d=1.0, theta="r"),
            Frame(name="other", parent="rocker", d=0.8),
        ],
        tool=("coupler", (1.0, 0, 0)),
        loops=[Loop(name="four_bar", a="end", b="other", constrain="position")],
    )


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 4, np.pi / 2, 2.0])
def test_names_stay_under_small_turns_of_a_plane_that_is_skew_to_its_rows(angle: float) -> None:
    bends = []
    for turn in (-1e-3, 0.0, 1e-3):
        found = every_assembly(compile_kinematics(tilted(angle + turn)))
        # the coupler against the rocker
        bends.append({one.name: float(np.sign(np.sin(one.free[:2].sum() - one.free[2]))) for one in found})
    assert bends[0] == bends[1] == bends[2]
    assert sorted(bends[0]) == ["+", "-"]


def test_the_name_is_part_of_the_robot_file() -> None:
    text = robot_to_yaml(load_robot("ir663").model_copy(update={"assembly": "-"}))
    assert parse_robot(text).assembly == "-"
    assert parse_robot(text.replace('"-"', "+2")).assembly == "+2"  # a number for YAML
    with pytest.raises(BeamstiffError, match=r"assembly: found '\+', but the robot has no closed loops"):
        parse_robot(robot_to_yaml(load_robot("cantilever")) + 'assembly: "+"\n')


def test_an_assembly_whose_nearest_posture_is_its_dead_centre_counts_with_its_distance_there() -> None:
    # a crank of 0.7 and a screw about a pivot at (1, 0): the two ways mirror each other at the line of pivots
    # and meet where screw and crank stretch; the distance to each is that to its curve of closed postures
    crank, rng = 0.7, np.random.default_rng(5)
    inner = np.linspace(0.0, np.pi, 4001)[1:-1]  # of the crank, on the upper side
    end = crank * np.stack([np.cos(inner), np.sin(inner)], axis=1) - [1.0, 0.0]
    screw = np.linalg.norm(end, axis=1)
    curve = np.stack([inner, np.arctan2(end[:, 1], end[:, 0])], axis=1)
    mean = 0.5 * (screw.min() + screw.max())
    for _ in range(12):
        guess = np.array([np.pi, np.pi]) + rng.uniform(-0.7, 0.7, 2)  # about the dead centre
        robot = machine(
            [
                prismatic("s", limits=(screw.min() - 0.1, screw.max() + 0.1), guess=mean),
                revolute("crank", passive=True, guess=float(guess[0])),
                revolute("screw", passive=True, guess=float(guess[1])),
            ],
            [
                Frame(name="f1", theta="crank"),
                Frame(name="e1", parent="f1", d=crank),
                Frame(name="f2", d=1.0, theta="screw"),
                Frame(name="e2", parent="f2", d="s"),
            ],
            tool=("e1", (0.0, 0.0, 0.0)),
            loops=[Loop(name="screw", a="e1", b="e2", constrain="position")],
            nodes=[Node(name="nut", frame="e2")],
        )
        expected = []
        for side in (1.0, -1.0):
            away = side * curve - guess
            away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
            expected.append(np.linalg.norm(away, axis=1).min())
        found = [one.distance for one in every_assembly(compile_frames(robot))]
        assert found == pytest.approx(sorted(expected), abs=0.02)
