"""The schema of measurement tables knows every column that the reader takes, and no cell that it refuses."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from beamstiff.measure.columns import RESERVED
from beamstiff.measure.schema import HEADER_TEXTS, measurement_schema
from beamstiff.measure.text import METADATA, split_table

jsonschema = pytest.importorskip("jsonschema")
TABLES = sorted((Path(__file__).parents[2] / "examples" / "data").glob("*campaign*.csv"))


def as_data(text: str) -> dict[str, Any]:
    """Return a table as the schema describes it."""
    raw = split_table(text, "table")
    names = [cell.partition("[")[0].strip() for cell in raw.header]

    def value(name: str, cell: str) -> Any:
        return (
            cell if name in ("point", "load_point", "instrument", "remark") else float(cell) if cell else None
        )

    rows = [{name: value(name, cell) for name, cell in zip(names, row, strict=True)} for row in raw.cells]
    return {"header": {key: told for key, (told, _) in raw.metadata.items()}, "rows": rows}


@pytest.fixture(scope="module")
def wrong() -> Callable[[Any], list[str]]:
    schema = measurement_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    return lambda data: [error.message for error in validator.iter_errors(data)]


def test_it_knows_every_column_and_every_line_above_the_header() -> None:
    schema = measurement_schema()
    row = schema["$defs"]["row"]["properties"]
    assert row.keys() == {*RESERVED}
    assert schema["properties"]["header"]["properties"].keys() == HEADER_TEXTS.keys() == {*METADATA}
    assert all(part["description"] for part in row.values())


@pytest.mark.parametrize("path", TABLES, ids=lambda path: path.stem)
def test_the_tables_of_the_examples_are_as_it_says(path: Path, wrong: Callable[[Any], list[str]]) -> None:
    assert wrong(as_data(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        ({"q1": 0.1, "fz": "much"}, "'much' is not of type"),
        ({"q1": 0.1, "instrument": "ruler"}, "'ruler' is not one of"),
        ({"q1": 0.1, "dx": 0.1, "x": 1.0}, "should not be valid"),
    ],
)
def test_what_the_reader_refuses_is_marked(
    spoilt: dict[str, Any], message: str, wrong: Callable[[Any], list[str]]
) -> None:
    (found,) = wrong({"rows": [spoilt]})
    assert message in found
    assert wrong({"rows": [{"q1": 0.1}]}) == []
    assert len(wrong({"header": {"decimal": "dot"}, "rows": [{"q1": 0.1}]})) == 1
