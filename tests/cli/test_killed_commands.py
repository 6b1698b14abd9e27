"""A command that is killed leaves what is the user's, no half of a file, and no trouble for the next run."""

import json
import random
import shutil
import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from beamstiff.outputs import LEDGER, check_replaceable
from benchmarks.kill_study import Command, ended, start
from tests.cli.test_user_files import COMMANDS, OTHERS, lay_out, outputs_of, quick, run, state, typed

__all__ = ["quick"]
# what is not the user's where a command knows the name: a folder of chunks is refused as a whole
MINE = [name for name in OTHERS if name != LEDGER and ".parts/" not in name and "case-" not in name]


@pytest.mark.skipif(sys.platform != "linux", reason="copies of a process, killed")
@pytest.mark.parametrize("name", sorted(set(COMMANDS) - {"doctor"}))
def test_a_killed_command_leaves_the_users_files_and_no_half_of_its_own(name: str, tmp_path: Path) -> None:
    command, draw = Command(name, tuple(typed(name))), random.Random(name)
    whole, first = tmp_path / "whole", tmp_path / "first"
    for one in (whole, first):
        one.mkdir()
        lay_out(one)
    assert run(name, first).exit_code == 0  # what takes long is remembered by the copies of this process
    assert ended(start(command, whole, count_to=tmp_path / "count")) == 0, (tmp_path / "stderr").read_text()
    operations = int((tmp_path / "count").read_text())
    for again in (False, True):  # with nothing there, and over what the command wrote before
        folder, outside = tmp_path / f"here-{again}", tmp_path / f"there-{again}"
        outside.mkdir()
        if again:
            shutil.copytree(whole, folder)
        else:
            folder.mkdir()
            lay_out(folder)
        for other in MINE:
            (folder / other).write_bytes(b"mine")
        before = state(folder, outside)
        outputs = {str(path): path for path in (folder / file for file in outputs_of(name).values())}
        code = ended(start(command, folder, die_at=draw.randint(1, operations)))
        assert code in (0, -signal.SIGKILL)  # over its own files it may do less
        after = state(folder, outside)
        for path, was in before.items():
            if path not in outputs and Path(path).name != LEDGER and "/reports" not in path:
                assert after.get(path) == was
        for path in outputs.values():
            if path.suffix == ".jsonl" and path.exists():
                assert all(json.loads(line) for line in path.read_text().splitlines(keepends=True)[:-1])
            elif path.is_file():
                check_replaceable(path)  # whole, with its seal
        assert run(name, folder).exit_code == 0
        left = {path.name for path in folder.rglob("*")} - {path.name for path in whole.rglob("*")}
        assert left == set(MINE)


def test_the_files_above_are_of_no_command() -> None:
    written: Any = {file for name in COMMANDS for file in outputs_of(name).values()}
    assert not written & set(MINE)
