"""Mutated tables: a table whose every number is finite, or one line that says what is wrong; nothing else."""

import random
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.measure.reader import parse_measurements, read_measurements
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from tests.malformed import damaged
from tests.measure import conftest

SEEDS = [
    """# source: bench
# sigma_position: 0.03 mm
# sigma_rotation: 0.002 deg
q1 [deg],d2 [mm],fx,fz [N],dx [mm],dy [mm],rx [rad],pose,step,t [s],point
10,250,0,-900,0.123,-0.5,1e-4,0,0,0,tip
10,250,0,-450,0.061,,5e-5,0,1,60,
-20,300,100,-450,0.1,0.2,-1e-5,1,0,120,elbow
""",
    """# unloaded_reading: independent
# orientation: KUKA ABC
q1,d2,x [mm],y [mm],z,A [deg],B [deg],C [deg],temperature,load_point
0.1,0.2,1000,-20.5,1.1,90,-10,180,20.5,tip
0.1,0.2,1001,-20.4,1.1,,,,,
""",
    """# decimal: comma
# history: continuous
q1 [deg];d2 [mm];mx [N*m];dx [um];sigma_dx [um]
1,5;2;3,25;-40;5
1,5;2;6,5;-80;
""",
    'q1,d2,"dx","pose"\r\n0,1,"1e-3","P1"\r\n0,1,2e-3,P1\r\n',
]


arm = conftest.arm


def check(table: Measurements, text: str) -> None:
    """Check what a table promises: all numbers finite, NaN for "not measured" and nothing else."""
    n = len(table)
    assert n > 0
    assert np.isfinite(table.q).all()
    assert np.isfinite(table.wrench).all()
    assert table.q.shape == (n, 2)
    assert not np.isinf(table.measured).any()
    assert table.measured_mask.any()
    assert not np.isnan(table.measured[table.measured_mask]).any()
    assert not (table.sigma <= 0).any()
    assert not np.isinf(table.sigma).any()
    for sigma in (table.sigma_position, table.sigma_rotation):
        assert sigma is None or (np.isfinite(sigma) and sigma > 0)
    for optional in (table.step, table.time, table.temperature):
        assert not np.isinf(optional).any()
    assert set(table.point.tolist()) | set(table.load_point.tolist()) <= {"root", "elbow", "tip"}
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    assert (table.rows >= 2).all()
    assert (np.diff(table.rows) > 0).all()
    for row, line in enumerate(table.rows.tolist()):
        filled = [
            cell for cell in lines[line - 1].replace(";", ",").replace("\t", ",").split(",") if cell.strip()
        ]
        assert filled, "a row without a cell"
        assert table.measured_mask[row].sum() <= len(filled), "more was measured than is in the line"


def read_or_refused(text: str, robot: Robot) -> bool:
    """Return whether a text was read; either way it must be done at once and as promised."""
    start = time.perf_counter()
    message = ""
    try:
        table = parse_measurements(text, robot, "fuzz.csv")
    except BeamstiffError as error:
        message = str(error)
    assert time.perf_counter() - start < 10
    if not message:
        check(table, text)
        return True
    assert message.startswith("fuzz.csv")
    assert len(message.splitlines()) == 1
    assert len(message) < 1000
    return False


def test_the_tables_that_are_mutated_can_be_read(arm: Robot) -> None:
    for text in SEEDS:
        assert read_or_refused(text, arm)


def test_the_mutations_leave_some_tables_readable_and_spoil_most(arm: Robot) -> None:
    source = random.Random(1)
    read = sum(read_or_refused(damaged(source.choice(SEEDS), source, SEEDS), arm) for _ in range(300))
    assert 15 < read < 200


ALL = settings(max_examples=10_000, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@given(source=st.randoms(use_true_random=False))
@settings(ALL, max_examples=4_000)
def test_mutated_tables_are_read_or_refused(source: random.Random, arm: Robot) -> None:
    read_or_refused(damaged(source.choice(SEEDS), source, SEEDS), arm)


@pytest.mark.slow
@given(source=st.randoms(use_true_random=False))
@settings(ALL)
def test_ten_thousand_mutated_tables_are_read_or_refused(source: random.Random, arm: Robot) -> None:
    read_or_refused(damaged(source.choice(SEEDS), source, SEEDS), arm)


def test_random_bytes_are_read_or_refused(arm: Robot, tmp_path: Path) -> None:
    source = random.Random(3)
    path = tmp_path / "fuzz.csv"
    for _ in range(200):
        data = bytearray(source.choice(SEEDS).encode())
        for _ in range(source.randint(1, 6)):
            data[source.randrange(len(data))] = source.randrange(256)
        path.write_bytes(data if source.random() < 0.8 else source.randbytes(200))
        message = ""
        try:
            table = read_measurements(path, arm)
        except BeamstiffError as error:
            message = str(error)
        if message:
            assert message.startswith(str(path))
        else:
            check(table, path.read_bytes().decode("utf-8-sig"))
