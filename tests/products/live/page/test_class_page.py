"""The pages of a class in a headless Chromium: whoever flies, and guests on phones."""

import functools
import http.server
import threading

import pytest
from live_browser import CHROMIUM, COMPILED_WITHIN_S, until
from live_cockpit import ended, started

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")

NAME = "</b><script>x</script>"
THERE = "Boolean(window.cockpit && cockpit.flight.state)"


@pytest.fixture(scope="module")
def cockpit(tmp_path_factory):
    running = started(tmp_path_factory.mktemp("class"), "--guests", "2")
    running.links = [running.process.stdout.readline().split()[-1] for _ in range(2)]
    yield running
    assert ended(running) == (0, "")


@pytest.fixture(scope="module")
def pages(chromium, cockpit, tmp_path_factory):
    """Whoever flies, and a guest on a phone, who follows the link on another site's page."""
    trouble, folder = [], tmp_path_factory.mktemp("chat")
    no_icon = "<link rel='icon' href='data:,'>"  # to ask for: it would come as a complaint, sooner or later
    (folder / "index.html").write_text(f"{no_icon}<a href='{cockpit.links[0]}'>join</a>")
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as chat:
        threading.Thread(target=chat.serve_forever, daemon=True).start()
        found = []
        for size in ({"width": 1280, "height": 720}, {"width": 390, "height": 844}):
            found.append(chromium.new_context(viewport=size).new_page())
        found[1].goto(f"http://localhost:{chat.server_port}/index.html")  # no site of ours: another name
        for page in found:
            page.on("pageerror", lambda error: trouble.append(str(error)))
            page.on("console", lambda said: trouble.append(said.text) if said.type == "error" else None)
        found[0].goto(cockpit.address)
        found[1].get_by_text("join").click()
        for page in found:
            until(page, THERE, COMPILED_WITHIN_S)
        chat.shutdown()
    yield found
    assert trouble == []


def test_a_guest_looks_on_until_it_is_let_and_all_see_who_broke_it(pages):
    flyer, guest = pages
    until(guest, "!document.querySelector('#you').hidden")
    assert "token" not in guest.url
    assert guest.evaluate("document.referrer") == ""
    shown = guest.locator("button:visible, select:visible, [role=tab]:visible").all_inner_texts()
    assert not {"Pause", "Reset", "Save", "Reset diagnosis", "Fly", "Game", "Flight", "Class"} & set(shown)
    assert guest.inner_text("#legend") == "you are watching"
    assert guest.evaluate("document.querySelector('#panel-break').inert")
    for key in ("3", "0", "r", " ", "d"):
        guest.keyboard.press(key)
    guest.wait_for_timeout(300)
    assert not guest.locator("#menu").is_visible()
    state = guest.evaluate("cockpit.flight.state")
    assert (state["broken"], state["paused"], guest.evaluate("cockpit.flight.met")) == ([], False, 1)
    guest.fill("#name", NAME)
    guest.keyboard.press("Enter")
    flyer.click("#tab-class")
    until(flyer, f"document.querySelector('#guests span').textContent === {NAME!r}")
    assert "1 of 2 guests are here, 0 may break." in flyer.inner_text("#class-says")
    assert flyer.locator("#guests li.away").count() == 1
    flyer.locator("#guests button").first.click()
    until(guest, "!document.querySelector('#panel-break').inert")
    assert guest.inner_text("#invited").endswith("choose a surface, or a button under Break.")
    guest.locator("fieldset[data-surface=elevator] >> text=lose 40 %").click()
    said = f"broken: loss of effectiveness by {NAME} (guest 1)"
    for page in pages:
        until(page, f"document.querySelector('#surfaces').textContent.includes({said!r})")
        assert page.locator("script:not([src]), #surfaces script").count() == 0
    flyer.click("#tab-events")
    until(flyer, f"document.querySelector('#events').textContent.includes({f'by {NAME} (guest 1)'!r})")
    flyer.click("#tab-class")
    assert flyer.locator("#guests button").first.inner_text().endswith("take back")
    flyer.click("#let-none")
    until(guest, "document.querySelector('#panel-break').inert")


def test_nothing_is_cut_off_on_a_phone(pages):
    flyer, guest = pages
    flyer.set_viewport_size({"width": 390, "height": 844})
    flyer.click("#tab-class")
    for page, parts in (
        (flyer, "#tabs button:visible, #guests li > *"),
        (guest, "#you, #you input, #you button"),
    ):
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        for part in page.locator(parts).all():
            box = part.bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 390


def test_a_guest_who_loads_the_page_anew_is_still_who_it_was(pages):
    _, guest = pages
    guest.reload()
    until(guest, f"{THERE} && document.querySelector('#name').value === {NAME!r}")
    guest.evaluate("cockpit.traffic.frames = 0")
    until(guest, "cockpit.traffic.frames > 10")
    assert guest.locator("#banner").is_hidden()
