"""`campaign`: what the batches of a campaign say, what to measure next, and whether to stop."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from beamstiff.diagnosis.next_measurement.outlook import Outlook, outlook
from beamstiff.diagnosis.next_measurement.test_plan import proposed_csv
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.functions.checks import whole
from beamstiff.functions.diagnose import diagnose
from beamstiff.functions.plan import MOST_TESTS, plan
from beamstiff.functions.robots import as_robot
from beamstiff.measure.coerce import TableLike, as_tables
from beamstiff.planning.candidates import ANYWHERE, AXES
from beamstiff.robot.reader import RobotLike
from beamstiff.shown import Shown

ROWS = 10  # of a batch


@dataclass(frozen=True, repr=False)
class CampaignState(Shown):
    """Where a campaign stands.

    Attributes
    ----------
    rows : int
        Rows read so far.
    diagnosis : Diagnosis or None
        Of all batches together, with the proposal as its `next`; None before the first.
    outlook : Outlook or None
        What the proposal is expected to settle.
    proposed : int
        Rows to measure next.
    proposal : str
        Rows to measure next, a CSV table to fill in; empty where there are none.
    """

    rows: int
    diagnosis: Diagnosis | None
    outlook: Outlook | None
    proposed: int
    proposal: str

    @property
    def stop(self) -> str:
        """``decided``, ``undecidable`` (nothing more can be with this instrument), or empty: go on."""
        if self.outlook is None:
            return ""
        return "decided" if self.outlook.decided else "undecidable" if self.outlook.undecidable else ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the diagnosis."""
        return () if self.diagnosis is None else self.diagnosis.notes

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        ahead = self.outlook
        told = {"rows": self.rows, "stop": self.stop, "proposed": self.proposed, "proposal": self.proposal}
        if ahead is None or self.diagnosis is None:
            return told
        shown = ("leading", "probability", "separates", "settles", "turns", "ever")
        told |= {name: getattr(ahead, name) for name in shown}
        return told | {"separates": list(ahead.separates), "diagnosis": self.diagnosis.to_dict()}


def campaign(
    robot: RobotLike,
    batches: Sequence[TableLike],
    *,
    rows: int = ROWS,
    region: Sequence[tuple[float, float]] | None = None,
    directions: Sequence[str] = AXES,
    seed: int = 0,
) -> CampaignState:
    """Say what the batches of a campaign tell together, what to measure next, and whether to stop.

    Before the first batch, a plan for the stiffness is proposed. Then the states that tell the likeliest
    causes apart best, or bound the parameters of the only one. It is time to stop where the likeliest cause
    has a probability of 0.9, was the likeliest without the last batch, too, and the proposal would turn it
    with 0.05 at most; or where ten such proposals are not expected to settle it, or nothing but noise shows.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
    batches : sequence of Measurements or path
        Tables in the order in which they were measured.
    rows : int
        To propose at most; where a cause remembers the loads before, whole load cycles.
    region : three pairs, m, optional
        Least and largest x, y, z of the TCP in what is proposed.
    directions : sequence of str
        Axes of the base along which loads can pull, such as ``("x", "-z")``.
    seed : int

    Returns
    -------
    CampaignState

    Raises
    ------
    BeamstiffError
        As `plan` and `diagnose`.

    Examples
    --------
    >>> state = campaign("ir663", [], rows=6)
    >>> state.stop, state.proposed
    ('', 6)
    """
    machine = as_robot(robot)
    whole("rows", rows, 1, MOST_TESTS)
    if not batches:
        first = plan(machine, tests=rows, region=region, directions=directions, seed=seed)
        return CampaignState(0, None, None, rows, first.to_csv())
    tables = as_tables(list(batches), machine)
    found = diagnose(machine, tables, region=region or ANYWHERE, batch=rows, directions=directions, seed=seed)
    ahead = outlook(found)
    if ahead.decided:  # by rows that it was not found with?
        before = outlook(diagnose(machine, tables[:-1], batch=1, seed=seed)).leading if tables[:-1] else ""
        ahead = replace(ahead, stands=before == ahead.leading)
    count = sum(len(table) for table in tables)
    table = proposed_csv(found) if found.next else ""
    return CampaignState(count, found, ahead, len(found.next), table)
