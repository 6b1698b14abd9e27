"""Which small faults in the numerical core and in the decision no test notices.

    pip install 'mutmut>=3.8'
    python -m benchmarks.mutants [core] [decision] [--sample 200] [--seed 0] [--jobs 1]

mutmut makes a copy of every function for each small fault (a sign, a constant, an argument left out) and runs
the tests of the area on each of a sample. What survives is listed with its difference: some are no faults
(`dtype=None` for numbers that are floats already), the others lack a test.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[1]
NEEDED = ("beamstiff", "benchmarks", "docs", "examples", "robots", "tests", "pyproject.toml", "README.md")
AREAS = {
    "core": (["beamstiff/fem/*.py"], ["tests/fem", "tests/model"]),
    "decision": (
        ["beamstiff/diagnosis/decision/*.py", "beamstiff/diagnosis/decomposition/*.py"],
        ["tests/diagnosis/decision", "tests/diagnosis/decomposition"],
    ),
}
NONE = "none"  # a name that no mutant has: mutmut makes them all, and runs nothing


def main() -> None:
    """Print a table of what was found, and the survivors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("areas", nargs="*", default=[*AREAS], choices=[*AREAS])
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    for area in asked.areas:
        with TemporaryDirectory(prefix="mutants-") as folder:
            _study(Path(folder), area, asked.sample, asked.seed, asked.jobs)


def _study(folder: Path, area: str, sample: int, seed: int, jobs: int) -> None:
    for name in NEEDED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    code, tests = AREAS[area]
    with (folder / "pyproject.toml").open("a") as project:
        config = {
            "source_paths": ["beamstiff"],
            "only_mutate": code,
            "pytest_add_cli_args_test_selection": tests,
            "also_copy": [name for name in NEEDED if name != "beamstiff"],
        }
        project.write("\n[tool.mutmut]\n")
        project.writelines(f"{key} = {json.dumps(value)}\n" for key, value in config.items())
    _mutmut(folder, "run", NONE)
    names = sorted(_codes(folder))
    chosen = sorted(random.Random(seed).sample(names, min(sample, len(names))))
    _mutmut(folder, "run", "--max-children", str(jobs), *chosen)
    codes = _codes(folder)
    said = {name: _how(codes[name]) for name in chosen}
    counts = Counter((name.rpartition(".")[0], how) for name, how in said.items())
    table = Table(title=f"{area}: {len(chosen)} of {len(names)} mutants, seed {seed}")
    for head in ("module", "noticed", "survived", "not run"):
        table.add_column(head, justify="left" if head == "module" else "right")
    for module in sorted({module for module, _ in counts}):
        table.add_row(module, *(str(counts[module, how]) for how in ("noticed", "survived", "not run")))
    every = Counter(said.values())
    table.add_row("all", *(str(every[how]) for how in ("noticed", "survived", "not run")))
    Console(width=110).print(table)
    for name in chosen:
        if said[name] == "survived":
            lines = _mutmut(folder, "show", name).splitlines()
            changed = [line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")]
            print(name, *changed, sep="\n  ")


def _how(code: int | None) -> str:
    return "not run" if code is None else "noticed" if code else "survived"


def _codes(folder: Path) -> dict[str, int | None]:
    """Return how the tests ended on every mutant; None: they did not run."""
    found: dict[str, int | None] = {}
    for path in (folder / "mutants").rglob("*.meta"):
        found |= json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"]
    return found


def _mutmut(folder: Path, *words: str) -> str:
    run = [sys.executable, "-m", "mutmut", *words]
    single = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(run, cwd=folder, env=single, capture_output=True, text=True, check=False).stdout


if __name__ == "__main__":
    main()
