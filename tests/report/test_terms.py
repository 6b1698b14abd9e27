"""Sentences that people read use the field's standard terms: no phrase of the list stands in any of them.

Held against the list: every text in the package (terminal, report, notes, errors, help), every docstring,
every page of the docs. The table of all texts: `python -m tests.report.test_terms`.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.conftest import SHARED

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "beamstiff"
PAGES = [*(REPOSITORY / "docs").glob("*.md"), *(REPOSITORY / one for one in ("README.md", "CONTRIBUTING.md"))]
PAGES.append(REPOSITORY / "benchmarks" / "README.md")
SHORTEST = 3  # words that make a sentence
OF_ROWS = (r"left\ out",)  # wrong of rows that are held out, right of an option that is: not in every text
# phrase: what to write in its place
TERMS = {
    "gives way": "is compliant",
    "give way": "are compliant",
    "giving way": "compliance",
    "noise alone would leave": "noise floor",
    "tell it from": "distinguish it from",
    "tell them apart": "distinguish them",
    "told apart": "distinguished",
    "cannot tell": "cannot distinguish",
    "asked beside reached": "target and result",
    "asked and reached": "target and result",
    "hooked on anew": "per-posture offset",
    "off rest": "asymmetric",
    "what hangs where": "structure",
    "come along": "bundled",
    "comes along": "bundled",
    "came along": "bundled",
    "none saw": "held-out",
    "left out of the fit": "held out",
    "postures left out": "held-out postures",
    "could give": "the best fit by effects of the library leaves",
    "only act together": "identifiable only in combination",
    "what it leaves": "the residual",
    "has no name": "outside the library",
    "the rest is": "remainder",
    "counts for nothing": "is ignored",
    "what is no number": "NaN and inf",
    "that the library lacks": "outside the library",
    "nameless": "unmodelled",
}
PHRASES = re.compile("|".join(rf"\b{re.escape(phrase)}\b" for phrase in TERMS), re.IGNORECASE)


def files() -> Iterator[Path]:
    yield from sorted(PACKAGE.rglob("*.py"))
    yield from sorted((PACKAGE / "report" / "html" / "templates").glob("*.html"))


def sentences(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a file with their lines: strings of three words and more, docstrings among them."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".html":
        bare = re.sub(r"\{[%{].*?[%}]\}|<[^>]*>", " ", text)
        yield from (
            (at, line.strip()) for at, line in enumerate(bare.splitlines(), 1) if line.split()[SHORTEST:]
        )
        return
    tree = ast.parse(text)
    told = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = node.values
            told.update(id(part) for part in parts)
            joined = "".join(str(part.value) if isinstance(part, ast.Constant) else "..." for part in parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told:
            joined = node.value
        else:
            continue
        if len(joined.split()) >= SHORTEST:
            yield node.lineno, " ".join(joined.split())


@cache
def table() -> list[tuple[str, int, str]]:
    """Return every sentence with its file and line."""
    return [
        (str(path.relative_to(REPOSITORY)), line, sentence)
        for path in files()
        for line, sentence in sentences(path)
    ]


def test_the_table_holds_the_texts() -> None:
    told = [sentence for _, _, sentence in table()]
    assert len(told) > 5000
    for one in (
        "... mm are left on held-out postures",  # terminal and report
        "The figures need JavaScript",  # report
        "no row carries a load: measure with one",  # notes
        "NAME=NUMBER such as backlash:q2=0.5",  # errors
        "Check a robot with its effects on fresh measurements.",  # help of a command
        "Write the measurements that distinguish the causes best",  # help of an option
        "Position gap on held-out postures, and the noise floor.",  # docstrings
    ):
        assert any(one in text for text in told), one


def test_no_text_of_the_package_holds_a_phrase_of_the_list() -> None:
    found = [
        (place, line, phrase[0], TERMS[phrase[0].lower()])
        for place, line, sentence in table()
        if (phrase := PHRASES.search(sentence))
    ]
    assert found == []


def shared_phrases(text: str) -> list[str]:
    """Return the phrases of the shared table of words, as patterns: its left column on texts, and its list.

    A phrase has two words at least: a single one (`give`, `asked`) has uses that are right. A number stands
    for any.
    """
    texts, _, phrases = text.partition("## Texts that people read")[2].partition("## Phrases to look for")
    cells = [line.split(" | ")[0].strip("| ") for line in texts.splitlines() if line.startswith("| ")][2:]
    bare = [re.sub(r"\(.*?\)", "", cell) for cell in cells]
    parts = [part for cell in bare for part in re.split(r"[;:,]|\.(?=\s|$)", cell)]
    parts += [line.removeprefix("- ") for line in phrases.splitlines() if line.startswith("- ")]
    kept = [part.strip() for part in parts if len(part.split()) > 1]
    return [re.sub(r"\d[\d.\\]*", r"\\S+", re.escape(part)) for part in kept]


def test_no_sentence_holds_a_phrase_of_the_shared_table() -> None:
    path = SHARED / "TERMS.md"
    if not path.is_file():
        pytest.skip(f"shared data missing: {path.name} (set BEAMSTIFF_SHARED to the folder that holds it)")
    patterns = [one for one in shared_phrases(path.read_text(encoding="utf-8")) if one not in OF_ROWS]
    assert len(patterns) > 25
    any_of = re.compile("|".join(rf"\b{one}\b" for one in patterns), re.IGNORECASE)
    texts = table() + [
        (page.name, at, line)
        for page in PAGES
        for at, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
    ]
    found = [(place, line, phrase[0]) for place, line, text in texts if (phrase := any_of.search(text))]
    assert found == []


@pytest.mark.parametrize("page", PAGES, ids=lambda one: f"{one.parent.name}-{one.name}")
def test_no_page_holds_a_phrase_of_the_list(page: Path) -> None:
    assert PHRASES.findall(page.read_text(encoding="utf-8")) == []


def main() -> None:
    for place, line, sentence in table():
        print(f"{place}:{line}\t{'! ' if PHRASES.search(sentence) else ''}{sentence}")


if __name__ == "__main__":
    main()
