"""The page in a headless Chromium: it opens, flies, breaks, detects, saves, and keeps strangers out."""

import functools
import http.server
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from live_browser import CHROMIUM, COMPILED_WITHIN_S, shows, until

import beaver_ftc as bf

SCREENS = {
    "laptop": (1280, 720),
    "small laptop": (1024, 640),
    "phone": (390, 844),
    "phone sideways": (844, 390),
}

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")


@pytest.fixture(scope="module")
def context(chromium, cockpit):
    """The browser that the address has let in."""
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    first = context.new_page()
    first.goto(cockpit.address)
    until(first, "Boolean(window.cockpit && cockpit.flight.state)", COMPILED_WITHIN_S)
    first.close()  # it would go on drawing beside the page that a test looks at
    return context


@pytest.fixture
def page(context, cockpit):
    """A page in flight, from trim; it must not have had anything to complain about."""
    trouble = []
    page = context.new_page()
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("console", lambda said: trouble.append(said.text) if said.type == "error" else None)
    page.on("requestfailed", lambda request: trouble.append(request.url))
    page.goto(cockpit.home)
    until(page, "Boolean(window.cockpit && cockpit.flight.state)")
    met = page.evaluate("cockpit.flight.met")
    page.locator("#reset").click()
    until(page, f"cockpit.flight.met > {met} && cockpit.value('t_s') > 0.5")
    yield page
    page.close()
    assert trouble == []


def watched(page):
    """After the first second, in which no surface is named: an instrument could have raised the alarm."""
    until(page, "cockpit.value('t_s') > 1.1")


def break_elevator(page):
    watched(page)
    page.locator("fieldset[data-surface=elevator] >> text=lose 40 %").click()


def test_the_aircraft_moves_and_is_drawn(page):
    before = page.evaluate("[cockpit.value('north_m'), cockpit.drawn.frames]")
    until(page, f"cockpit.value('north_m') > {before[0] + 20}")
    assert page.evaluate("cockpit.drawn.frames") > before[1]
    picture = page.locator("#scene").screenshot()
    assert len(picture) > 5000  # a picture of one colour is a tenth of it


def test_frames_are_drawn_as_the_screen_asks(page):
    """Each time it asks, however often that is here; half of that passes."""
    page.wait_for_timeout(1000)
    asked, drawn = page.evaluate("""() => new Promise((done) => {
        const before = cockpit.drawn.frames;
        let asked = 0;
        const count = () => ++asked < 60
            ? requestAnimationFrame(count) : done([asked, cockpit.drawn.frames - before]);
        requestAnimationFrame(count);
    })""")
    assert drawn > asked / 2


def test_a_broken_surface_is_detected_named_and_repaired(page):
    break_elevator(page)
    assert shows(page, "#verdict", "elevator")
    assert shows(page, "#alarm", "ALARM")
    assert shows(page, "#candidates", "elevator named")
    assert shows(page, "#mode", "reallocated")  # a frame after the name
    page.locator("#tab-events").click()
    for word in ("broken", "alarm", "named", "supervisor"):
        assert shows(page, "#events", word)
    page.keyboard.press("0")
    until(page, "cockpit.flight.frame.effectiveness.every((x) => x === 1)")


def test_what_is_saved_flies_again_to_the_bit(page, cockpit):
    break_elevator(page)
    page.keyboard.down("d")
    page.wait_for_timeout(400)
    page.keyboard.up("d")
    until(page, "cockpit.flight.frame.stick === null && cockpit.value('t_s') > 2")
    page.locator("#save").click()
    until(page, "document.querySelector('#says').textContent.startsWith('saved')")
    folder = max(cockpit.out.iterdir())
    kept = bf.open_run(folder).log
    again = bf.fly(folder / "scenario.yaml").log
    assert np.array_equal(kept.to_numpy(), again.to_numpy(), equal_nan=True)
    own = bf.fly("fault-free").log["p_reference_rad_s"][: len(kept)]
    assert (kept["p_reference_rad_s"] - own).abs().max() > np.radians(4.9)  # the stick has moved
    assert kept["elevator_effective_rad"].ne(kept["elevator_cmd_rad"]).any()


