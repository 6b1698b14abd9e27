"""The reports as people open them: in a real browser.

A page takes seconds to draw where three dimensions are drawn without a graphics card. So all tests share one
browser, every kind of report is opened once and looked at wide and narrow, light and dark; what is the same
script in all of them is tried on one.
"""

import itertools
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from beamstiff.report.html.links import DIAGONAL
from tests.report.html.conftest import JOINT_NAME, KINDS, LINK_NAME, ROBOT_NAME

QUICK = ("diagnosis", "identification", "exam")  # opened in every run, the others by `make slow`
WIDE, NARROW = 1280, 390
PAPER = 700
SHAPE = "const plot = document.getElementById('plot-robot'); return [plot.data[0].x, plot.data[1].x];"
# which trace the slider moves; the first of all stands
MOVING = {
    "diagnosis": 1,
    "identification": 1,
    "deflection": 1,
    "comparison": 1,
    "calibration": 3,
    "compensation": 4,
}
LOOK = (
    "return [getComputedStyle(document.body).backgroundColor,"
    " document.querySelector('.plot').layout.font.color]"
)
FOLLOWED = (
    "const ink = getComputedStyle(document.documentElement).getPropertyValue('--ink').trim();"
    "return [...document.querySelectorAll('.plot')].every((one) => one.layout.font.color === ink"
    f" && one._fullLayout.width < {NARROW})"
)
CHANGE = (
    "const control = document.getElementById(arguments[0]); control[arguments[1]] = arguments[2];"
    "control.dispatchEvent(new Event('input')); control.dispatchEvent(new Event('change'));"
    "const done = arguments[3]; requestAnimationFrame(() => setTimeout(done, 100));"
)


def open_page(browser: Any, page: Path, width: int, theme: str) -> None:
    """Open a page in a width and a theme, and wait until its figures are drawn."""
    browser.get_log("browser")  # what others left
    set_width(browser, width)
    use_theme(browser, theme)
    browser.get(page.as_uri())
    wait_until(browser, "return document.documentElement.dataset.drawn", "the figures are not drawn")
    # what is behind a heading is drawn when it is opened
    browser.execute_script("document.querySelectorAll('details.part').forEach((one) => { one.open = true; })")
    drawn = (
        "return [...document.querySelectorAll('.plot')].every((plot) => plot._fullData && plot._fullLayout)"
    )
    wait_until(browser, drawn, "the figures behind headings are not drawn")


def wait_until(browser: Any, condition: str, fault: str) -> None:
    until = time.monotonic() + 60
    while not browser.execute_script(condition):
        assert time.monotonic() < until, fault
        time.sleep(0.05)


def set_width(browser: Any, width: int) -> None:
    size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def use_theme(browser: Any, theme: str) -> None:
    media = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)


def turn_narrow_and_dark(browser: Any) -> None:
    """Change width and theme of the opened page, as people do, until its figures have followed."""
    set_width(browser, NARROW)
    use_theme(browser, "dark")
    wait_until(browser, FOLLOWED, "the figures do not follow the window")


