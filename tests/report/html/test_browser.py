"""The reports as people open them: in a real browser.

A page takes seconds to draw where three dimensions are drawn without a graphics card, so that the tests of
one report share one opened page.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from tests.report.html.conftest import JOINT_NAME, LINK_NAME, ROBOT_NAME

WIDE, NARROW = 1280, 390
PAPER = 700
SHAPE = "const plot = document.getElementById('plot-robot'); return [plot.data[0].x, plot.data[1].x];"
CHANGE = (
    "const control = document.getElementById(arguments[0]); control[arguments[1]] = arguments[2];"
    "control.dispatchEvent(new Event('input')); control.dispatchEvent(new Event('change'));"
    "const done = arguments[3]; requestAnimationFrame(() => setTimeout(done, 100));"
)


def open_page(browser: Any, page: Path, width: int, theme: str) -> None:
    """Open a page in a width and a theme, and wait until its figures are drawn."""
    browser.get_log("browser")  # what others left
    size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    use_theme(browser, theme)
    browser.get(page.as_uri())
    until = time.monotonic() + 60
    while not browser.execute_script("return document.documentElement.dataset.drawn"):
        assert time.monotonic() < until, "the figures are not drawn after a minute"
        time.sleep(0.05)


def use_theme(browser: Any, theme: str) -> None:
    media = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)


def serious_faults(browser: Any, axe: str) -> list[Any]:
    """Return what axe-core finds serious, with every table open."""
    browser.execute_script("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    browser.execute_script(axe)
    found = browser.execute_async_script(
        "const done = arguments[0]; axe.run().then((all) => done(all.violations.map("
        "(one) => [one.impact, one.id, one.nodes.map((node) => node.html.slice(0, 200)).slice(0, 3)])))"
    )
    return [one for one in found if one[0] in ("serious", "critical")]


def errors_and_requests(browser: Any) -> tuple[list[Any], list[str]]:
    errors = [line for line in browser.get_log("browser") if line["level"] == "SEVERE"]
    fetched = browser.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")
    return errors, [name for name in fetched if not name.startswith(("data:", "blob:"))]


@pytest.fixture(scope="module", params=["diagnosis", "identification"])
def page(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(request.getfixturevalue(f"{request.param}_page"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def opened(browser: Any, page: Path) -> Any:
    """Return the browser with the page opened wide and light."""
    open_page(browser, page, WIDE, "light")
    return browser


def test_the_page_opens_without_an_error_and_without_the_network(opened: Any) -> None:
    assert errors_and_requests(opened) == ([], [])
    assert opened.execute_script("return document.documentElement.scrollWidth") <= WIDE


def test_every_figure_shows_data(opened: Any) -> None:
    plots = opened.execute_script(
        "return [...document.querySelectorAll('.plot')].map((plot) => [plot.dataset.figure,"
        " plot._fullData.length, plot._fullData.every((trace) => trace.visible === true),"
        " plot.data.every((trace) => [trace.x, trace.z].some((values) => values && values.length)),"
        " plot.getBoundingClientRect().height, plot.querySelectorAll('svg').length])"
    )
    assert len(plots) == len({plot[0] for plot in plots}) >= 8
    for name, traces, visible, filled, height, drawings in plots:
        assert (traces > 0, visible, filled, height > 100, drawings > 0) == (True,) * 5, name
    # the robot is drawn in three dimensions: a canvas, not plotly's note that there is no WebGL
    assert opened.execute_script("return document.querySelectorAll('#plot-robot canvas').length") > 0
    assert "WebGL is not supported" not in opened.find_element("id", "plot-robot").text


def test_the_slider_moves_the_shape_and_not_the_undeformed_robot(opened: Any) -> None:
    begin, most = opened.execute_script(
        "const slider = document.getElementById('magnification'); return [slider.defaultValue, slider.max]"
    )
    opened.execute_async_script(CHANGE, "magnification", "value", "0")
    still, same = opened.execute_script(SHAPE)
    assert same == still
    assert opened.find_element("id", "magnified").text == "× 0"
    shapes = []
    for value in (begin, most):
        opened.execute_async_script(CHANGE, "magnification", "value", value)
        same, moved = opened.execute_script(SHAPE)
        assert same == still
        shapes.append(moved)
    ways = [
        (far - rest) / (near - rest)
        for rest, near, far in zip(still, *shapes, strict=True)
        if rest is not None and abs(near - rest) > 1e-6
    ]
    assert ways
    assert ways == pytest.approx([float(most) / float(begin)] * len(ways), rel=1e-6)


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
    opened.execute_async_script(CHANGE, "camera", "selectedIndex", 1)
    eye = opened.execute_script("return document.getElementById('plot-robot').layout.scene.camera.eye")
    assert (eye["y"], eye["z"]) == (0, 0)


def test_names_are_shown_and_run_nothing(opened: Any) -> None:
    assert opened.find_element("css selector", "h1").text == ROBOT_NAME
    assert ROBOT_NAME in opened.title
    foreign = "return document.images.length + document.querySelectorAll('main b, main i').length"
    assert opened.execute_script(foreign) == 0
    assert opened.execute_script("return document.scripts.length") == 4
    assert JOINT_NAME in opened.execute_script("return document.body.textContent")
    hover = opened.execute_script("return document.getElementById('plot-robot').data[1].hovertext.join()")
    assert "&lt;img" in hover
    assert LINK_NAME not in hover
    # a dialogue would have made every command above fail


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


def test_axe_finds_no_serious_fault_in_the_wide_page(opened: Any, axe: str) -> None:
    assert serious_faults(opened, axe) == []


def test_a_narrow_dark_page_does_not_scroll_sideways(browser: Any, page: Path) -> None:
    open_page(browser, page, NARROW, "dark")
    assert errors_and_requests(browser) == ([], [])
    browser.execute_script("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert browser.execute_script("return document.documentElement.scrollWidth") <= NARROW
    wide = browser.execute_script(
        "return [...document.querySelectorAll('.plot')].map((one) => one.getBoundingClientRect().right)"
    )
    assert max(wide) <= NARROW


def test_axe_finds_no_serious_fault_in_the_narrow_dark_page(browser: Any, page: Path, axe: str) -> None:
    if browser.current_url != page.as_uri() or browser.execute_script("return innerWidth") != NARROW:
        open_page(browser, page, NARROW, "dark")
    assert serious_faults(browser, axe) == []