def test_the_game_tells_nothing_before_the_answer(page):
    page.locator("#tab-game").click()
    page.locator("#game-second").click()
    until(page, "cockpit.flight.state.game.phase === 'waiting' && cockpit.value('t_s') > 0.5")
    page.locator("#tab-break").click()
    break_elevator(page)
    broken_s = page.evaluate("cockpit.value('t_s')")
    until(page, f"cockpit.value('t_s') > {broken_s} + 1.5")
    assert page.locator("#candidates .named, #candidates .out").count() == 0
    assert page.inner_text("#verdict") == ""
    assert page.evaluate("cockpit.value('elevator_effective_rad')") is None
    page.locator("#tab-game").click()
    page.locator("#answers button", has_text="elevator").click()
    until(page, "cockpit.flight.state.game.phase === 'over'")
    assert shows(page, "#game-says", "It was the elevator")


def test_the_autopilot_is_sent_to_an_altitude(page):
    page.locator("#tab-fly").click()
    assert page.locator("[name=altitude_m]").is_disabled()  # this flight has begun without one
    met = page.evaluate("cockpit.flight.met")
    page.locator("#autopilot-on").click()
    until(page, f"cockpit.flight.met > {met} && cockpit.value('t_s') > 0.5")
    page.locator("[name=altitude_m]").fill("1850")
    page.locator("#aim [type=submit]").click()
    page.locator("#speed").select_option("10")
    until(page, "cockpit.value('altitude_command_m') === 1850 && cockpit.value('altitude_m') > 1842")
    page.locator("#speed").select_option("1")
    page.locator("#tab-flight").click()
    page.locator("[name=autopilot]").select_option("off")
    page.locator("#fresh [type=submit]").click()
    until(page, "cockpit.flight.hello.autopilot.length === 0")


def test_speed_and_pause(page):
    page.locator("#speed").select_option("20")
    start = page.evaluate("cockpit.value('t_s')")
    until(page, f"cockpit.value('t_s') > {start + 10}")
    page.locator("#pause").click()
    until(page, "cockpit.flight.state.paused")
    page.wait_for_timeout(300)
    held = page.evaluate("cockpit.value('t_s')")
    page.wait_for_timeout(500)
    assert page.evaluate("cockpit.value('t_s')") == held
    page.locator("#pause").click()
    page.locator("#speed").select_option("1")
    until(page, f"cockpit.value('t_s') > {held}")


def test_with_the_keyboard_alone(page):
    page.locator("#tab-break").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("document.activeElement.id") == "tab-fly"
    page.keyboard.press("3")
    assert page.locator("#menu").is_visible()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")  # jam
    until(page, "cockpit.flight.state.broken.includes('rudder')")
    assert not page.locator("#menu").is_visible()
    page.keyboard.press("?")
    assert page.locator("#help-text").is_visible()
    page.keyboard.press("Escape")
    assert not page.locator("#help-text").is_visible()


def test_a_gamepads_stick_steers(page):
    """A faked one: full stick is 5 deg/s, nearly centred is centred; unplugged, it asks for nothing."""
    page.evaluate(
        """window.pads = [null, {connected: true, axes: [0.5, -1, 0.05]}];
        Object.defineProperty(navigator, "getGamepads", {value: () => window.pads})"""
    )
    until(page, "cockpit.flight.frame.stick !== null")
    rates = page.evaluate("cockpit.flight.frame.stick")
    assert np.degrees(rates) == pytest.approx([2.5, -5.0, 0.0])
    page.locator("#tab-fly").click()
    assert shows(page, "#stick-says", "roll 2.5, pitch -5, yaw 0")
    until(page, "cockpit.value('p_reference_rad_s') !== null")
    page.evaluate("window.pads = []")
    until(page, "cockpit.flight.frame.stick === null")