def serious_faults(browser: Any, axe: str) -> list[Any]:
    """Return what axe-core finds serious, with every table open."""
    browser.execute_script("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    browser.execute_script(axe)
    found = browser.execute_async_script(
        "const done = arguments[0];"
        "axe.run({ resultTypes: ['violations'] }).then((all) => done(all.violations.map("
        "(one) => [one.impact, one.id, one.nodes.map((node) => node.html.slice(0, 200)).slice(0, 3)])))"
    )
    return [one for one in found if one[0] in ("serious", "critical")]


def errors_and_requests(browser: Any) -> tuple[list[Any], list[str]]:
    errors = [line for line in browser.get_log("browser") if line["level"] == "SEVERE"]
    fetched = browser.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")
    return errors, [name for name in fetched if not name.startswith(("data:", "blob:"))]


def figures_at_fault(browser: Any) -> list[str]:
    """Return the figures that show no data, or none of it."""
    plots = browser.execute_script(
        "return [...document.querySelectorAll('.plot')].map((plot) => [plot.dataset.figure,"
        " plot._fullData.length > 0, plot._fullData.every((trace) => trace.visible === true),"
        " plot.data.every((trace) => [trace.x, trace.z].some((values) => values && values.length)),"
        " plot.getBoundingClientRect().height > 100, plot.querySelectorAll('svg').length > 0])"
    )
    assert len(plots) == len({plot[0] for plot in plots}) >= 3
    # the robot is drawn in three dimensions: a canvas, not plotly's note that there is no WebGL
    canvases = "return document.querySelectorAll('#plot-robot canvas').length"
    for robot in browser.find_elements("id", "plot-robot"):
        assert browser.execute_script(canvases) > 0
        assert "WebGL is not supported" not in robot.text
    return [name for name, *good in plots if not all(good)]


def written(page: str, folder: Path) -> Path:
    path = folder / "report.html"
    path.write_text(page, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in KINDS]
)
def test_a_page_opens_without_fault_wide_and_light_narrow_and_dark(
    kind: str, browser: Any, axe: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    page = written(request.getfixturevalue(f"{kind}_page"), tmp_path)
    open_page(browser, page, WIDE, "light")
    assert errors_and_requests(browser) == ([], [])
    assert figures_at_fault(browser) == []
    assert overprinted(browser) == []
    assert browser.execute_script("return document.documentElement.scrollWidth") <= WIDE
    assert serious_faults(browser, axe) == []
    names_are_shown_and_run_nothing(browser)
    if kind in MOVING:
        check_the_slider(browser, MOVING[kind])
    light = browser.execute_script(LOOK)
    turn_narrow_and_dark(browser)
    assert errors_and_requests(browser) == ([], [])
    assert all(one != other for one, other in zip(light, browser.execute_script(LOOK), strict=True))
    assert serious_faults(browser, axe) == []  # opens all tables, too
    assert browser.execute_script("return document.documentElement.scrollWidth") <= NARROW
    assert cut(browser) == []
    right = "return [...document.querySelectorAll('.plot')].map((one) => one.getBoundingClientRect().right)"
    assert max(browser.execute_script(right)) <= NARROW


# the boxes of all texts of a figure, and of its buttons; texts that are turned count upright
BOXES = (
    "const shown = (box) => box.width > 0 && box.height > 0;"
    "return [...document.querySelectorAll('.plot')].map((plot) => [plot.dataset.figure,"
    " [...plot.querySelectorAll('svg text, .modebar-group')].map((one) => [one.textContent,"
    " one.getBoundingClientRect()]).filter(([, box]) => shown(box))"
    ".map(([text, box]) => [text, box.left, box.top, box.right, box.bottom])])"
)
TOUCH = 2.0  # px that boxes may share: they are larger than what is drawn in them


def overprinted(browser: Any) -> list[tuple[str, str, str]]:
    """Return the texts of figures whose boxes overlap: the figure, and both texts."""
    found, figures = [], browser.execute_script(BOXES)
    assert sum(len(texts) for _, texts in figures) > 20, "there is what could overlap"
    for figure, texts in figures:
        for (one, *a), (other, *b) in itertools.combinations(texts, 2):
            wide = min(a[2], b[2]) - max(a[0], b[0])
            high = min(a[3], b[3]) - max(a[1], b[1])
            if wide > TOUCH and high > TOUCH:
                found.append((figure, one, other))
    return found


def cut(browser: Any) -> list[tuple[str, str]]:
    """Return the texts that leave their figure: the figure, and the text."""
    edges = (
        "return [...document.querySelectorAll('.plot')].map((one) => one.getBoundingClientRect())"
        ".map((box) => [box.left, box.top, box.right, box.bottom])"
    )
    return [
        (figure, text)
        for (figure, texts), box in zip(
            browser.execute_script(BOXES), browser.execute_script(edges), strict=True
        )
        for text, left, top, right, bottom in texts
        if min(left - box[0], top - box[1], box[2] - right, box[3] - bottom) < -TOUCH
    ]


@pytest.mark.parametrize(
    "kind", ["diagnosis", pytest.param("identification", marks=pytest.mark.slow), "exam"]
)
def test_no_label_overprints_another_in_other_widths(
    kind: str, browser: Any, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    page = written(request.getfixturevalue(f"{kind}_page"), tmp_path)
    for width, theme in ((NARROW, "dark"), (768, "light"), (1920, "light")):
        open_page(browser, page, width, theme)
        assert overprinted(browser) == [], width
        assert cut(browser) == [], width
        assert errors_and_requests(browser) == ([], [])
        assert figures_at_fault(browser) == []
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize(
    ("first", "then"), [pytest.param(NARROW, 1280, marks=pytest.mark.slow), (1280, NARROW)]
)
def test_a_page_that_is_resized_while_it_is_open_is_drawn_for_its_new_width(
    first: int, then: int, browser: Any, diagnosis_page: str, tmp_path: Path
) -> None:
    page, drawn = written(diagnosis_page, tmp_path), []
    names = "[...document.querySelectorAll('.plot .ytick')].map((one) => one.textContent).join()"
    for start in (then, first):
        open_page(browser, page, start, "light")
        set_width(browser, then)
        if start == then:
            drawn.append(json.dumps(browser.execute_script(f"return {names}")))
    wait_until(browser, f"return {names} === {drawn[0]}", "the labels are those of the old width")
    assert overprinted(browser) == []
    assert figures_at_fault(browser) == []


def test_overlapping_labels_are_found(opened: Any) -> None:
    opened.execute_async_script(
        "const done = arguments[0], plot = document.querySelector('.plot:not(#plot-robot)');"
        "const note = (text) => ({text, showarrow: false, xref: 'paper', yref: 'paper', x: 0.5, y: 0.5});"
        "Plotly.relayout(plot, {annotations: [note('one'), note('two')]}).then(() => done())"
    )
    assert any({"one", "two"} == {a, b} for _, a, b in overprinted(opened))


def names_are_shown_and_run_nothing(browser: Any) -> None:
    assert browser.find_element("css selector", "h1").text == ROBOT_NAME
    assert ROBOT_NAME in browser.title
    foreign = "return document.images.length + document.querySelectorAll('main b, main i').length"
    assert browser.execute_script(foreign) == 0
    assert browser.execute_script("return document.scripts.length") == 4
    text = browser.execute_script("return document.body.textContent")
    assert JOINT_NAME in text or LINK_NAME in text
    # a dialogue would have made every command above fail


@pytest.fixture(scope="module")
def opened(browser: Any, diagnosis_page: str, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return the browser with the report of a diagnosis opened wide and light."""
    open_page(browser, written(diagnosis_page, tmp_path_factory.mktemp("page")), WIDE, "light")
    return browser


def check_the_slider(browser: Any, moving: int) -> None:
    """Check that a trace moves in proportion to the slider, and that the undeformed robot stands."""
    begin, most = browser.execute_script(
        "const slider = document.getElementById('magnification'); return [slider.defaultValue, slider.max]"
    )
    plot = "document.getElementById('plot-robot')"
    shape = f"return [{plot}.data[0].x, {plot}.data[{moving}].x];"
    browser.execute_async_script(CHANGE, "magnification", "value", "0")
    resting, unmoved = browser.execute_script(shape)
    assert browser.find_element("id", "magnified").text == "× 0"
    shapes = []
    for value in (begin, most):
        browser.execute_async_script(CHANGE, "magnification", "value", value)
        same, moved = browser.execute_script(shape)
        assert same == resting
        shapes.append(moved)
    ways = [
        (far - rest) / (near - rest)
        for rest, near, far in zip(unmoved, *shapes, strict=True)
        if rest is not None and abs(near - rest) > 1e-6
    ]
    assert ways
    assert ways == pytest.approx([float(most) / float(begin)] * len(ways), rel=1e-6)


def test_the_robot_s_box_has_the_same_diagonal_whatever_its_shape(opened: Any) -> None:
    ratio = opened.execute_script("return document.getElementById('plot-robot').layout.scene.aspectratio")
    assert np.linalg.norm(list(ratio.values())) == pytest.approx(DIAGONAL)


def test_the_keyboard_reaches_the_controls(opened: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    reached = []
    for _ in range(60):
        opened.switch_to.active_element.send_keys(Keys.TAB)
        reached.append(opened.switch_to.active_element.get_attribute("id"))
        if reached[-1] == "magnification":
            break
    assert "posture" in reached
    assert reached[-1] == "magnification"
    before = float(opened.find_element("id", "magnification").get_attribute("value"))
    opened.switch_to.active_element.send_keys(Keys.ARROW_LEFT)
    assert float(opened.find_element("id", "magnification").get_attribute("value")) < before


def test_the_posture_and_the_camera_change_the_view(opened: Any) -> None:
    before = opened.execute_script(SHAPE)
    opened.execute_async_script(CHANGE, "posture", "selectedIndex", 1)
    assert opened.execute_script(SHAPE) != before
    opened.execute_async_script(CHANGE, "camera", "selectedIndex", 2)
    eye = opened.execute_script("return document.getElementById('plot-robot').layout.scene.camera.eye")
    assert (eye["y"], eye["z"]) == (0, 0)


def test_names_in_the_robot_are_escaped_for_plotly(opened: Any) -> None:
    hover = opened.execute_script("return document.getElementById('plot-robot').data[1].hovertext.join()")
    assert "&lt;img" in hover
    assert LINK_NAME not in hover


def test_the_theme_follows_the_system(opened: Any) -> None:
    look = (
        "const plot = document.getElementById('plot-robot'); return [getComputedStyle(document.body)"
        ".backgroundColor, plot.layout.font.color, plot.data[0].line.color]"
    )
    light = opened.execute_script(look)
    use_theme(opened, "dark")
    until = time.monotonic() + 30
    while (dark := opened.execute_script(look))[2] == light[2] and time.monotonic() < until:
        time.sleep(0.05)
    use_theme(opened, "light")
    assert all(one != other for one, other in zip(light, dark, strict=True))
    assert all("var(" not in colour and "[object" not in colour for colour in (*light, *dark))


def test_the_page_prints_light_with_its_tables_open(opened: Any) -> None:
    use_theme(opened, "dark")
    closed = "return document.querySelectorAll('details:not([open])').length"
    scheme = "return getComputedStyle(document.documentElement).colorScheme"
    opened.execute_script("document.querySelector('#rows > details').open = false")
    before = opened.execute_script(closed)
    # at once: paper does not wait
    widest = opened.execute_script(
        "dispatchEvent(new Event('beforeprint')); return Math.max("
        "...[...document.querySelectorAll('.main-svg')].map((one) => one.clientWidth))"
    )
    assert 300 < widest <= PAPER
    assert opened.execute_script(closed) == 1  # the rows stay closed
    assert opened.execute_script(scheme) == "light"
    opened.execute_script("dispatchEvent(new Event('afterprint'))")
    assert opened.execute_script(closed) == before > 1
    assert opened.execute_script(scheme) == "dark"
    use_theme(opened, "light")
    assert len(opened.execute_cdp_cmd("Page.printToPDF", {})["data"]) > 10_000
