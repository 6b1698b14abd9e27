"""A map as an `xarray.Dataset`: axes, quantities, reasons, units, provenance; saved as NetCDF or Zarr."""

from __future__ import annotations

import importlib.util
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamstiff._version import __version__
from beamstiff.errors import BeamstiffError
from beamstiff.files import draft_of
from beamstiff.maps.chunk import Part
from beamstiff.maps.grid import CARTESIAN, Box
from beamstiff.maps.job import Job, robot_digest, versions
from beamstiff.maps.quantities import LOADS, MEANING, MOTIONS, QUANTITIES, Reason, dimension_names
from beamstiff.outputs import UNSEALED, check_replaceable, is_sealed_folder, seal_folder, seal_in_place

if TYPE_CHECKING:
    import xarray

FORMATS = (".nc", ".zarr")
ZARR = ("zarr.json", ".zgroup")  # what the folder of one holds
LARGEST = 2**32 - 4  # B of a variable in NetCDF 3
COMPONENTS: dict[tuple[str, ...], str] = {MOTIONS: "motion", LOADS: "load"}


def check_format(job: Job, out: str | Path) -> None:
    """Refuse the name of a file that no map is written to, before any work is done for it."""
    ending = Path(out).suffix
    if ending not in FORMATS:
        raise BeamstiffError(f"{out}: found the ending {ending!r}, expected .nc (NetCDF) or .zarr")
    if ending == ".zarr" and importlib.util.find_spec("zarr") is None:
        raise BeamstiffError(
            f"{out}: needs zarr (pip install 'beamstiff[zarr]'), or take a name that ends in .nc"
        )
    if not (folder := Path(out).resolve().parent).is_dir():
        raise BeamstiffError(f"{out}: cannot be written: there is no folder {str(folder)!r}")
    check_target(out)
    largest = 8 * job.grid.count * max(QUANTITIES[name].size for name in job.quantities)
    if ending == ".nc" and largest > LARGEST:
        raise BeamstiffError(
            f"{out}: a quantity of {largest / 1e9:.2g} GB, expected at most {LARGEST / 1e9:.2g} GB in "
            "NetCDF: take a name that ends in .zarr, or fewer poses"
        )


def empty_dataset(job: Job, attributes: Mapping[str, str] | None = None) -> xarray.Dataset:
    """Return the map of a job before anything is computed: NaN everywhere."""
    import xarray

    grid, robot = job.grid, job.robot
    kinds = {variable.name: variable.kind for variable in robot.actuated}
    coordinates: dict[str, Any] = {}
    called = dimension_names(grid.names)
    dimensions = tuple(called.values())
    for name, axis in zip(grid.names, grid.axes, strict=True):
        over_joints = grid.target is None
        unit = "rad" if over_joints and kinds[name] == "angle" else "m"
        long_name = f"joint variable {name}" if over_joints else f"{name} of the TCP, base frame"
        told = {"units": unit, "long_name": long_name}
        if called[name] != name:
            told["variable"] = name
        coordinates[called[name]] = (called[name], axis, told)
    variables: dict[str, Any] = {}
    for name in job.quantities:
        known = QUANTITIES[name]
        extra = tuple(COMPONENTS[names] for names in known.components)
        for names in known.components:
            coordinates[COMPONENTS[names]] = np.array(names, dtype=object)
        values = np.full((*grid.shape, *map(len, known.components)), np.nan)
        told = {"units": known.unit, "long_name": known.long_name, "frame": "base"}
        variables[name] = ((*dimensions, *extra), values, told)
    if grid.target is not None:
        coordinates["joint"] = np.array(list(kinds), dtype=object)
        values = np.full((*grid.shape, len(kinds)), np.nan)
        told = {"units": "rad, m", "long_name": "actuated variables that bring the TCP there"}
        variables["q"] = ((*dimensions, "joint"), values, told)
    variables["reason"] = (dimensions, np.zeros(grid.shape, dtype=np.int8), _reason_attributes())
    return xarray.Dataset(variables, coordinates, {**_provenance(job), **(attributes or {})})