def test_law_and_diagnosis_are_changed_at_once(page):
    break_elevator(page)
    assert shows(page, "#verdict", "elevator")
    page.locator("#tab-flight").click()
    page.locator("[name=law]").select_option("lqr")
    page.locator("[name=scheme]").select_option("none")
    page.locator("#change").click()
    until(page, "cockpit.flight.state.flying.law === 'lqr' && !cockpit.flight.frame.detected")
    assert shows(page, "#flying", "law lqr, diagnosis none")
    assert shows(page, "#alarm", "no diagnosis ran: fdi.scheme is none")
    page.locator("[name=scheme]").select_option("adaptive-estimators")
    page.locator("#change").click()
    assert shows(page, "#alarm", "ALARM")
    assert shows(page, "#candidates", "elevator")  # named it is not: it was broken when the watch began
    before = page.evaluate("cockpit.flight.state.flying")
    page.locator("#renew").click()
    until(page, "document.querySelectorAll('#events b').length >= 9")
    until(page, "document.querySelector('#alarm').textContent.startsWith('ALARM')")
    assert page.evaluate("cockpit.flight.state.flying") == before


def test_a_sensor_is_broken_and_named(page):
    page.locator("#sensor").select_option("q")
    page.locator("#sensor-break").click()
    assert shows(page, "#verdict", "sensor q")
    assert shows(page, "#alarm", "ALARM")
    assert shows(page, "#sensors legend", "✕ q")
    page.locator("#sensor-repair").click()
    until(page, "cockpit.flight.state.broken.length === 0")


def test_a_minute_of_flight_drops_no_frame(page, cockpit):
    """Of the flight: its log has every frame; what the page is shown comes in order."""
    page.evaluate(
        """window.seen = []; window.watch = setInterval(() => {
        const t = cockpit.value("t_s"); if (t !== window.seen.at(-1)) window.seen.push(t); }, 1)"""
    )
    page.locator("#speed").select_option("5")
    until(page, "cockpit.value('t_s') > 61")
    seen = np.array(page.evaluate("(clearInterval(window.watch), window.seen)"))
    page.locator("#speed").select_option("1")
    page.locator("#save").click()
    until(page, "document.querySelector('#says').textContent.startsWith('saved')")
    t_s = bf.open_run(max(cockpit.out.iterdir())).log["t_s"].to_numpy()
    assert np.array_equal(np.round(100 * t_s), np.arange(t_s.size))
    assert t_s[-1] > 61
    assert (np.diff(seen) > 0).all()
    assert np.isin(np.round(100 * seen), np.arange(t_s.size)).all()


def test_what_is_broken_is_said_without_colour(page):
    assert page.inner_text("#legend") == "click a surface to break it"
    break_elevator(page)
    until(page, "document.querySelector('#legend').textContent === '✕ broken: elevator'")
    assert shows(page, "fieldset[data-surface=elevator] legend", "broken")
    assert "broken" not in page.inner_text("fieldset[data-surface=rudder] legend")


def test_a_fault_of_the_scenario_is_shown_while_it_is_there(page):
    """It comes at 12 s: badge, frame and button say nothing before, and nothing once all is repaired."""
    pressed = page.locator("#surfaces [aria-pressed=true]")
    page.locator("#tab-flight").click()
    met = page.evaluate("cockpit.flight.met")
    page.locator("[name=scenario]").select_option("rudder-stuck")
    page.locator("#fresh [type=submit]").click()
    until(page, f"cockpit.flight.met > {met} && cockpit.value('t_s') > 0.5")
    assert page.inner_text("#legend") == "click a surface to break it"
    assert page.locator("fieldset.broken").count() == pressed.count() == 0
    page.locator("#speed").select_option("20")
    until(page, "cockpit.flight.state.broken.includes('rudder')")
    page.locator("#speed").select_option("1")
    assert page.evaluate("cockpit.value('t_s')") >= 12
    until(page, "document.querySelector('#legend').textContent === '✕ broken: rudder'")
    page.locator("#tab-break").click()
    assert shows(page, "fieldset.broken legend", "broken: stuck")
    assert [button.get_attribute("aria-label") for button in pressed.all()] == ["rudder: jam"]
    assert page.evaluate("cockpit.flight.frame.effectiveness") == [1, 1, 0, 1]
    page.locator("#repair-all").click()
    until(page, "document.querySelector('#legend').textContent === 'click a surface to break it'")
    assert page.locator("fieldset.broken").count() == pressed.count() == 0
    met = page.evaluate("cockpit.flight.met")
    page.locator("#tab-flight").click()
    page.locator("[name=scenario]").select_option("fault-free")
    page.locator("#fresh [type=submit]").click()
    until(page, f"cockpit.flight.met > {met} && cockpit.flight.hello.scenario === 'fault-free'")


