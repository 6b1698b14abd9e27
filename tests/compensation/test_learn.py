"""Learning from measured runs: parameters of simulated processes are found again, or told to be open."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from beamstiff import compensate, load_robot
from beamstiff.compensation.formats import krl
from beamstiff.compensation.learn import Run, learn
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.path_correction import correct_path, errors_of
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.files import parse_process
from beamstiff.compensation.process.load import Constant, FromPath, Process, Together
from beamstiff.compensation.process.parameters import LoadCell
from beamstiff.errors import BeamstiffError
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array

PROCESS = """kind: cantilever
length: 585 mm
width: 50 mm
thickness: 14 mm
E: 69 GPa
clamp: {at: [2285 mm, 0, 900 mm], x: [-1, 0, 0], z: [0, 0, 1]}
"""
DOWN = [(1710, 900 - depth) for depth in (0, 5, 10, 15, 20, 25)]
ALONG = [(1710 + 20 * step, 875) for step in range(1, 9)]
PROGRAM = "".join(f"LIN {{X {x},Y 0,Z {z},A 0,B 180,C 0}}\n" for x, z in DOWN + ALONG)
SIGMA = 1e-5


@pytest.fixture(scope="module")
def machine() -> Machine:
    """Return a machine whose model is right: only the process is not."""
    return Machine(load_robot("kr500"))


def path() -> ToolPath:
    """Return 25 mm down on a beam and along it towards the clamp."""
    return krl.read(PROGRAM, "a.src").path


def runs_of(machine: Machine, process: Process, sent: Process, where: ToolPath) -> tuple[Run, Array]:
    """Return a run of the commands that `sent` corrects, on a machine under `process`, and its errors."""
    truth = correct_path(machine, where, process)
    commands = correct_path(machine, where, sent).commands
    error = errors_of(machine, truth, commands, process)[:, :3]
    noise = np.random.default_rng(0).normal(0.0, SIGMA, error.shape)
    return Run(np.arange(len(where)), commands, where.poses[:, :3, 3] + error + noise), error


def test_friction_stiffness_and_clamp_are_found_and_what_is_left_is_small(machine: Machine) -> None:
    believed = parse_process(PROCESS)
    assert isinstance(believed, Cantilever)
    clamp = believed.clamp.copy()
    clamp[:3, 3] += clamp[:3, :3] @ [0.0, 0.0, -0.001]
    true = replace(believed, friction=0.2, modulus=0.93 * believed.modulus, clamp=clamp)
    run, before = runs_of(machine, true, believed, path())
    found = learn(machine, path(), believed, [run], SIGMA)
    assert found.pays
    values = {one.name: one for one in found.parameters}
    for name, truth in (("friction", 0.2), ("process stiffness", 0.93), ("clamp z", -0.001)):
        assert values[name].identifiable
        assert abs(values[name].value - truth) < 4 * values[name].std
    assert not values["clamp y"].identifiable  # along the beam's width nothing changes
    again, after = runs_of(machine, true, found.process, path())
    assert np.abs(after).max() < 0.1 * np.abs(before).max()
    assert not learn(machine, path(), believed, [run, again], SIGMA).pays


def test_gain_and_frame_of_a_load_cell_are_found(machine: Machine) -> None:
    where = path()
    random = np.random.default_rng(1)
    true = random.uniform(-1500.0, 1500.0, (len(where), 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    cell = LoadCell(1.04, (0.0, 0.02, 0.0))
    # what is read, so that cell and reading together are the truth
    read = true.copy()
    for _ in range(30):
        read += true - read - cell.wrench(where.poses, replace(where, wrench=read))
    own = replace(where, wrench=read)
    run, _ = runs_of(machine, Together((FromPath(), cell)), FromPath(), own)
    learned = learn(machine, own, LoadCell(), [run], SIGMA, beside=FromPath())
    assert json.loads(json.dumps(learned.to_dict()))["parameters"]["load-cell turn y"]["identifiable"]
    found = {one.name: one for one in learned.parameters}
    for name, truth in (("gain", 1.04), ("turn x", 0.0), ("turn y", 0.02), ("turn z", 0.0)):
        one = found[f"load-cell {name}"]
        assert one.identifiable
        assert abs(one.value - truth) < 4 * one.std


@pytest.mark.slow
def test_an_effect_of_the_machine_is_found_beside_the_process(machine: Machine) -> None:
    believed = parse_process(PROCESS)
    assert isinstance(believed, Cantilever)
    true = replace(believed, friction=0.2)
    offset = AddedEffect(effect="geometry-error", component="q1", shape="offset", parameters={"offset": 2e-4})
    real = Machine(machine.controller, machine.controller.model_copy(update={"effects": (offset,)}))
    truth = correct_path(real, path(), true)
    error = errors_of(real, truth, correct_path(machine, path(), believed).commands, true)[:, :3]
    seen = path().poses[:, :3, 3] + error + np.random.default_rng(0).normal(0.0, SIGMA, error.shape)
    run = Run(np.arange(len(seen)), correct_path(machine, path(), believed).commands, seen)
    found = learn(machine, path(), believed, [run], SIGMA, effects=2)
    [effect] = found.effects  # and no second one
    after = errors_of(real, truth, correct_path(found.machine, path(), found.process).commands, true)[:, :3]
    assert np.abs(after).max() < 0.1 * np.abs(error).max()
    alone = learn(machine, path(), believed, [run], SIGMA)
    without = errors_of(real, truth, correct_path(machine, path(), alone.process).commands, true)[:, :3]
    assert np.abs(after).max() < 0.2 * np.abs(without).max()
    assert (effect.effect, effect.component) == ("geometry-error", "q1")


def test_a_process_without_parameters_is_refused(machine: Machine) -> None:
    run, _ = runs_of(machine, Constant((0.0,) * 6), Constant((0.0,) * 6), path())
    with pytest.raises(BeamstiffError, match="the process has no parameters to learn"):
        learn(machine, path(), Constant((0.0,) * 6), [run])


def test_runs_are_read_from_files(machine: Machine, tmp_path: Path) -> None:
    believed = parse_process(PROCESS)
    assert isinstance(believed, Cantilever)
    run, _ = runs_of(machine, replace(believed, friction=0.15), believed, path())
    (tmp_path / "a.src").write_text(PROGRAM)
    (tmp_path / "p.yaml").write_text(PROCESS)
    first = compensate("kr500", tmp_path / "a.src", process=tmp_path / "p.yaml")
    (tmp_path / "first.src").write_bytes(first.content)
    rows = "".join(",".join(f"{1e3 * value:.6f}" for value in at) + "\n" for at in run.measured)
    (tmp_path / "run.csv").write_text("# sigma_position: 0.01 mm\nx [mm],y [mm],z [mm]\n" + rows)
    given = {"process": tmp_path / "p.yaml", "measured": [tmp_path / "run.csv"]}
    again = compensate("kr500", tmp_path / "a.src", ran=[tmp_path / "first.src"], **given)
    assert again.learned is not None
    [friction] = [one for one in again.learned.parameters if one.name == "friction"]
    assert abs(friction.value - 0.15) < 4 * friction.std < 0.1
    assert again.to_dict()["learned"]["parameters"]["friction"]["identifiable"]
    assert any("the run does not identify" in note and "clamp y" in note for note in again.notes)
    (tmp_path / "short.csv").write_text("x,y,z\n1,0,1\n")
    given["measured"] = [tmp_path / "short.csv"]
    with pytest.raises(BeamstiffError, match=r"short\.csv: found 1 rows for 14 targets"):
        compensate("kr500", tmp_path / "a.src", **given)
