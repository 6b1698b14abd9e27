"""What a diagnosis writes is taken by every command: ``python -m benchmarks.applied_effects [ROBOT ..] [N]``.

For every bundled robot and every effect of the library, and for N random arms (default 50; effects and places
by turns): a robot with the effect as `diagnose --apply` writes it (two shapes of it with weights where it has
two), comments of the file kept. `show`, `deflect`, `identify`, `calibrate`, `compensate`, `verify` and `map`
have to take the file, and a second diagnosis of its own readings without noise has to say `none`. Prints how
often each did, by effect, and every case that did not.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import beamstiff
from beamstiff import Robot, load_robot
from beamstiff.diagnosis.added_effect import added_effect
from beamstiff.diagnosis.apply import readable, written_std
from beamstiff.diagnosis.effects import EFFECTS
from beamstiff.diagnosis.residual.baseline import Baseline, fit_baseline, nominal_pose, predict
from beamstiff.exam.robots import random_arm
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.overview import describe
from beamstiff.robot.closure import close_loops
from beamstiff.robot.kinematics import compile_kinematics, reference_posture
from beamstiff.robot.library import robot_names, robot_path
from beamstiff.robot.reader import parse_robot
from beamstiff.robot.writer import robot_to_yaml
from beamstiff.robot.yaml_edit import robot_yaml
from beamstiff.se3 import vector_from_rotation

POSES, LOADS, SIGMA = 12, 4, 1e-5
RANDOM = "random-arm-"
ARMS = 50
EXACT = 1e-7  # m: what a robot leaves of its own readings
APPLIED = tuple(name for name in EFFECTS if name != "outliers")
COMMANDS = ("show", "deflect", "verify", "identify", "calibrate", "compensate", "map")
ALONG = "# the robot of a user, with a remark\n"


@cache
def source_of(name: str) -> str:
    """Return the file of a bundled robot, or of a random arm by its number."""
    if not name.startswith(RANDOM):
        return robot_path(name).read_text(encoding="utf-8")
    arm = random_arm(np.random.default_rng(int(name.removeprefix(RANDOM))))
    return ALONG + robot_to_yaml(arm)


@cache
def robot_of(name: str) -> Robot:
    """Return a bundled robot, or a random arm by its number."""
    return parse_robot(source_of(name), name) if name.startswith(RANDOM) else load_robot(name)


@cache
def rows_of(name: str, absolute: bool, seed: int = 0) -> Measurements:
    """Return postures and loads of a robot, read as without any effect."""
    robot, random = robot_of(name), np.random.default_rng(seed)
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
    """Return what effects of a robot are evaluated for."""
    return fit_baseline(robot_of(name), rows_of(name, absolute), keep=())


@dataclass(frozen=True)
class Case:
    """A robot with an effect as a diagnosis writes it, and whether absolute rows show it alone."""

    name: str
    effect: str
    robot: Robot
    absolute: bool

    @property
    def text(self) -> str:
        """The robot's file."""
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder) / "robot.yaml"
            source.write_text(source_of(self.name), encoding="utf-8")
            return robot_yaml(self.robot, source, written_std(self.robot))

    def second(self) -> str:
        """Return what a second diagnosis says, of other readings without noise."""
        rows = read(self.robot, rows_of(self.name, self.absolute, seed=5))
        return beamstiff.diagnose(self.robot, rows).verdict.effect


def case_of(name: str, effect: str) -> Case | None:
    """Return a robot with an effect at a place drawn; None where the library has no such place in it."""
    random = np.random.default_rng([len(name), *map(ord, name), APPLIED.index(effect)])
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
        robot = readable(robot_of(name).model_copy(update={"effects": (entry,)}))
        return Case(name, effect, robot, absolute)
    return None