def put(dataset: xarray.Dataset, box: Box, part: Part) -> None:
    """Put a chunk where it belongs."""
    arrays: dict[str, NDArray[Any]] = {**part.values, "reason": part.reasons}
    for name, values in arrays.items():
        whole: NDArray[Any] = dataset[name].values
        whole[box] = values.reshape(whole[box].shape)


def _reason_attributes() -> dict[str, Any]:
    return {
        "long_name": "why quantities are NaN",
        "flag_values": np.array([int(reason) for reason in Reason], dtype=np.int8),
        "flag_meanings": " ".join(reason.label for reason in Reason),
        **{f"meaning_{reason.label}": text for reason, text in MEANING.items()},
    }


def _provenance(job: Job) -> dict[str, Any]:
    robot, grid = job.robot, job.grid
    names = [variable.name for variable in robot.actuated]
    held = {
        name: value
        for name, value in zip(names, grid.q.tolist(), strict=True)
        if name not in grid.names or grid.target is not None
    }
    told: dict[str, Any] = {
        "Conventions": "CF-1.11",
        "title": f"{robot.name}: {', '.join(job.quantities)} over {', '.join(grid.names)}",
        "source": f"beamstiff {__version__}",
        "robot": robot.name,
        "robot_sha256": robot_digest(robot),
        "tcp": robot.tcp,
        "frame": "base; displacement [d, r] and wrench [f, m] at the TCP; undeformed geometry",
        "held": json.dumps(held),
        "versions": json.dumps(versions()),
    }
    if grid.target is not None:
        target = {axis: grid.target[at, 3] for at, axis in enumerate(CARTESIAN) if axis not in grid.names}
        told["tcp_held"] = json.dumps(target)
        told["orientation"] = json.dumps(grid.target[:3, :3].tolist()) if grid.turned else "free"
        told["configuration"] = (
            "that of the posture held: no singular posture between it and any pose of the map"
        )
    if any("wrench" in QUANTITIES[name].needs for name in job.quantities):
        told["wrench"] = json.dumps(job.wrench.tolist())
        told["dead_weight"] = "added to the wrench" if job.gravity else "left out"
    if job.direction is not None:
        told["direction"] = json.dumps(job.direction.tolist())
    if job.length is not None:
        told["characteristic_length"] = job.length
    return told


def save_dataset(dataset: xarray.Dataset, out: str | Path) -> None:
    """Write a map, whole or not at all: NetCDF 3 (64-bit offsets) or Zarr, by the ending of the name."""
    check_target(out)
    target, dataset = Path(out).resolve(), dataset.assign_attrs(written_by=UNSEALED)
    try:
        with draft_of(target) as draft:
            if target.suffix == ".zarr":
                dataset.to_zarr(draft, mode="w", consolidated=False)
                seal_folder(draft, draft / _zarr_holder(draft))
                _take_the_place(draft, target)
            else:
                dataset.to_netcdf(draft, engine="scipy", format="NETCDF3_64BIT")
                seal_in_place(draft)
                os.replace(draft, target)
    except OSError as error:
        raise BeamstiffError(f"{out}: cannot be written: {(error.strerror or str(error)).lower()}") from None


def check_target(out: str | Path) -> None:
    """Refuse to put a map where something stands that is no map as beamstiff wrote it."""
    target = Path(out).resolve()
    if not target.is_dir():
        check_replaceable(out)
    elif not any((target / name).exists() for name in ZARR):
        raise BeamstiffError(f"{out}: is a folder and no Zarr, expected the name of a new one")
    elif not is_sealed_folder(target, target / _zarr_holder(target)):
        raise BeamstiffError(
            f"{out}: is not as beamstiff wrote it: it would be lost, expected another name, or move it away"
        )


def _zarr_holder(folder: Path) -> str:
    """Return the name of the file with the attributes of a Zarr: version 3 or 2."""
    return "zarr.json" if (folder / "zarr.json").exists() else ".zattrs"


def _take_the_place(draft: Path, target: Path) -> None:
    old = draft.with_name("old")  # goes with the draft's folder
    if target.exists():
        os.replace(target, old)
    try:
        os.replace(draft, target)
    except BaseException:
        if old.exists():
            os.replace(old, target)
        raise
