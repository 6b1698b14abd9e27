"""Sentences that people read use the field's standard terms: no phrase of the list stands in any of them.

The table of all sentences: `python -m tests.report.test_terms`.
"""

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "beamstiff"
PLACES = ("report", "cli")  # where the texts of terminal and report stand, beside notes and effects
MORE = (
    "diagnosis/notes.py",
    "diagnosis/effects",
    "measure/doubts.py",
    "identification",
    "calibration",
    "functions",
    "planning",
    "maps",
)
SHORTEST = 3  # words that make a sentence
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
    "could give": "best achievable by any elastic model",
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
    for place in (*PLACES, *MORE):
        path = PACKAGE / place
        yield from sorted(path.rglob("*.py")) if path.is_dir() else [path]
    yield from sorted((PACKAGE / "report" / "html" / "templates").glob("*.html"))


def sentences(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a file with their lines: strings of three words and more; of commands docstrings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".html":
        bare = re.sub(r"\{[%{].*?[%}]\}|<[^>]*>", " ", text)
        yield from (
            (at, line.strip()) for at, line in enumerate(bare.splitlines(), 1) if line.split()[SHORTEST:]
        )
        return
    tree = ast.parse(text)
    shown = "cli" in path.parts
    told = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and node.body and not shown:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                told.add(id(first.value))
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


def table() -> list[tuple[str, int, str]]:
    """Return every sentence with its file and line."""
    return [
        (str(path.relative_to(REPOSITORY)), line, sentence)
        for path in files()
        for line, sentence in sentences(path)
    ]


def test_the_table_holds_the_texts() -> None:
    told = [sentence for _, _, sentence in table()]
    assert len(told) > 800
    assert any("Cause" in one for one in told)
    assert any("The figures need JavaScript" in one for one in told)


def test_no_sentence_of_terminal_and_report_holds_a_phrase_of_the_list() -> None:
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
    path = Path(os.environ.get("BEAMSTIFF_SHARED", "")) / "TERMS.md"
    if not path.is_file():
        pytest.skip("no TERMS.md where BEAMSTIFF_SHARED points")
    patterns = shared_phrases(path.read_text(encoding="utf-8"))
    assert len(patterns) > 25
    any_of = re.compile("|".join(rf"\b{one}\b" for one in patterns), re.IGNORECASE)
    found = [
        (place, line, phrase[0]) for place, line, sentence in table() if (phrase := any_of.search(sentence))
    ]
    assert found == []


@pytest.mark.parametrize(
    "page", [*(REPOSITORY / "docs").glob("*.md"), REPOSITORY / "README.md"], ids=lambda one: one.name
)
def test_no_page_holds_a_phrase_of_the_list(page: Path) -> None:
    assert PHRASES.findall(page.read_text(encoding="utf-8")) == []


def main() -> None:
    for place, line, sentence in table():
        print(f"{place}:{line}\t{'! ' if PHRASES.search(sentence) else ''}{sentence}")


if __name__ == "__main__":
    main()