def taken(case: Case, file: Path) -> Iterator[str]:
    """Call everything that takes a robot's file; yield what was called."""
    name, robot = case.name, load_robot(file)
    describe(robot, samples=5)
    yield "show"
    shown = read(robot, rows_of(name, case.absolute))
    beamstiff.predict(file, shown)
    yield "deflect"
    left = beamstiff.verify(file, shown).after
    assert left < EXACT, f"leaves {1e3 * left:.2g} mm of its own readings"
    yield "verify"
    if robot.identify and not case.absolute:
        beamstiff.identify(file, shown, folds=0)
        yield "identify"
    beamstiff.calibrate(file, read(robot, rows_of(name, True)), ["base"], folds=0)
    yield "calibrate"
    if not robot.actuated:  # no path and no map of a beam
        return
    at, turned = nominal_pose(robot, rows_of(name, True))
    lines = ["# orientation: rotation vector", "x,y,z,a,b,c"]
    for row in range(0, 2 * LOADS, LOADS):
        place = (*at[row], *vector_from_rotation(turned[row : row + 1])[0])
        lines.append(",".join(repr(float(value)) for value in place))
    path = file.with_name("path.csv")
    path.write_text("\n".join(lines) + "\n")
    q = rows_of(name, True).q[0]
    beamstiff.compensate(robot_of(name), path, actual=file, wrench=[0, 0, -100, 0, 0, 0], q=q)
    yield "compensate"
    axis, low = robot.actuated[0].name, float(q[0])
    held = dict(zip([one.name for one in robot.actuated[1:]], q[1:].tolist(), strict=True))
    beamstiff.map_workspace(robot, {axis: np.array([low, low + 1e-3])}, held=held, quantities=("sag",))
    yield "map"


def pairs_by_turns(robots: list[str], arms: int) -> list[tuple[str, str]]:
    """Return robots and effects by turns, another effect for each robot: fair where it is interrupted."""
    count, pairs = len(APPLIED), []
    for turn in range(count):
        pairs += [(name, APPLIED[(turn + 7 * at) % count]) for at, name in enumerate(robots)]
        pairs += [(f"{RANDOM}{arm}", APPLIED[arm % count]) for arm in range(arms) if 7 * arm % count == turn]
    return pairs


def run(
    pairs: list[tuple[str, str]],
    counts: dict[str, Counter[str]],
    robots: dict[str, Counter[str]],
    console: Console,
) -> None:
    """Try cases one after the other; count what they did by effect and by robot."""
    for name, effect in pairs:
        begun, case, what = time.process_time(), case_of(name, effect), "writing"
        count, of_robot = counts[effect], robots.setdefault(name.rstrip("0123456789"), Counter())
        if case is None:
            of_robot["no such place"] += 1
            continue
        of_robot["cases"] += 1
        count["cases"] += 1
        try:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "applied.yaml"
                file.write_text(case.text, encoding="utf-8")
                for what in taken(case, file):
                    count[what] += 1
                    of_robot["calls"] += 1
            what = "second diagnosis"
            verdict = case.second()
            count["none" if verdict == "none" else "other verdict"] += 1
            of_robot["none" if verdict == "none" else "other verdict"] += 1
            kind = "absolute" if case.absolute else "displacements"
            console.print(f"{name} {effect}: taken; second diagnosis of {kind}: {verdict}", style="dim")
        except Exception as error:  # of whatever kind: it is counted, and the next case is tried
            of_robot["failed"] += 1
            count["failed"] += 1
            console.print(f"{name} {effect}: after {what}: {type(error).__name__}: {error}", style="red")
        of_robot["s"] += round(time.process_time() - begun)


def main() -> None:
    """Print the counts."""
    console = Console(width=150)
    asked = [word for word in sys.argv[1:] if not word.isdigit()]
    arms = next((int(word) for word in sys.argv[1:] if word.isdigit()), ARMS)
    counts: dict[str, Counter[str]] = {effect: Counter() for effect in APPLIED}
    robots: dict[str, Counter[str]] = {}
    try:
        run(pairs_by_turns(asked or list(robot_names()), arms), counts, robots, console)
    except KeyboardInterrupt:
        console.print("interrupted: the cases so far")
    for title, of, columns in (
        ("by effect", counts, ("cases", *COMMANDS, "none", "other verdict", "failed")),
        ("by robot", robots, ("cases", "no such place", "calls", "none", "other verdict", "failed", "s")),
    ):
        table = Table(title, *columns, title="Robots as diagnose --apply writes them", title_justify="left")
        for name, count in of.items():
            table.add_row(name, *(str(count[column]) for column in columns))
        table.add_row("all", *(str(sum(count[column] for count in of.values())) for column in columns))
        console.print(table)


if __name__ == "__main__":
    main()
