"""`beamstiff doctor`: what is installed, and whether it calculates right."""

import os
import platform
import re
import sys
from importlib import metadata
from time import perf_counter
from typing import Any

import typer
from rich.console import Console

from beamstiff._version import __version__
from beamstiff.cli.group import THREADS
from beamstiff.cli.output import Outputs
from beamstiff.errors import BeamstiffError

DEVELOPERS = ("dev", "docs")  # extras that users do not miss
EXACT = 1e-9  # relative error of the self check
REQUIREMENT = re.compile(
    r"(?P<name>[\w.-]+)(?:\[.*?])?(?P<bounds>[^;]*)(?:.*extra\s*==\s*['\"](?P<extra>\w+))?"
)


def doctor(
    check: bool = typer.Option(True, "--check/--no-check", help="Compare a cantilever with its closed form."),
) -> None:
    """Check the installation.

    Prints the installed versions and optional parts, and whether they calculate correctly. Missing
    parts are named with the command that installs them. The self check takes a second: it compares
    the compliance of a clamped tube with its closed form. Exit code 2 if something must be repaired.
    Include the output when you report a bug.

    \b
    Examples:
      beamstiff doctor
      beamstiff doctor --json -
    """
    outputs = Outputs([])
    needed, optional = parts(_requirements())
    facts: dict[str, Any] = {
        "beamstiff": __version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "needed": needed,
        "optional": optional,
        "linear_algebra": linear_algebra(),
        "self_check": self_check() if check and all(one["fits"] for one in needed) else None,
    }
    found = problems(facts)
    _print(outputs.console, facts)
    if not found:
        outputs.console.print("Nothing to mend. Next: beamstiff show ir663")
    outputs.result([], [], {**facts, "problems": found})
    if found:
        raise BeamstiffError(f"doctor: {'; '.join(found)}")


def parts(requirements: list[str]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the libraries that are needed and those of optional parts, each with what is installed.

    `requirements`: as in the metadata of a package: ``"numba>=0.61; extra == 'fast'"``.
    """
    needed, optional = list[dict[str, Any]](), list[dict[str, Any]]()
    for requirement in requirements:
        found = REQUIREMENT.match(requirement)
        if found is None or found["extra"] in DEVELOPERS:
            continue
        installed = _installed(found["name"])
        least = re.search(r">=\s*([\d.]+)", found["bounds"])
        fits = installed is not None and (least is None or _numbers(installed) >= _numbers(least[1]))
        one = {"name": found["name"], "wanted": found["bounds"].strip(), "installed": installed, "fits": fits}
        if found["extra"]:
            optional.append({**one, "extra": found["extra"]})
        else:
            needed.append(one)
    return needed, optional


def _requirements() -> list[str]:
    try:
        return metadata.requires("beamstiff") or []
    except metadata.PackageNotFoundError:
        raise BeamstiffError(
            "doctor: beamstiff runs from a folder and is not installed, so what it needs is not known: "
            "pip install . in that folder"
        ) from None


def _installed(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def linear_algebra() -> dict[str, Any]:
    """Return what numpy calculates with, how many cores there are and how threads are limited."""
    try:
        import numpy as np

        built = dict(np.show_config(mode="dicts")["Build Dependencies"]["blas"])
        blas = f"{built.get('name', '?')} {built.get('version', '')}".strip()
    except (ImportError, KeyError, TypeError):
        blas = "unknown"
    return {
        "blas": blas,
        "cores": os.cpu_count(),
        "threads": {name: os.environ[name] for name in THREADS if name in os.environ},
    }


def self_check() -> dict[str, Any]:
    """Return the compliance of a clamped tube across its axis beside the closed form, and the time it took.

    Under a force across the axis the tip turns by ``L^2 / (2 E I)``, whatever is taken for the shear area.
    """
    from math import pi

    begun = perf_counter()
    from beamstiff import compile_structure, load_robot, posture, tcp_compliance

    structure = compile_structure(load_robot("cantilever"))
    compliance = tcp_compliance(structure, posture(structure.kinematics, {}))[0]
    length, modulus, outer, inner = 1.0, 210e9, 60e-3, 52e-3
    exact = length**2 / (2.0 * modulus * pi / 64.0 * (outer**4 - inner**4))
    error = abs(float(compliance[5, 1]) / exact - 1.0)
    return {"expected": exact, "found": float(compliance[5, 1]), "error": error, "s": perf_counter() - begun}


def problems(facts: dict[str, Any]) -> list[str]:
    """Return what must be mended, each with what to do."""
    found = [
        f"{one['name']} {one['installed'] or 'is missing'}, expected {one['wanted'] or 'any version'} "
        f"(pip install '{one['name']}{one['wanted']}')"
        for one in facts["needed"]
        if not one["fits"]
    ]
    check = facts["self_check"]
    if check is not None and not check["error"] < EXACT:
        found.append(
            f"the cantilever turns {check['found']:.10g} rad/N, expected {check['expected']:.10g}: install "
            "numpy and scipy anew, and report it with this output"
        )
    return found


def _print(console: Console, facts: dict[str, Any]) -> None:
    from beamstiff.report.tables import table

    console.print(f"beamstiff {facts['beamstiff']}, Python {facts['python']}, {facts['platform']}")
    console.print(f"in {sys.prefix}\n", soft_wrap=True)
    for title, parts, lacks in (
        ("Libraries", facts["needed"], "MISSING"),
        ("Optional parts", facts["optional"], "pip install '{name}{wanted}'"),
    ):
        result = table(title, "name", "installed", "wanted", "", left=4)
        for one in parts:
            how = "" if one["fits"] else lacks.format(**one)
            result.add_row(one["name"], one["installed"] or "-", one["wanted"], how)
        console.print(result)
        console.print()
    algebra = facts["linear_algebra"]
    threads = ", ".join(f"{name}={value}" for name, value in algebra["threads"].items())
    limited = threads or "threads not limited"
    console.print(f"Linear algebra: {algebra['blas']}, {algebra['cores']} cores; {limited}")
    console.print("In Python, OMP_NUM_THREADS=1 before numpy loads is the fastest for many small matrices.")
    check = facts["self_check"]
    if check is not None:
        right, error = "right" if check["error"] < EXACT else "WRONG", f"{check['error']:.0e}"
        said = f"Self check: {right}; a cantilever to {error} of its closed form, in {check['s']:.1f} s"
        console.print(said)
