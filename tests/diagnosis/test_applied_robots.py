"""Whatever effect a diagnosis writes at whatever robot, every function takes the file."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import beamstiff
from beamstiff import Robot, load_robot
from beamstiff.diagnosis.added_effect import added_effect
from beamstiff.diagnosis.apply import readable, written_std
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, nominal_pose, predict
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.overview import describe
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.library import robot_names, robot_path
from beamstiff.robot.reference import reference_posture
from beamstiff.robot.yaml_edit import robot_yaml
from beamstiff.se3 import vector_from_rotation

POSES, LOADS, SIGMA = 16, 4, 1e-5
QUICK = ("kr240-2",)
NOT_YET = {("kr240-2", "payload-error")}  # second diagnosis of absolute rows: unknown; why is not known
OF_ALL = [(robot, effect) for robot in robot_names() for effect in EFFECTS if effect != "outliers"]


@cache
def rows_of(name: str, absolute: bool, seed: int = 0) -> Measurements:
    """Return postures and loads of a bundled robot, read as without any effect."""
    robot, random = load_robot(name), np.random.default_rng(seed)
    kinematics = compile_kinematics(robot)
    ends = np.array([one.limits or (-1.0, 1.0) for one in robot.actuated]).reshape(-1, 2)
    middle = reference_posture(robot)
    drawn = middle + 0.3 * (ends[:, 1] - ends[:, 0]) * random.uniform(-1.0, 1.0, (60, len(ends)))
    drawn = np.clip(drawn, ends[:, 0], ends[:, 1])
    q = np.repeat(drawn[close_loops(kinematics, drawn, strict=False).closed][:POSES], LOADS, axis=0)
    wrench = np.zeros((len(q), 6))
    wrench[:, :3] = random.uniform(-400.0, 400.0, (len(q), 3))
    wrench[1::LOADS] = -wrench[::LOADS]
    names = [one.name for one in robot.actuated]
    common = {"tcp": robot.tcp, "wrench": wrench, "time": 60.0 * np.arange(len(q))}
    common |= {"temperature": 20.0 + 0.1 * np.arange(len(q)), "sigma_position": SIGMA}
    if absolute:
        return make_measurements(names, q, position=np.zeros((len(q), 3)), **common)
    return make_measurements(names, q, displacement=np.zeros((len(q), 3)), **common)


def read(robot: Robot, rows: Measurements) -> Measurements:
    """Return rows as a robot with its effects reads them, without noise."""
    moved = predict(robot, rows)
    if rows.kind == "displacement":
        return replace(rows, displacement=np.pad(moved[:, :3], ((0, 0), (0, 3)), constant_values=np.nan))
    return replace(rows, position=nominal_pose(robot, rows)[0] + moved[:, :3])


@cache
def view_of(name: str, absolute: bool) -> Baseline:
    return fit_baseline(load_robot(name), rows_of(name, absolute), keep=())


def applied(name: str, effect: str) -> tuple[Robot, bool] | None:
    """Return a robot with an effect as a diagnosis writes it, and whether absolute rows show it alone."""
    random = np.random.default_rng([OF_ALL.index((name, effect)), 1])
    law = EFFECTS[effect]
    for absolute in (False, True):
        view = view_of(name, absolute)
        components = law.components(view)
        if not components:
            continue
        component = components[int(random.integers(len(components)))]
        shapes = [
            one
            for one in law.shapes(view, component)
            if not one.data_selected and not any(item.posture_specific for item in one.parameters)
        ]
        if not shapes:
            continue
        chosen = [shapes[at] for at in random.permutation(len(shapes))[:2]]
        parts = []
        for weight, shape in zip((0.7, 0.3) if len(chosen) > 1 else (1.0,), chosen, strict=True):
            sizes = np.array([item.size for item in shape.parameters])
            signs = [1.0 if item.positive else random.choice([-1.0, 1.0]) for item in shape.parameters]
            values = 0.3 * sizes * np.array(signs)
            parts.append((shape, weight, values, 0.02 * np.abs(values)))
        entry = added_effect(view, effect, component, parts)
        robot = load_robot(name)
        return readable(robot.model_copy(update={"effects": (entry,)})), absolute
    return None


def commands(file: Path, robot: Robot, name: str, absolute: bool) -> Iterator[str]:
    """Call everything that takes a robot with effects; yield what was called."""
    describe(load_robot(file), samples=5)
    yield "show"
    shown = read(robot, rows_of(name, absolute))
    beamstiff.predict(file, shown)
    yield "deflect"
    assert beamstiff.verify(file, shown).after < 1e-7
    yield "verify"
    if load_robot(name).identify and not absolute:
        beamstiff.identify(file, shown, folds=0)
        yield "identify"
    places = read(robot, rows_of(name, True))
    beamstiff.calibrate(file, places, ["base"], folds=0)
    yield "calibrate"
    kinematics = compile_kinematics(robot)
    at, turned = nominal_pose(robot, rows_of(name, True))
    lines = ["# orientation: rotation vector", "x,y,z,a,b,c"]
    for row in range(0, 2 * LOADS, LOADS):
        place = (*at[row], *vector_from_rotation(turned[row : row + 1])[0])
        lines.append(",".join(repr(float(value)) for value in place))
    path = file.parent / "path.csv"
    path.write_text("\n".join(lines) + "\n")
    assert kinematics.node_index
    beamstiff.compensate(name, path, actual=file, wrench=[0, 0, -100, 0, 0, 0], q=rows_of(name, True).q[0])
    yield "compensate"
    axis = robot.actuated[0].name
    low = float(rows_of(name, True).q[0, 0])
    held = dict(zip([one.name for one in robot.actuated], rows_of(name, True).q[0].tolist(), strict=True))
    del held[axis]
    beamstiff.map_workspace(
        load_robot(file), {axis: np.array([low, low + 1e-3])}, held=held, quantities=("sag",)
    )
    yield "map"


def check(tmp_path: Path, name: str, effect: str, again: bool) -> None:
    made = applied(name, effect)
    if made is None:
        pytest.skip("the library has no such place in this robot")
    robot, absolute = made
    file = tmp_path / "applied.yaml"
    source = robot_path(name)
    text = robot_yaml(robot, source, written_std(robot))
    file.write_text(text, encoding="utf-8")
    kept = [line for line in source.read_text(encoding="utf-8").splitlines() if "#" in line]
    assert all(line in text for line in kept)  # comments, and the units beside them
    assert text.count(f"effect: {effect}") == 1
    assert load_robot(file).effects == robot.effects
    called = list(commands(file, load_robot(file), name, absolute))
    assert {"show", "deflect", "verify", "calibrate", "compensate", "map"} <= set(called)
    if again:
        rows = read(robot, rows_of(name, absolute, seed=5))
        verdict = beamstiff.diagnose(file, rows).verdict.effect
        if verdict != "none" and (name, effect) in NOT_YET:
            pytest.xfail(f"the second diagnosis says {verdict}")
        assert verdict == "none"


@pytest.mark.parametrize(("name", "effect"), [pair for pair in OF_ALL if pair[0] in QUICK])
def test_what_is_written_is_taken_by_all_that_reads_robots(tmp_path: Path, name: str, effect: str) -> None:
    check(tmp_path, name, effect, again=False)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "effect"), OF_ALL)
def test_nothing_is_left_to_find_beside_what_is_written(tmp_path: Path, name: str, effect: str) -> None:
    check(tmp_path, name, effect, again=True)
