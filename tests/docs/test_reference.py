"""The reference page says what the models say that check the files."""

import re

from docs.reference import PAGE, reference


def without_examples(page: str) -> str:
    """Return a page without the values of its JSON examples, whose last digits follow the machine."""
    before, head, after = page.partition("## JSON")
    return before + head + re.sub(r"^(\| `[^`]+` \|).*$", r"\1", after, flags=re.MULTILINE)


def test_the_page_is_what_the_models_say() -> None:
    written = PAGE.read_text(encoding="utf-8")
    assert without_examples(written) == without_examples(reference()), "run `python -m docs.reference`"


def test_every_key_has_its_unit() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for row in (
        "| `E` | modulus, Pa |",
        "| `mass` | mass, kg |",
        "| `torsional` | rotational stiffness, N*m/rad |",
    ):
        assert row in page
    assert "<class" not in page
    assert "typing." not in page
