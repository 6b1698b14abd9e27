"""Finished chunks of a map on the disk: a folder with a file each, where an interrupted run goes on."""

from __future__ import annotations

import io
import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.files import write_whole
from beamstiff.maps.chunk import Part

STATED = "job.json"
FORMAT = "beamstiff-map-parts/1"


class Parts:
    """The folder of a job's finished chunks, beside the file that they will make.

    Parameters
    ----------
    out : path
        Of the map; the folder's name has ``.parts`` at its end.
    stated : dict
        The job, as plain data. A folder that holds chunks of another is refused.

    Raises
    ------
    BeamstiffError
        When the folder holds another job, saying what differs, or cannot be made.
    """

    def __init__(self, out: str | Path, stated: dict[str, Any]) -> None:
        self.folder = Path(f"{out}.parts")
        told = json.loads(json.dumps({"format": FORMAT} | stated))
        path = self.folder / STATED
        try:
            if path.exists():
                self._compare(json.loads(path.read_text(encoding="utf-8")), told)
                return
            self.folder.mkdir(exist_ok=True)
        except json.JSONDecodeError:
            raise BeamstiffError(f"{path}: is broken; remove {self.folder} to begin anew") from None
        except OSError as error:
            raise BeamstiffError(
                f"{self.folder}: cannot be used: {(error.strerror or str(error)).lower()}"
            ) from None
        if any(self.folder.iterdir()):
            raise BeamstiffError(
                f"{self.folder}: holds other files, expected chunks of a map; move them away"
            )
        write_whole(path, json.dumps(told, indent=1))

    def _compare(self, found: Any, told: dict[str, Any]) -> None:
        if not isinstance(found, dict):
            found = {}
        for key, value in told.items():
            if found.get(key) != value:
                old, new = (json.dumps(item)[:80] for item in (found.get(key), value))
                raise BeamstiffError(
                    f"{self.folder}: holds chunks of another map: {key} was {old}, now {new}; remove the "
                    "folder to begin anew, or choose another --out"
                )

    def read(self, number: int) -> Part | None:
        """Return a chunk that is finished, or None; one that is damaged counts as not finished."""
        try:
            with np.load(io.BytesIO(self._path(number).read_bytes()), allow_pickle=False) as data:
                values = {name: data[name] for name in data.files}
            examples = json.loads(str(values.pop("examples")))
            return Part(values, values.pop("reasons"), {int(key): text for key, text in examples.items()})
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def write(self, number: int, part: Part) -> None:
        """Keep a finished chunk: whole, or not at all.

        Raises
        ------
        BeamstiffError
            When there is no room left, or another fault of the disk.
        """
        data = io.BytesIO()
        arrays: dict[str, Any] = {**part.values, "reasons": part.reasons}
        np.savez(data, examples=np.array(json.dumps(part.examples)), **arrays)
        write_whole(self._path(number), data.getvalue())

    def remove(self) -> None:
        """Remove the folder: the map is written."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npz"
