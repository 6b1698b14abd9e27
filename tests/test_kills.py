"""The kill study, with a few of its kills; benchmarks/kill_study.py makes 200."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="copies of a process, killed")
def test_jobs_that_are_killed_come_to_the_same_end() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.kill_study", "--kills", "12"],
        cwd=Path(__file__).resolve().parents[1],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    total = next(line for line in done.stdout.splitlines() if line.startswith("all"))
    assert total.split()[1] == "12"
