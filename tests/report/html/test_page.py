"""The page as text: one file, escaped, whole, with the numbers that ``--json`` writes."""

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from beamstiff.diagnosis.result import Diagnosis
from beamstiff.exam.record import Record
from beamstiff.exam.table import table_dict
from beamstiff.functions.predict import Prediction
from beamstiff.identification.result import Identification
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.report.diagnosis_text import summary
from beamstiff.report.html.deflection import deflection_html
from beamstiff.report.html.diagnosis import diagnosis_html
from beamstiff.report.html.exam import exam_html
from beamstiff.report.html.identification import identification_html
from beamstiff.report.html.provenance import Provenance
from beamstiff.robot.description import Robot
from tests.report.html.conftest import JOINT_NAME, KINDS, LINK_NAME, ROBOT_NAME

VOID = {"meta", "link", "input", "br", "wbr"}
IMPLIED = {"tr", "td", "th", "thead", "tbody", "li", "option", "p"}  # whose end HTML lets one leave out


class Outline(HTMLParser):
    """Tags, ids, headings and text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.attributes: list[tuple[str, dict[str, str | None]]] = []
        self.headings: list[int] = []
        self.open: list[str] = []
        self.text: list[str] = []
        self.scripts: dict[str, str] = {}
        self.script = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        self.tags.append(tag)
        self.attributes.append((tag, known))
        if "id" in known:
            self.ids.append(str(known["id"]))
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag not in VOID and tag not in IMPLIED:
            self.open.append(tag)
        self.script = str(known.get("id", "")) if tag == "script" else self.script

    def handle_endtag(self, tag: str) -> None:
        if tag not in IMPLIED:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts[self.script] = self.scripts.get(self.script, "") + data
        elif self.open and self.open[-1] != "style":
            self.text.append(data)


@pytest.fixture(scope="module", params=KINDS)
def page(request: pytest.FixtureRequest) -> str:
    text: str = request.getfixturevalue(f"{request.param}_page")
    return text


@pytest.fixture(scope="module")
def outline(page: str) -> Outline:
    return Outline(page)


def test_every_tag_is_closed_and_every_id_is_there_once(outline: Outline) -> None:
    assert outline.open == []
    assert len(outline.ids) == len(set(outline.ids))
    for _, attributes in outline.attributes:
        for name in ("aria-labelledby", "for"):
            if name in attributes:
                assert attributes[name] in outline.ids
        if (attributes.get("href") or "").startswith("#"):
            assert str(attributes["href"])[1:] in outline.ids


def test_headings_go_down_a_step_at_a_time(outline: Outline) -> None:
    assert outline.headings[0] == 1
    assert outline.headings.count(1) == 1
    assert max(b - a for a, b in zip(outline.headings, outline.headings[1:], strict=False)) <= 1


def test_the_page_needs_no_other_file(outline: Outline) -> None:
    for tag, attributes in outline.attributes:
        assert "src" not in attributes, tag
        if tag == "link":
            assert attributes["href"] == "data:,"


def test_the_page_runs_its_own_scripts_and_nothing_else(page: str, outline: Outline) -> None:
    (policy,) = (
        str(attributes["content"])
        for tag, attributes in outline.attributes
        if tag == "meta" and attributes.get("http-equiv") == "Content-Security-Policy"
    )
    rules = {rule.split()[0]: rule.split()[1:] for rule in policy.split(";")}
    assert rules["default-src"] == ["'none'"]
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts]
    assert rules["script-src"] == [f"'sha256-{digest}'" for digest in reversed(digests)]
    assert len(digests) == 2
    # before anything that the policy is to hold for
    assert page.index("Content-Security-Policy") < page.index("<title>") < page.index("<style>")


def test_no_attribute_holds_a_script(outline: Outline) -> None:
    for tag, attributes in outline.attributes:
        for name, value in attributes.items():
            assert not name.startswith("on"), tag
            if name in ("href", "src", "action", "formaction"):
                assert re.match(r"#|data:,", str(value)), (tag, name, value)


def test_hostile_names_stay_text(outline: Outline) -> None:
    assert outline.tags.count("script") == 4
    assert not {"img", "b", "i"} & set(outline.tags)
    text = "".join(outline.text)
    assert ROBOT_NAME in text
    assert JOINT_NAME in text or LINK_NAME in text


def test_the_page_holds_what_json_holds(
    diagnosed: Diagnosis, diagnosis_page: str, identified: Identification, identification_page: str
) -> None:
    for result, page in ((diagnosed, diagnosis_page), (identified, identification_page)):
        held = json.loads(Outline(page).scripts["result"], parse_constant=pytest.fail)
        assert held == json.loads(json.dumps(result.to_dict()))


def test_the_summary_comes_first_and_says_what_the_terminal_says(
    diagnosed: Diagnosis, diagnosis_page: str
) -> None:
    text = "".join(Outline(diagnosis_page).text)
    at = [text.index(line) for line in summary(diagnosed).splitlines()]
    assert at == sorted(at)
    assert at[-1] < text.index("Posture")


def test_provenance_names_files_seed_command_and_versions(outline: Outline, source: Provenance) -> None:
    text = "".join(outline.text)
    for part in (source.command, *(part for file in source.files for part in file), "beamstiff", "numpy"):
        assert part in text


def test_plotly_knows_every_property_of_every_figure(outline: Outline) -> None:
    held = json.loads(outline.scripts["figures"])

    def resolved(value: Any) -> Any:
        if isinstance(value, list):
            return [resolved(item) for item in value]
        if isinstance(value, dict):
            if set(value) == {"css"}:
                return "#123456"
            if set(value) == {"shared"}:
                return held["shared"][value["shared"]]
            return {key: resolved(item) for key, item in value.items()}
        return value

    for figure in held["figures"].values():
        go.Figure(data=resolved(figure["traces"]), layout=resolved(figure["layout"]))
        for view in figure.get("views", []):
            for style, own in zip(figure["traces"], view["traces"], strict=True):
                shape = {
                    key: resolved(item)
                    for key, item in own.items()
                    if key not in ("dx", "dy", "dz", "shares")
                }
                drawn = resolved(style) | shape
                if "shares" in own:
                    if style["type"] == "mesh3d":
                        drawn["intensity"] = own["shares"]
                    else:
                        part = "marker" if style["mode"] == "markers" else "line"
                        drawn[part] = drawn[part] | {"color": own["shares"]}
                go.Figure(data=[drawn])


def test_a_colour_that_a_figure_asks_for_is_one_of_the_style(page: str, outline: Outline) -> None:
    asked = set(re.findall(r'"css":"(--[a-z]+)"', outline.scripts["figures"]))
    assert asked
    assert asked <= set(re.findall(r"(--[a-z]+):", page.partition("</style>")[0]))


def test_names_in_figures_are_escaped_for_plotly_which_reads_tags(diagnosis_page: str) -> None:
    held = json.loads(Outline(diagnosis_page).scripts["figures"])
    hover = held["figures"]["robot"]["views"][0]["traces"][1]["hovertext"]
    assert any(text.startswith("&lt;img") for text in hover)
    assert LINK_NAME not in hover


def test_the_same_result_gives_the_same_page(
    diagnosed: Diagnosis, diagnosis_page: str, source: Provenance
) -> None:
    assert diagnosis_html(diagnosed, source) == diagnosis_page


def test_of_many_rows_the_worst_are_shown_and_the_page_stays_small(
    identified: Identification, robot: Robot, rows: Measurements, source: Provenance
) -> None:
    times = 40
    many = subset(rows, np.tile(np.arange(len(rows)), times))
    predicted = np.tile(identified.predicted, (times, 1))
    worst = 1234
    predicted[worst, :3] += 1.0  # m
    page = identification_html(replace(identified, predicted=predicted), robot, many, source)
    assert len(page.encode()) < 6e6
    outline = Outline(page)
    assert f"1000 of the {len(many)} rows are shown" in "".join(outline.text)
    held = json.loads(outline.scripts["figures"])["shared"]
    assert len(held["rows"]) == len(held["size_before"]) == 1000
    assert max(held["size_before"]) > 500  # mm


def test_the_exam_of_a_plan_begins_with_what_could_be_found(
    records: list[Record], source: Provenance
) -> None:
    page = exam_html(records, "arm", source, table_dict(records), plan=True)
    outline = Outline(page)
    assert outline.ids.index("plan") < outline.ids.index("asked")
    text = "".join(outline.text)
    assert "In 2 of 4 cases the effect would be found exactly" in text
    held = json.loads(outline.scripts["figures"])["figures"]["plan-covered"]
    hardest = held["traces"][1]
    assert hardest["x"] == sorted(hardest["x"])


def test_displacements_of_nothing_are_drawn_nowhere(
    robot: Robot, rows: Measurements, source: Provenance
) -> None:
    still = np.zeros((len(rows), 6))
    plain = make_measurements(["q1", "q2"], rows.q, tcp="tip", wrench=0 * rows.wrench)
    outline = Outline(deflection_html(Prediction(robot, plain, still, False), source))
    assert "workspace" not in outline.ids
    assert "The tool moves 0 mm at most" in "".join(outline.text)


def test_joints_of_a_page_are_in_degrees_as_its_figures_are(
    diagnosed: Diagnosis, diagnosis_page: str
) -> None:
    text = diagnosis_page.split("<script", 1)[0]
    assert "rad or m" not in diagnosis_page
    for k, variable in enumerate(diagnosed.baseline.nominal.actuated):
        assert variable.kind == "angle"
        q = np.degrees(diagnosed.baseline.rows.q[:, k])
        if np.ptp(q) == 0:
            continue
        table = text[text.index(f"{variable.name}, deg") :].split("</table>", 1)[0]
        ends = [float(end) for end in re.findall(r"-?\d+(?:\.\d+)?(?= to|<)", table)]
        assert min(ends) == pytest.approx(q.min(), rel=1e-3)


def test_none_and_unknown_are_among_the_bars(diagnosis_page: str) -> None:
    bars = Outline(diagnosis_page).scripts["figures"]
    assert '"none"' in bars
    assert '"unknown"' in bars


FIRST = "Mind first: "


def test_loads_of_the_wrong_sign_stand_before_the_verdict(
    diagnosed: Diagnosis, diagnosis_page: str, source: Provenance
) -> None:
    rows = diagnosed.baseline.rows
    turned = replace(diagnosed.baseline, rows=replace(rows, wrench=-rows.wrench))
    text = "".join(Outline(diagnosis_html(replace(diagnosed, baseline=turned), source)).text)
    assert 0 < text.index("fx, fy reversed") < text.index(summary(diagnosed).splitlines()[0])
    assert FIRST not in "".join(Outline(diagnosis_page).text)


def test_and_before_what_was_identified(
    identified: Identification, robot: Robot, rows: Measurements, source: Provenance
) -> None:
    turned = replace(rows, wrench=-rows.wrench)
    text = "".join(Outline(identification_html(identified, robot, turned, source)).text)
    assert text.index("fx, fy reversed") < text.index("Position residual")
