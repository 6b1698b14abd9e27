"""One self-contained HTML page from its parts: no other file, no network."""

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from beamstiff.report.html.parts import Fact, Figure, Section, embedded
from beamstiff.report.html.provenance import Provenance
from beamstiff.report.html.robot_view import RobotView
from beamstiff.report.verdict import Verdict

OPTIONS = re.compile(r" \([^()]*--[^()]*\)")  # how to call a command: what a page's reader does not type


@dataclass(frozen=True)
class Page:
    """A report."""

    # title, robot: what is reported, of which robot
    title: str
    robot: str
    verdict: Verdict  # the answer in a line, the data, what to do next
    summary: Sequence[str]  # in plain words, a paragraph each
    facts: Sequence[Fact]  # numbers to begin with
    view: RobotView | None  # the robot in three dimensions
    sections: Sequence[Section]
    provenance: Provenance
    data: Mapping[str, Any]  # the result, as ``--json`` writes it
    papers: str = "--figure"  # the option that draws for papers; empty where there is none

    def html(self) -> str:
        """Return the page as HTML: one file with its style, its scripts and its data.

        Everything that comes from people's files is escaped.
        """
        environment = Environment(
            loader=PackageLoader("beamstiff.report.html"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        action = OPTIONS.sub("", self.verdict.action)
        texts = [OPTIONS.sub("", text) for text in self.summary]
        page = replace(self, verdict=replace(self.verdict, action=action), summary=texts)
        drawn = {one.key: _drawn(one) for section in page.sections for one in section.figures}
        shared = {name: values for section in page.sections for name, values in section.shared.items()}
        if page.view is not None:
            drawn[page.view.figure.key] = _drawn(page.view.figure) | {"views": page.view.views}
            shared |= page.view.shared
        script, plotly = f"\n{_asset('report.js')}\n", plotly_script()
        return environment.get_template("report.html").render(
            page=page,
            policy=_policy(script, plotly),
            sections=[one for one in page.sections if one.texts or one.items or one.figures or one.tables],
            style=Markup(_asset("report.css")),
            script=Markup(script),
            plotly=Markup(plotly),
            figures=Markup(embedded({"figures": drawn, "shared": shared})),
            data=Markup(embedded(page.data)),
        )


def _policy(*scripts: str) -> str:
    """Return a Content-Security-Policy under which a page runs these scripts, whole, and loads nothing.

    Styles stand in attributes too, and plotly adds a sheet of its own. It draws pictures of its figures from
    `data:` and `blob:`.
    """
    digests = (base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts)
    own = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {own}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def _drawn(figure: Figure) -> dict[str, Any]:
    return {"traces": figure.traces, "layout": figure.layout}


@cache
def plotly_script() -> str:
    """Return plotly.js as it comes with the Python package, fit to stand in a page."""
    from plotly.offline import get_plotlyjs

    text: str = get_plotlyjs()
    return text.replace("</script", r"<\/script")


def _asset(name: str) -> str:
    return files("beamstiff.report.html").joinpath("templates", name).read_text(encoding="utf-8")
