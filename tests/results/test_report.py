import io
import json
import re

import numpy as np
import pytest
from browser import PROGRAM, Browser

import beaver_ftc as bf
from beaver_ftc.results.log import StoredLog
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.report import render, write_report

NASTY = "</script><script>throw 1</script> <b>&amp;"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A flight that detects in time and isolates too late, with a description that would be code."""
    given = bf.load("elevator-partial-loss").model_dump(mode="json", exclude_unset=True)
    given |= {"description": NASTY, "expect": {"detected_within_s": 0.5, "isolated_within_s": 0.001}}
    return bf.fly(given).save(tmp_path_factory.mktemp("runs"), report=False)


def test_report_needs_nothing_but_itself(folder):
    html = render([folder])
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)""", html)
    assert not re.search(r"(https?:)?//[a-z]+\.", html.replace("// ", ""))
    assert len(html) < 3e6


def test_report_says_the_verdict_the_numbers_and_the_versions(folder):
    html = render([folder])
    found = Metrics.of(json.loads((folder / "metrics.json").read_text()))
    assert "elevator-partial-loss: FAILED" in html
    assert html.count("MISSED") == 1
    loss = f"estimated loss {-100 * found.isolation.estimate:.0f} %"
    for said in ("12.00 s", f"{found.detection.delay_s:.2f} s", loss, "isolation delay ≤ 0.001 s", "jsbsim"):
        assert said in html


def test_text_of_a_scenario_cannot_become_part_of_the_page(folder):
    html = render([folder])
    assert "throw 1</script>" not in html
    assert html.count("</script>") == 2


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if PROGRAM is None:
        pytest.skip("no Chromium is installed")
    opened = Browser(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


@pytest.fixture
def page(browser, folder, tmp_path):
    browser.trouble.clear()
    write_report(tmp_path / "report.html", [folder])
    browser.open(tmp_path / "report.html")
    yield browser
    assert browser.trouble == []


def _middle(page, selector):
    box = page.evaluate(f"""(() => {{
      const element = document.querySelector("{selector}");
      element.scrollIntoView({{block: "center"}});
      const box = element.getBoundingClientRect();
      return [box.left, box.top, box.width, box.height];
    }})()""")
    page.settle()
    return box


def test_dragging_zooms_all_axes_and_double_click_undoes_it(page):
    left, top, width, height = _middle(page, "#tracking canvas")
    before = page.evaluate("[beaverReport.clock.start, beaverReport.clock.end]")
    for kind, share in (("mousePressed", 0.4), ("mouseMoved", 0.5), ("mouseReleased", 0.6)):
        page.mouse(kind, left + share * width, top + height / 2)
    start, end = page.evaluate("[beaverReport.clock.start, beaverReport.clock.end]")
    assert before[0] < start < end < before[1]
    assert end - start == pytest.approx(0.2 * (before[1] - before[0]), rel=0.1)
    page.evaluate("document.querySelector('#states canvas').dispatchEvent(new MouseEvent('dblclick'))")
    assert page.evaluate("[beaverReport.clock.start, beaverReport.clock.end]") == before


def test_pointing_reads_the_value_of_the_log_with_its_unit(page, folder):
    _middle(page, "#states canvas")
    page.evaluate("beaverReport.setTime(10)")
    page.settle()
    said = page.evaluate("document.querySelector('#states output').value")
    airspeed_mps = StoredLog(folder / "log.parquet").read(["airspeed_mps"])["airspeed_mps"][1000]
    assert said == f"{airspeed_mps:.2f} m/s"


def test_replay_moves_at_the_pace_of_the_flight_and_stops(page):
    page.evaluate("document.getElementById('play').click()")
    took = page.evaluate("""(async () => {
      const [then, t] = [performance.now(), beaverReport.clock.now];
      await new Promise((done) => setTimeout(done, 700));
      return (beaverReport.clock.now - t) / ((performance.now() - then) / 1000);
    })()""")
    assert took == pytest.approx(1.0, abs=0.15)
    page.evaluate("document.getElementById('play').click()")
    assert page.evaluate("beaverReport.clock.playing") is False


def test_replay_turns_the_aircraft(page):
    from PIL import Image

    _middle(page, ".space canvas")
    looks = []
    for time in (0, 3):
        page.evaluate(f"beaverReport.setTime({time})")
        page.settle()
        looks.append(np.asarray(Image.open(io.BytesIO(page.screenshot())), float) / 255.0)
    assert np.abs(looks[0] - looks[1]).max() > 0.2


ENDS = """((course, climb) => {
  const [c, s] = [Math.cos(course), Math.sin(course)], of = (k) => [0, k / 2, k];
  const level = { t_s: [0, 15, 30], north_m: of(1200 * c), east_m: of(1200 * s), altitude_m: of(climb) };
  const space = new Space({ levels: [level], marks: [] });
  const at = (i, side) => [level.north_m[i] - side * s, level.east_m[i] + side * c, level.altitude_m[i]];
  const project = space.camera(900, 400, space.centre, 2 * space.extent);
  return [at(0, 0), at(2, 0), at(1, 0), at(1, 100)].map((point) => project(space.raised(point)));
})"""


@pytest.mark.parametrize("course_deg", [0, 135, 350])
@pytest.mark.parametrize("climb_m", [-300, 20])
def test_a_path_that_descends_goes_down_on_the_screen(page, course_deg, climb_m):
    """Whatever its course, from left to right; what is to the right of the aircraft is nearer."""
    start, end, middle, right = page.evaluate(f"{ENDS}({np.radians(course_deg)}, {climb_m})")
    assert start[0] < end[0]
    assert (start[1] < end[1]) == (climb_m < 0)
    assert right[2] < middle[2]


def test_phone_needs_no_sideways_scrolling(page):
    page.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=2, mobile=True)
    page.settle()
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.call("Emulation.clearDeviceMetricsOverride")


def test_paper_gets_curves_drawn_for_its_width_and_nothing_to_press(page):
    page.call("Emulation.setEmulatedMedia", media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    widths = page.evaluate("[...document.querySelectorAll('#tracking canvas')].map((c) => c.width)")
    assert all(0 < width <= 2 * 700 for width in widths)
    assert page.evaluate("document.getElementById('play').checkVisibility()") is False
    page.call("Emulation.setEmulatedMedia", media="")
    page.evaluate("dispatchEvent(new Event('afterprint'))")


def test_runs_stand_side_by_side_on_the_same_scale(browser, folder, tmp_path):
    quiet = bf.fly("fault-free").save(tmp_path, report=False)
    write_report(tmp_path / "both.html", [folder, quiet])
    browser.trouble.clear()
    browser.open(tmp_path / "both.html")
    assert browser.evaluate("document.querySelectorAll('#tracking canvas').length") == 6
    boxes = browser.evaluate("""[...document.querySelectorAll('#tracking .grid')].map((grid) => {
      const box = grid.getBoundingClientRect(); return [box.left, box.top]; })""")
    assert boxes[0][0] < boxes[1][0]
    assert boxes[0][1] == boxes[1][1]
    assert browser.trouble == []
