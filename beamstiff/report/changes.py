"""What changed between two campaigns, in a line."""

from collections.abc import Sequence

from beamstiff.diagnosis.changes import RunComparison
from beamstiff.errors import listed
from beamstiff.report.verdict import Verdict


def changes_verdict(found: RunComparison, files: Sequence[str]) -> Verdict:
    """Return the headline: whether something changed, what, and how sure that is."""
    told = f"p = {found.p:.2g} for all {len(found.changes)} parameters together, level {found.level:g}"
    data = " and ".join(files)
    if not found.changed:
        said = f"No change beyond the uncertainty: {told}"
        return Verdict(said, "agrees", data, "Nothing to do: both campaigns fit one robot.")
    names = [one.name for one in sorted(found.changes, key=lambda one: one.p) if one.changed]
    what = f"Something changed ({listed(names, 3)})" if names else "Something changed"
    action = (
        f"Look at {names[0]} on the machine, then fit the later campaign by itself."
        if names
        else ("Measure more: these data do not say which parameter it is.")
    )
    return Verdict(f"{what}: {told}", "differs", data, action)
