"""A campaign kept in a folder: its robot, its batches, and what they told last.

``campaign.json`` is what counts: which batches there are, and which are withdrawn. Whatever it names is
whole before it names it, and files that it does not name are those of a command that was killed. Batches are
copies, called after their content, and never change.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from beamstiff.errors import BeamstiffError, listed
from beamstiff.files import held, read_text, remove_drafts, write_new
from beamstiff.outputs import write_output

FORMAT = "beamstiff-campaign/1"
HEAD, ROBOT, RESULT = "campaign.json", "robot.yaml", "diagnosis.json"
PLANNED = ("x", "y", "z")
Region = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Batch:
    """A table that was measured.

    `file`: in the folder.
    `source`: where it came from.
    """

    file: str
    source: str
    withdrawn: bool = False


@dataclass(frozen=True)
class CampaignFolder:
    """A campaign as it stands in its folder.

    `batches`: in the order in which they were added; their numbers begin with 1.
    `region`: m, least and largest x, y, z of the TCP in what is proposed; None in an end that is free.
    `directions`: axes of the base along which loads can pull.
    `rows`: of a proposal.
    """

    folder: Path
    batches: tuple[Batch, ...]
    region: Region | None
    directions: tuple[str, ...]
    rows: int
    seed: int

    @property
    def robot(self) -> Path:
        """The robot's file."""
        return self.folder / ROBOT

    @property
    def tables(self) -> list[Path]:
        """The batches that count."""
        return [self.folder / one.file for one in self.batches if not one.withdrawn]

    @property
    def state(self) -> str:
        """A digest of all that a result depends on."""
        told = [self.region, self.directions, self.rows, self.seed, *(path.name for path in self.tables)]
        return hashlib.sha256(f"{told}{read_text(self.robot)}".encode()).hexdigest()

    def kept_result(self) -> dict[str, Any] | None:
        """Return the last result; None where it is of other batches."""
        path = self.folder / RESULT
        if not path.is_file():
            return None
        try:
            told = json.loads(read_text(path))
        except ValueError:
            return None
        if not isinstance(told, dict) or told.pop("state", None) != self.state:
            return None
        return {name: value for name, value in told.items() if name != "written_by"}

    def keep_result(self, told: Mapping[str, Any]) -> None:
        """Write a result of these batches."""
        write_output(self.folder / RESULT, json.dumps({"state": self.state, **told}, indent=1) + "\n")

    def with_batches(self, added: Sequence[str]) -> Self:
        """Return the campaign with more batches, files that were measured, which it copies.

        Raises BeamstiffError when a file cannot be read, or its rows are those of a batch that counts.
        """
        batches = list(self.batches)
        for source in added:
            text = read_text(source)
            name = f"batch-{hashlib.sha256(text.encode()).hexdigest()[:16]}.csv"
            same = [k for k, one in enumerate(batches, 1) if one.file == name and not one.withdrawn]
            if same:
                raise BeamstiffError(f"{source}: is batch {same[0]} already, its rows would count twice")
            write_new(self.folder / name, text)
            if read_text(self.folder / name) != text:
                raise BeamstiffError(f"{self.folder / name}: was changed, expected the rows of {source}")
            batches.append(Batch(name, Path(source).name))
        return replace(self, batches=tuple(batches))

    def without(self, numbers: Sequence[str]) -> Self:
        """Return the campaign with batches withdrawn, by their numbers.

        Raises BeamstiffError when there is no such batch.
        """
        batches = list(self.batches)
        known = [str(k) for k, one in enumerate(batches, 1) if not one.withdrawn]
        for number in numbers:
            if number not in known:
                expected = listed(known, 20) or "none: there are none"
                raise BeamstiffError(f"{self.folder}: found batch {number!r}, expected {expected}")
            batches[int(number) - 1] = replace(batches[int(number) - 1], withdrawn=True)
        return replace(self, batches=tuple(batches))

    def save(self) -> None:
        """Write what counts, in one step."""
        told = {
            "format": FORMAT,
            "region": self.region
            and [[end if np.isfinite(end) else None for end in pair] for pair in self.region],
            "directions": self.directions,
            "rows": self.rows,
            "seed": self.seed,
            "batches": [asdict(one) for one in self.batches],
        }
        write_output(self.folder / HEAD, json.dumps(told, indent=1) + "\n")


def new_campaign(
    folder: Path, robot: str, region: Region | None, directions: tuple[str, ...], rows: int, seed: int
) -> CampaignFolder:
    """Return a campaign in a folder of its own, made where it is missing; `robot`: the text of its file.

    Raises BeamstiffError when there is a campaign, or something else, in the folder.
    """
    if (folder / HEAD).exists():
        raise BeamstiffError(f"{folder}: there is a campaign already, expected another folder")
    try:
        folder.mkdir(exist_ok=True)
        others = [path.name for path in folder.iterdir() if path.name != ROBOT]
    except OSError as error:
        raise BeamstiffError(f"{folder}: cannot be made: {(error.strerror or str(error)).lower()}") from None
    others = [name for name in others if not name.startswith(".beamstiff-")]
    if others:
        raise BeamstiffError(f"{folder}: found {listed(sorted(others), 3)}, expected an empty folder")
    remove_drafts(folder)
    write_output(folder / ROBOT, robot)
    made = CampaignFolder(folder, (), region, directions, rows, seed)
    made.save()
    return made


@contextmanager
def opened(folder: Path) -> Iterator[CampaignFolder]:
    """Give the campaign of a folder, held against other commands.

    Raises BeamstiffError when it holds none.
    """
    path = folder / HEAD
    if not path.is_file():
        raise BeamstiffError(f"{folder}: found no {HEAD}, expected the folder of `beamstiff campaign new`")
    with held(folder / ".beamstiff-campaign", f"{folder}: another command works on this campaign: wait"):
        remove_drafts(folder)
        yield _read(folder)


def _read(folder: Path) -> CampaignFolder:
    path = folder / HEAD
    try:
        told = json.loads(read_text(path))
        if told["format"] != FORMAT:
            raise ValueError
        batches = tuple(
            Batch(str(b["file"]), str(b["source"]), bool(b["withdrawn"])) for b in told["batches"]
        )
        pairs = told["region"]
        region = (
            None if pairs is None else tuple((_end(low, -np.inf), _end(high, np.inf)) for low, high in pairs)
        )
        axes = tuple(map(str, told.get("directions", PLANNED)))  # as of a plan, where a file has none
        found = CampaignFolder(folder, batches, region, axes, int(told["rows"]), int(told["seed"]))
    except (ValueError, KeyError, TypeError):
        raise BeamstiffError(
            f"{path}: is no campaign ({FORMAT}), expected what `campaign new` wrote"
        ) from None
    for one in batches:
        if not (folder / one.file).is_file():
            raise BeamstiffError(f"{path}: batch {one.file} is missing, expected it beside this file")
    return found


def _end(value: Any, free: float) -> float:
    return free if value is None else float(value)
