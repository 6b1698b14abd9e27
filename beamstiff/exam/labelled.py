"""Campaigns in a folder, with their labels in a file of their own: diagnosed blind, compared afterwards."""

import json
from functools import partial
from pathlib import Path
from typing import Any

from beamstiff.errors import BeamstiffError
from beamstiff.exam.blind import Examiner, control_verdict, diagnosed, keep_report
from beamstiff.exam.names import EFFECTS, NONE, key_of
from beamstiff.exam.record import Kind, Label, Record, sha256
from beamstiff.files import read_text
from beamstiff.measure.reader import read_measurements
from beamstiff.measure.table import Measurements
from beamstiff.parallel import parallel_map
from beamstiff.robot.description import Robot
from beamstiff.robot.reader import load_robot


def examine_folder(
    folder: Path, examiner: Examiner, *, processes: int = 1, scheduler: str | None = None
) -> list[Record]:
    """Return the records of all labelled sets in a folder, in the order of their names.

    ``labels.json`` gives, for each ``NAME.csv``, `robot` (``ROBOT.yaml``, or ``ROBOT-payload.yaml`` where
    `kind` is ``pose``), `effect`, `component`, `gap_over_noise` and, for a pair, `eff2` as ``[effect,
    component, ...]``. The gap of each of a pair is not known: both count as clear where the pair's is.
    """
    labels = _labels(folder)
    names = sorted(labels)
    sets = (_read(folder, name, at, labels[name]) for at, name in enumerate(names))
    records: dict[int, Record] = {}
    step = partial(_examined, examiner)
    for at, (record, report) in parallel_map(step, sets, processes=processes, scheduler=scheduler):
        keep_report(examiner, f"{names[at]}.json", report)
        records[at] = record
    return [records[at] for at in range(len(names))]


Set = tuple[int, dict[str, Any], Robot, Measurements]


def _read(folder: Path, name: str, at: int, given: dict[str, Any]) -> Set:
    robot_file = f"{given['robot']}{'-payload' if given.get('kind') == 'pose' else ''}.yaml"
    robot = load_robot(folder / robot_file)
    return at, given, robot, read_measurements(folder / f"{name}.csv", robot)


def _examined(examiner: Examiner, task: Set) -> tuple[Record, dict[str, Any]]:
    at, given, robot, rows = task
    seal = sha256(given)
    outcome = diagnosed(robot, rows, (), examiner)
    controls = {name: control_verdict(one, robot, rows, ()) for name, one in examiner.controls.items()}
    second = given.get("eff2")
    truths = [] if given["effect"] == NONE else [key_of(given["effect"], given["component"])]
    truths += [] if second is None else [key_of(second[0], second[1])]
    gap = float(given["gap_over_noise"])
    label = Label(
        case=at,
        kind=_kind(given),
        truths=tuple(truths),
        sizes=(),
        withheld=(),
        robot=robot.name,
        design="rich",
        data=rows.kind,
        claimed="true",
        readings=6 if rows.measured_mask[:, 3:].any() else 3,
    )
    gaps, report_seal = (gap,) * len(truths), sha256(outcome.report)
    record = Record(
        label, outcome.answer, gap, gaps, None, controls, seal, report_seal, outcome.seconds, outcome.error
    )
    return record, outcome.report


def _kind(given: dict[str, Any]) -> Kind:
    if given["effect"] == NONE:
        return "null"
    if given.get("eff2") is not None:
        return "pair"
    return "single" if given["effect"] in EFFECTS else "outside"


def set_names(folder: Path) -> list[str]:
    """Return the names of the labelled sets in a folder, in order."""
    return sorted(_labels(folder))


def _labels(folder: Path) -> dict[str, dict[str, Any]]:
    path = folder / "labels.json"
    try:
        labels: dict[str, dict[str, Any]] = json.loads(read_text(path))
        for name, label in labels.items():
            for key in ("robot", "effect", "component", "gap_over_noise"):
                if key not in label:
                    raise BeamstiffError(f"{path}: {name}: found no {key!r}, expected one")
    except (ValueError, AttributeError, TypeError, RecursionError):
        raise BeamstiffError(f"{path}: expected JSON with an object for each set") from None
    return labels
