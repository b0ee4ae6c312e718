"""The page in a headless Chromium: it opens, flies, breaks, detects, saves, and keeps strangers out."""

import functools
import http.server
import threading

import pytest
from live_browser import CHROMIUM, COMPILED_WITHIN_S, shows, until

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
