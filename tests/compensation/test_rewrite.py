"""From file to corrected file: what is told of it is what stands in it."""

import csv
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest

from beamstiff import forward_kinematics
from beamstiff.compensation import rewrite
from beamstiff.compensation.formats import krl, path_csv
from beamstiff.compensation.machine import Machine
from beamstiff.compensation.path_correction import Correction, errors_of
from beamstiff.compensation.process.load import Constant
from beamstiff.compensation.rewrite import compensate_program
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array

TEXT = "".join(f"LIN {{X 1500,Y {y},Z 900,A 0,B 110,C 0}}\n" for y in (-100, 0, 100))
LOAD = Constant((0.0, 0.0, -900.0, 0.0, 0.0, 0.0))
MACHINE = Machine(load_robot("kr500"))


def test_the_error_told_is_that_of_the_numbers_written() -> None:
    result = compensate_program(krl.read(TEXT, "a.src"), MACHINE, LOAD)
    written = krl.read(result.content.decode("latin-1"), "a.src").path.poses
    np.testing.assert_array_equal(result.after, errors_of(MACHINE, result.correction, written, LOAD))
    rounding = np.linalg.norm(result.after[:, :3], axis=1)
    assert rounding.max() < 0.9e-6  # half a micrometre in three directions
    assert rounding.max() > 1e-8
    assert np.abs(result.correction.after).max() < 2e-8


def test_a_command_that_rounding_takes_out_of_reach_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def rounded(machine: Machine, correction: Correction, commands: Array, load: Constant) -> Array:
        errors = errors_of(machine, correction, commands, load)
        errors[1] = np.nan if 1 not in correction.reasons else errors[1]
        return errors

    monkeypatch.setattr(rewrite, "errors_of", rounded)
    result = compensate_program(krl.read(TEXT, "a.src"), MACHINE, LOAD)
    assert list(result.correction.reasons) == [1]
    assert "rounded" in result.correction.reasons[1]
    assert result.content.splitlines()[1] == TEXT.encode().splitlines()[1]
    assert result.known.all()


def test_the_joint_values_that_are_written_reach_the_commands() -> None:
    result = compensate_program(krl.read(TEXT, "a.src"), MACHINE, LOAD)
    heads, *rows = csv.reader(StringIO(result.joint_table()))
    assert heads == ["name", *(f"{one.name} [deg]" for one in MACHINE.controller.actuated)]
    q = np.radians([[float(value) for value in row[1:]] for row in rows])
    reached = forward_kinematics(MACHINE.controller, q)
    np.testing.assert_allclose(reached, result.correction.commands, atol=2e-6)
    gone = replace(result, correction=replace(result.correction, reasons={1: "out of reach"}))
    assert set(list(csv.reader(StringIO(gone.joint_table())))[2][1:]) == {""}


def test_a_resampled_path_follows_the_same_line() -> None:
    program = krl.read(TEXT, "a.src")
    result = compensate_program(program, MACHINE, LOAD, steps=(0.025, np.inf))
    path = path_csv.read(result.content.decode("utf-8"), "a.csv").path
    assert len(path) == 9
    assert path.names[:2] == ("LIN 1", "LIN 1+1/4")
    assert np.abs(result.after[:, :3]).max() < 1e-7
    sparse = krl.read(compensate_program(program, MACHINE, LOAD).content.decode("latin-1"), "a.src").path
    np.testing.assert_allclose(path.poses[::4, :3, 3], sparse.poses[:, :3, 3], atol=1e-6)


def test_columns_of_the_path_load_the_tool() -> None:
    rows = "".join(f"1.5,{y},0.9,0,{np.radians(110)},0,-900\n" for y in (-0.1, 0.0, 0.1))
    table = path_csv.read("x,y,z,a,b,c,fz\n" + rows, "a.csv")
    by_column = compensate_program(table, MACHINE).correction
    by_load = compensate_program(krl.read(TEXT, "a.src"), MACHINE, LOAD).correction
    np.testing.assert_allclose(by_column.before, by_load.before, rtol=1e-6, atol=1e-9)
