"""A program's text with comments and strings blanked out, every place as it was."""

from __future__ import annotations

import re
from collections.abc import Iterator

LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n|\Z)")


def masked(text: str, comment: str) -> str:
    r"""Return the text with comments, from a mark to the end of the line, and ``"strings"`` made blank.

    Examples
    --------
    >>> masked('p "a;b" 1 ; not 2\nq', ";")
    'p       1        \nq'
    """
    pattern = re.compile(rf'"[^"\r\n]*"?|{re.escape(comment)}[^\r\n]*')
    return pattern.sub(lambda found: " " * len(found[0]), text)


def lines(text: str) -> Iterator[tuple[int, int, str]]:
    """Yield number, place and text of every line, without its end."""
    at = 0
    for number, match in enumerate(LINE.finditer(text), start=1):
        if match[0]:
            yield number, at, match[0].rstrip("\r\n")
        at = match.end()