def test_the_page_says_which_faults_the_diagnosis_knows(page):
    until(page, "document.querySelector('#knows').textContent === 'knows every fault type'")
    watched(page)
    page.locator("fieldset[data-surface=elevator] >> text=jam").click()
    until(page, "/^Named: elevator, /.test(document.querySelector('#verdict').textContent)")
    assert shows(page, "#verdict", "stuck")


def test_everything_that_can_be_pressed_has_a_name(page):
    unnamed = page.evaluate(
        """[...document.querySelectorAll("button, select, input, canvas, [role=tab]")].filter((node) =>
        !node.textContent.trim() && !node.getAttribute("aria-label") && !node.labels?.length)
        .map((node) => node.outerHTML)"""
    )
    assert unnamed == []


# What is wider than its box, and which parts of the page lie upon one another.
STICKS_OUT = """(name) => [...document.querySelectorAll(name)].filter((node) => {
  const own = node.getBoundingClientRect(), box = node.closest("section").getBoundingClientRect();
  return own.left < box.left - 1 || own.right > box.right + 1 || node.scrollWidth > node.clientWidth + 1;
}).map((node) => node.textContent)"""
OVERLAPPING = """(() => {
  const nodes = [...document.querySelectorAll(
    "#scene, #attitude, #numbers dd, .chart .plot, #diagnosis, #tabs, .panel:not([hidden])")];
  const boxes = nodes.map((node) => node.getBoundingClientRect());
  const over = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const under = (a, i) => nodes.slice(0, i).filter((_, j) => over(a, boxes[j]));
  return boxes.flatMap((a, i) => under(a, i).map((node) => [nodes[i].id, node.id]));
})()"""


@pytest.mark.parametrize("screen", SCREENS)
def test_nothing_is_cut_off(page, screen):
    width, height = SCREENS[screen]
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for name in ("#numbers dd, #numbers dt", ".chart"):
        assert page.evaluate(STICKS_OUT, name) == []
    assert page.evaluate(OVERLAPPING) == []
    for name in ("#pause", "#save", "#scene", "#alarm", "#tab-events"):
        page.locator(name).scroll_into_view_if_needed()
        box = page.locator(name).bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width + 1


def resident_bytes(pid):
    """Memory of a process and of those it started."""
    own = int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return own + sum(map(resident_bytes, children))


def test_memory_does_not_grow_without_end(page, cockpit):
    page.locator("#speed").select_option("20")
    until(page, "cockpit.value('t_s') > 60")  # the charts' window is full three times over
    before = page.evaluate("(gc(), performance.memory.usedJSHeapSize)")
    resident = resident_bytes(cockpit.process.pid)
    start = page.evaluate("cockpit.value('t_s')")
    until(page, f"cockpit.value('t_s') > {start + 240}")
    page.locator("#speed").select_option("1")
    after = page.evaluate("(gc(), performance.memory.usedJSHeapSize)")
    assert after - before < 3e6
    assert (
        resident_bytes(cockpit.process.pid) - resident < 40e6
    )  # 24 000 rows of the log are 20 MB, in a file


def test_a_strangers_page_on_another_port_cannot_talk_to_it(context, cockpit, tmp_path):
    (tmp_path / "index.html").write_text("<title>a stranger</title>")
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=tmp_path)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        stranger = context.new_page()
        stranger.goto(f"http://127.0.0.1:{server.server_port}/index.html")
        outcome = stranger.evaluate(
            """(address) => new Promise((done) => {
              const socket = new WebSocket(address);
              socket.onopen = () => done("open");
              socket.onerror = () => done("refused");
            })""",
            cockpit.home.replace("http", "ws", 1) + "socket",
        )
        read = stranger.evaluate(
            "(address) => fetch(address, {credentials: 'include'}).then(() => 'read', () => 'refused')",
            cockpit.home,
        )
        stranger.close()
        server.shutdown()
    assert (outcome, read) == ("refused", "refused")
