"""Whatever people's files and names hold, every report that a command writes shows it as text."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from beamstiff.cli.main import app
from tests.cli.conftest import CRANE
from tests.exam.standins import always_none
from tests.report.html.test_command import PATH, READINGS, many
from tests.report.html.test_page import Outline

HOSTILE = [
    "</script><script>steal()</script>",
    "\"' onmouseover='steal()' \"><img src=x onerror=steal()>",
    "javascript:steal()<!--<script>{{ 7 * 191 }}{% raw %}]]></style><svg onload=steal()>",
]
COMMANDS = {
    "deflect": ["deflect", "ROBOT", "rows.csv"],
    "identify": ["identify", "ROBOT", "rows.csv"],
    "diagnose": ["diagnose", "ROBOT", "rows.csv"],
    "compare": ["compare", "ROBOT", "rows.csv", "--models", "nominal,parametric"],
    "calibrate": ["calibrate", "ROBOT", "readings.csv", "--parameters", "q1,TIP.x"],
    "compensate": ["compensate", "ROBOT", "path.csv"],
    "exam": ["exam", "ROBOT", "--cases", "2", "--classes", "null,load-error", "--no-compare"],
}


def test_every_command_that_writes_a_report_is_tried() -> None:
    commands = typer.main.get_command(app).commands
    writes = {name for name, one in commands.items() if any("--html" in option.opts for option in one.params)}
    assert writes == set(COMMANDS)


LONG = (
    "diagnose",
    "compare",
)  # commands that calculate long: with one of the texts, the others by `make slow`


@pytest.mark.parametrize(
    ("command", "text"),
    [
        pytest.param(command, text, marks=pytest.mark.slow if command in LONG and text != HOSTILE[0] else ())
        for command in COMMANDS
        for text in HOSTILE
    ],
)
def test_hostile_texts_stay_texts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("beamstiff.functions.examine._diagnose", lambda: always_none)
    names = {old: f"{text} {old}" for old in ("crane", "arm", "J1", "tip")}
    robot = CRANE
    for old, new in names.items():
        robot = re.sub(rf"\b{old}\b", lambda _, new=new: json.dumps(new), robot)
    robot = robot.replace(
        f"[{json.dumps(names['J1'])}.torsional]", f"[{json.dumps(names['J1'] + '.torsional')}]"
    )
    if command not in ("exam", "calibrate", "compensate"):
        robot += (
            "effects:\n  - {effect: backlash, component: q1, shape: flank within 0.03,"
            " parameters: {half_width: 0.2 mrad}, scales: {torque: 700}}\n"
        )
    file = re.sub(r"[/\0]", "_", f"{text}.yaml")
    Path(file).write_text(robot, encoding="utf-8")
    quoted = '"' + text.replace('"', '""') + '"'
    head, *rows = many().splitlines()[1:]
    table = "\n".join(
        [
            f"# operator: {text}",
            f"{head},remark,point",
            *(f'{row},{quoted},"{names["tip"].replace(chr(34), 2 * chr(34))}"' for row in rows),
        ]
    )
    Path("rows.csv").write_text(f"# sigma_position: 0.01 mm\n{table}\n", encoding="utf-8")
    Path("readings.csv").write_text(READINGS, encoding="utf-8")
    Path("path.csv").write_text(PATH.replace("\na,", f"\n{quoted},"), encoding="utf-8")
    arguments = [one.replace("ROBOT", file).replace("TIP", names["tip"]) for one in COMMANDS[command]]
    result = CliRunner().invoke(app, [*arguments, "--html", "out.html"], prog_name="beamstiff")
    assert result.exit_code == 0, result.output
    page = Path("out.html").read_text(encoding="utf-8")
    outline = Outline(page)
    assert outline.open == []
    assert outline.tags.count("script") == 4
    assert not {"img", "svg", "object", "iframe", "base", "form"} & set(outline.tags)
    for tag, attributes in outline.attributes:
        assert not any(name.startswith("on") for name in attributes), tag
        assert not str(attributes.get("href", "#")).startswith("javascript"), tag
    said = "".join(outline.text)
    assert names["crane"] in said
    assert "1337" not in said
    # plotly reads tags in texts of figures
    drawn = json.loads(outline.scripts["figures"])
    for view in drawn["figures"].get("robot", {}).get("views", []):
        del view["name"]  # of a list of options, not of a figure
    texts: list[Any] = [drawn]
    while texts:
        one = texts.pop()
        if isinstance(one, str):
            assert not re.search(r"<(?!/?(b|br|i|sub|sup|extra|span)\b)", one), one
        elif isinstance(one, dict | list):
            texts += one.values() if isinstance(one, dict) else one
