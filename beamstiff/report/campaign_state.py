"""Verdict, expectation and batches of a campaign: what its rows say so far, and what to measure next."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import RenderableType

from beamstiff.diagnosis.notes import in_words
from beamstiff.errors import counted
from beamstiff.report.diagnosis_words import percent
from beamstiff.report.tables import table
from beamstiff.report.verdict import Verdict


def campaign_state_told(
    told: Mapping[str, Any], batches: Sequence[Mapping[str, Any]] | None = None
) -> Iterator[RenderableType]:
    """Yield what is shown of a campaign (`CampaignState.to_dict`).

    `batches`: those in its folder, as the command lists them; of a state in Python none are known.
    """
    writes = "its `proposal` is their table" if batches is None else "campaign next --out writes them"
    proposed = f"Measure {counted(told['proposed'], 'row')} ({writes})."
    if "leading" not in told:
        yield from Verdict("No batch yet", action=proposed).lines()
        return
    name, share = in_words([told["leading"]]), percent(told["probability"])
    head = {
        "decided": f"Decided: {name} ({share})",
        "undecidable": f"Nothing more can be decided with this instrument: likeliest is {name} ({share})",
        "": f"Go on: likeliest is {name} ({share})",
    }[told["stop"]]
    end = "Stop measuring." if told["stop"] else proposed
    yield from Verdict(head, data=counted(told["rows"], "row"), action=end).lines()
    if told["proposal"]:
        yield _expected(told, name)
    if batches is not None:
        cells = ([str(b["number"]), b["source"], "withdrawn" if b["withdrawn"] else ""] for b in batches)
        yield table("Batches", "number", "table", "", rows=cells)


def _expected(told: Mapping[str, Any], name: str) -> str:
    """Return in a sentence what the proposed rows are expected to settle."""
    does = f"bound the parameters of {name}"
    if told["separates"]:
        does = f"tell apart {in_words(told['separates'])}"
    return f"It is to {does}, and settles which it is with a probability of {percent(told['settles'])}."
