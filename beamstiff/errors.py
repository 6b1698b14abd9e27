"""The one error type that users of beamstiff see, and the hints it carries."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class BeamstiffError(ValueError):
    """Input that cannot be used, said in one line.

    The message names the file, the key or row, what was found and what would be right. The command line
    prints it on stderr and exits with 2; it never comes with a traceback.

    Examples
    --------
    >>> raise BeamstiffError(
    ...     "ir663.yaml:12: joints[0].stiffness: found 'stiff', expected a number, rigid or free"
    ... )
    Traceback (most recent call last):
    ...
    beamstiff.errors.BeamstiffError: ir663.yaml:12: joints[0].stiffness: found 'stiff', expected ...
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(str(message).split()))


def suggest(name: object, candidates: Iterable[str]) -> str:
    """Return a hint with the closest of `candidates`, or an empty string when none is close.

    Examples
    --------
    >>> suggest("tosional", ["axial", "torsional"])
    " (did you mean 'torsional'?)"
    >>> suggest("xyz", ["axial", "torsional"])
    ''
    """
    close = difflib.get_close_matches(str(name)[:200], list(candidates), n=1, cutoff=0.6)
    return f" (did you mean '{close[0]}'?)" if close else ""


def listed(names: Iterable[str], most: int = 8) -> str:
    """Return names joined by commas, cut after `most` of them, for use in a message.

    Examples
    --------
    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    names = list(names)
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"
