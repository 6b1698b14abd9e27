"""Crowded machines of another simulator: `python -m benchmarks.crowded [NAME ...]`, diagnosis and control.

The campaigns and labels of `practice-crowded` (`BEAMSTIFF_SHARED`): `diagnose` and the plain stepwise
regression from the nominal file and the table alone, the same figures for both. Nothing is tuned to them.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import beamstiff
from beamstiff import load_robot
from beamstiff.diagnosis.control_stepwise import plain_stepwise
from beamstiff.errors import BeamstiffError
from beamstiff.exam.blind import Diagnosis
from beamstiff.exam.crowded.blind import true_closing
from beamstiff.exam.names import effect_of, key_of, normal
from beamstiff.measure.reader import read_measurements

SHARED = Path(os.environ.get("BEAMSTIFF_SHARED", "../shared"))
WAYS: dict[str, Callable[..., Diagnosis]] = {"diagnose": beamstiff.diagnose, "plain stepwise": plain_stepwise}
GEOMETRY = ("geometry-error", "tool-offset")
MINE = "rigid:"  # before the name of a rigid in some labels

Label = dict[str, Any]


def means(name: str, cause: Label, joints: int) -> bool:
    """Return whether a name is that of a cause, or of a form that fits the rows as well."""
    together = name == "joint-compliance:null" and cause["effect"] == "joint-compliance" and joints > 1
    accepted = [normal(one.replace(MINE, "")) for one in cause["accept"]]
    return together or name in (key_of(cause["effect"], cause["component"]), *accepted)


def judged(label: Label, report: dict[str, Any]) -> dict[str, Any]:
    """Return what a report is worth, as `grade_crowded.py` of the set counts it."""
    names = [key_of(one["effect"], one["component"]) for one in report["causes"]]
    known = [one for one in label["causes"] if not one["outside"]]
    joints = sum(one["effect"] == "joint-compliance" for one in known)
    near = {normal(one) for cause in known for one in cause["near"]} | {normal(m) for m in label["mimics"]}
    off = GEOMETRY if label["table"] == "abs" and label["geometry_scale"] > 0 else ()
    false = [
        name
        for name in names
        if not (effect_of(name) in off or name in near or any(means(name, cause, joints) for cause in known))
    ]
    verdict = report["verdict"]["effect"]
    result: dict[str, Any] = {"named": len(names), "false": len(false)}
    if label["class"] in ("crowded", "displacement"):
        largest = label["causes"][0]
        first = report["causes"][0] if names else {"indistinguishable": []}
        top = [cause for cause in known if cause["closes"] >= 0.8 * largest["closes"]]
        some = {*names[:1], *map(normal, first["indistinguishable"] or ())}
        result["main"] = bool(names) and any(means(names[0], cause, joints) for cause in top)
        result["in set"] = any(means(one, largest, joints) or one in label["near_main"] for one in some)
    if label["class"] == "outside":
        result["unknown"] = verdict == "unknown"
    if label["class"] in ("clean", "geometry"):
        result["nothing"] = verdict in ("none", *GEOMETRY) and not false
    return result


def answered(folder: Path, name: str, label: Label, way: str) -> dict[str, Any]:
    """Return what one way of diagnosing comes to on a campaign."""
    robot = load_robot(folder / "yaml" / f"{name}.yaml")
    rows = read_measurements(folder / "csv" / f"{name}.csv", robot)
    start = time.perf_counter()
    found = WAYS[way](robot, rows)
    report = found.to_dict()
    result = {"seconds": time.perf_counter() - start, **judged(label, report)}
    if report["causes"] and label["class"] != "clean":
        promised = sum(one["closes"] for one in report["causes"])
        try:
            fresh = read_measurements(folder / "heldout" / f"{name}.truth.csv", robot)
            nothing = np.full((len(fresh), 6), np.nan)  # a plan: what is measured is not to be seen
            plan = replace(fresh, displacement=nothing, position=nothing[:, :3])
            true = true_closing(fresh.measured[:, :3], fresh.kind, found.predict_shift(plan))
        except BeamstiffError as error:
            print(f"  {way}: {error}")
            true = 0.0
        result |= {"promised": promised, "true": true}
    said = " ".join(
        f"{key_of(one['effect'], one['component'])}={one['closes']:.2f}" for one in report["causes"]
    )
    print(f"  {way}: {said or report['verdict']['effect']}", flush=True)
    return result


def told(results: list[dict[str, Any]]) -> dict[str, str]:
    """Return the figures of one way, each with its count."""

    def share(name: str) -> str:
        return f"{sum(one[name] for one in results if name in one)}/{sum(name in one for one in results)}"

    off = [abs(one["promised"] - one["true"]) for one in results if "true" in one]
    return {
        **{name: share(name) for name in ("main", "in set", "unknown", "nothing")},
        "false": f"{sum(one['false'] for one in results)}/{sum(one['named'] for one in results)}",
        "promise off, median": f"{statistics.median(off):.2f}" if off else "-",
        "promise off <= .15": f"{sum(one <= 0.15 for one in off)}/{len(off)}",
        "true closing, median": f"{statistics.median(o['true'] for o in results if 'true' in o):.2f}"
        if off
        else "-",
        "median s": f"{statistics.median(one['seconds'] for one in results):.1f}",
    }


def main(names: list[str]) -> None:
    """Print the figures of the practice campaigns, or of some of them."""
    folder = SHARED / "practice-crowded"
    if not (folder / "labels.json").exists():
        print(f"{folder} is not there: set BEAMSTIFF_SHARED to the folder that holds practice-crowded")
        return
    labels: dict[str, Label] = json.loads((folder / "labels.json").read_text())
    results: dict[str, list[dict[str, Any]]] = {way: [] for way in WAYS}
    for name, label in labels.items():
        if names and name not in names:
            continue
        true = " ".join(
            f"{key_of(one['effect'], one['component'])}={one['closes']:.2f}" for one in label["causes"]
        )
        print(f"{name} {label['class']}: {true}")
        for way, found in results.items():
            found.append(answered(folder, name, label, way))
    print()
    figures = {way: told(found) for way, found in results.items()}
    print(f"{'figure':24}" + "".join(f"{way:>18}" for way in figures))
    for figure in figures["diagnose"]:
        print(f"{figure:24}" + "".join(f"{found[figure]:>18}" for found in figures.values()))


if __name__ == "__main__":
    main(sys.argv[1:])
