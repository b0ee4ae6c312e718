"""The web side without a network: requests and websockets handed to the application as a server does."""

import asyncio
import contextlib
import json
import signal
import socket
from types import SimpleNamespace

import pytest
from live_site import HOST, PORT, Site, says

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc_live.page import EVERYONE, MAX_BYTES, serve, server
from beaver_ftc_live.page.gate import Seat
from beaver_ftc_live.page.serve import Place
from beaver_ftc_live.page.server import STATIC, Page, Pages


@pytest.fixture
def site():
    return Site()


def test_the_token_of_an_address_becomes_a_cookie_once(site):
    room, token = site.gate.flyer.room, site.token()
    status, headers, _ = site.get(f"{room}/", f"token={token}")
    assert (status, headers["location"]) == (303, f"{room}/")
    assert headers["set-cookie"] == f"{site.key}; HttpOnly; Path={room}; SameSite=lax"
    status, headers, body = site.get(f"{room}/", f"token={token}")
    assert (status, "set-cookie" in headers, b"has been used" in body) == (403, False, True)
    (again,) = site.said  # in the terminal, for whoever closed the browser
    assert site.get(f"{room}/", again.partition("?")[2])[0] == 303
    status, headers, _ = site.get(f"{room}/", f"token={token}", cookie=site.key)
    assert (status, "set-cookie" in headers) == (303, False)  # who is in already is only led to the page
    assert site.get(f"{room}/static/js/main.js", f"token={site.token()}")[0] == 403


def test_the_page_and_its_files_with_what_it_may_do(site, changed):
    room = site.gate.flyer.room
    status, headers, body = site.get(f"{room}/", cookie=site.key)
    assert (status, body) == (200, (STATIC / "index.html").read_bytes())
    assert not changed({name: headers[name] for name in server.HEADERS})
    assert site.get(f"{room}/static/js/main.js", cookie=site.key)[0] == 200


@pytest.mark.parametrize(
    ("path", "cookie", "host", "status"),
    [
        ("/", True, f"localhost:{PORT}", 200), ("/", True, f"localhost:{PORT + 1}", 421),
        ("/", True, "evil.example", 421), ("/", False, HOST, 403), ("/static/js", True, HOST, 404),
        ("", True, HOST, 404), ("/nothing", True, HOST, 404),
    ],
)  # fmt: skip
def test_who_is_let_in(site, path, cookie, host, status):
    assert site.get(site.gate.flyer.room + path, cookie=site.key if cookie else None, host=host)[0] == status


def test_secrets_are_of_12_24_and_32_bytes_in_base64(site):
    assert len(site.gate.flyer.room) == 1 + 12 * 4 // 3
    assert len(site.token()) == 24 * 4 // 3
    assert len(site.key.partition("=")[2]) == -(-32 * 4 // 3)


def test_as_many_addresses_as_are_kept_open(site):
    tokens = [site.token() for _ in range(17)]
    assert site.gate.flyer.redeem(tokens[0]) is None
    assert all(site.gate.flyer.redeem(token) for token in tokens[1:])


@pytest.mark.parametrize(
    ("key", "origin", "others"),
    [(False, f"http://{HOST}", 0), (True, "http://127.0.0.1:1", 0), (True, f"http://{HOST}", 20)],
)
def test_a_socket_is_refused(site, key, origin, others):
    for _ in range(others):
        site.pages.add(None, site.gate.flyer)
    told = site.talk(cookie=site.key if key else None, origin=origin)
    assert [(message["type"], message["code"]) for message in told] == [("websocket.close", 4403)]
    assert (site.asked, len(site.pages)) == ([], others)


def test_what_a_page_says_goes_to_the_flight_or_is_answered(site):
    for _ in range(19):
        site.pages.add(None, site.gate.flyer)
    told = site.talk(says(do="save", n=3), says(do="dance"), says(do="invite", n=4), cookie=site.key,
                     then=lambda site: site.pages.tell(20, b'{"k":"f"}'))  # fmt: skip
    assert site.asked == [(0, "joined 20"), (20, says(do="save", n=3)["text"]), (0, "left 20")]
    assert len(site.pages) == 19
    opened, _, wrong, address, frame = told
    assert opened["type"] == "websocket.accept"
    wrong, address = json.loads(wrong["text"]), json.loads(address["text"])
    assert (wrong["k"], wrong["n"], wrong["ok"]) == ("ack", 0, False)
    assert (address["n"], address["ok"]) == (4, True)
    assert site.gate.flyer.redeem(address["says"].rpartition("=")[2])
    assert frame["text"] == '{"k":"f"}'


def test_a_binary_message_ends_it(site):
    told = site.talk({"type": "websocket.receive", "bytes": b"\0"}, says(do="save"), cookie=site.key)
    assert told[-1] == {
        "type": "websocket.close", "code": 1003, "reason": "a binary message, allowed: JSON as text",
    }  # fmt: skip
    assert site.asked == [(0, "joined 1"), (0, "left 1")]


class Socket:
    """Takes what it is sent; slow: only when it is let."""

    def __init__(self):
        self.sent = []

    async def send_text(self, text):
        self.sent.append(text)


def _sent(*told):
    async def sending():
        socket = Socket()
        page = Page(1, socket, Seat())
        for each in told:
            page.tell(each)
        task = asyncio.create_task(page.send())
        for _ in range(5):
            await asyncio.sleep(0)
        done = task.done()
        task.cancel()
        return socket.sent, done

    return asyncio.run(sending())


FRAMES = [b'{"k":"f","v":1}', b'{"k":"f","v":2}']
EVENT, HELLO = b'{"k":"e"}', b'{"k":"hello"}'


@pytest.mark.parametrize(
    ("told", "sent"),
    [
        (FRAMES, FRAMES[1:]),  # the newest alone
        ([FRAMES[0], EVENT, FRAMES[1]], [FRAMES[0], EVENT, FRAMES[1]]),
        ([EVENT, FRAMES[0], HELLO], [EVENT, HELLO, FRAMES[0]]),  # a frame waits behind what waits already
        ([EVENT, HELLO], [EVENT, HELLO]),
    ],
)
def test_frames_are_missed_and_events_are_not(told, sent):
    assert _sent(*told) == ([each.decode() for each in sent], False)


def test_a_page_that_takes_nothing_is_let_go():
    assert _sent(*[EVENT] * 999)[1] is False
    assert _sent(*[EVENT] * 1000) == ([], True)


def test_one_page_or_all_are_told():
    pages, told = Pages(), []
    added = [pages.add(None, Seat()) for _ in range(3)]
    for page in added:
        page.tell = lambda text, page=page: told.append((page.number, text))
    pages.remove(added[1])
    pages.remove(added[1])
    pages.tell(EVERYONE, b"all")
    pages.tell(3, b"one")
    pages.tell(2, b"gone")
    assert (len(pages), told) == (2, [(1, b"all"), (3, b"all"), (3, b"one")])


def test_a_port_is_had_on_the_loopback_alone():
    with serve._listening(Place()) as listener:
        host, port = listener.getsockname()
        assert (host, port > 0) == ("127.0.0.1", True)
        assert listener.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)
    assert listener.fileno() == -1


class Pipe:
    """Says these words, then ends."""

    def __init__(self, *words, end=EOFError):
        self.words, self.end = list(words), end

    def recv(self):
        if not self.words:
            raise self.end
        return self.words.pop(0)


@pytest.mark.parametrize("end", [EOFError, OSError])
def test_what_the_flight_says_is_handed_on_until_it_dies(end):
    heard = []
    loop = SimpleNamespace(call_soon_threadsafe=lambda call, *given: call(*given))
    serve._listen(Pipe((1, b"a"), (0, b"b"), end=end), loop, lambda *words: heard.append(words))
    assert heard == [(1, b"a"), (0, b"b"), ("died", "the flight process has ended unexpectedly")]

    def closed(*_):
        raise RuntimeError

    assert serve._listen(Pipe((1, b"a")), SimpleNamespace(call_soon_threadsafe=closed), None) is None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_server(number):
    server = SimpleNamespace(should_exit=False)

    async def signalled():
        serve._on_signals(server)
        signal.raise_signal(number)
        for _ in range(100):
            await asyncio.sleep(0.001)
            if server.should_exit:
                return

    asyncio.run(signalled())
    assert server.should_exit is True


class Stopped:
    """A web server that is up at once and ends when it is told, or with the signal of a test."""

    def __init__(self, config):
        self.config, self.started, self.should_exit = config, False, False
        Stopped.last = self

    async def serve(self, sockets):
        self.sockets, self.started = sockets, True
        for _ in range(500):
            await asyncio.sleep(0.001)
            if self.should_exit:
                return


@pytest.mark.parametrize(
    ("words", "ended", "host"),
    [
        (
            ((1, b"frame"), ("bad input", "cannot be trimmed")),
            ("bad input", "cannot be trimmed"),
            "127.0.0.1",
        ),
        (((1, b"frame"),), ("died", "the flight process has ended unexpectedly"), "0.0.0.0"),
    ],
)
def test_the_server_ends_with_the_flight_and_says_why(monkeypatch, words, ended, host):
    """To the pilot an address, and one to each guest; only where it listens everywhere it is called by any
    address that it has."""
    import uvicorn

    said, told, made, sent = [], [], [], []
    monkeypatch.setattr(uvicorn, "Server", Stopped)
    monkeypatch.setattr(Pages, "tell", lambda self, number, text: told.append((number, text)))
    monkeypatch.setattr(server, "application", lambda *of: made.extend(of))
    monkeypatch.setattr(serve, "_outward", lambda: "198.51.100.9")
    place, pipe = Place(host=host, guests=2), Pipe(*words)
    pipe.send = sent.append
    with serve._listening(place) as listener:
        port = listener.getsockname()[1]
        asked = serve._serve(listener, pipe, lambda *said_: said.append(said_), place)
        assert asyncio.run(asked) == ended
    ((address, links),) = said
    gate, pages, ask, say = made
    own = "127.0.0.1" if host == "127.0.0.1" else "198.51.100.9"
    assert [link.split("/?token=")[0] for link in (address, *links)] == [
        f"http://{own}:{port}{seat.room}" for seat in (gate.flyer, *gate.guests)
    ]
    assert (len(gate.guests), gate._any_own) == (2, host == "0.0.0.0")
    assert gate.flyer.redeem(address.rpartition("=")[2])
    assert isinstance(pages, Pages)
    assert told == [(1, b"frame")]
    config = Stopped.last.config
    names = "access_log", "log_level", "lifespan", "server_header", "ws_max_size", "ws_ping_interval"
    assert [getattr(config, name) for name in names] == [False, "error", "off", False, MAX_BYTES, 20.0]
    assert config.timeout_graceful_shutdown == 2
    assert (config.proxy_headers, config.ws_per_message_deflate) == (False, False)
    ask(7, "text")
    say("http://again")
    assert (sent, said[1:]) == ([(7, "text")], [("http://again", [])])

    def gone(_):
        raise BrokenPipeError

    pipe.send = gone
    ask(7, "text")  # the flight has died: somebody else says so


@pytest.mark.parametrize(
    ("ended", "raised"),
    [
        (None, None), (("bad input", "no trim"), BadInput), (("failed", "not finite"), SimulationFailed),
        (("died", "it has ended"), SimulationFailed),
    ],
)  # fmt: skip
def test_why_a_flight_has_ended_is_raised_as_what_it_is(monkeypatch, tmp_path, ended, raised):
    begun, sent, done = [], [], []
    place = Place(8001, guests=3)
    process = SimpleNamespace(terminate=lambda: done.append("terminated"))
    pipe = SimpleNamespace(send=sent.append)

    async def serving(*of):
        begun.append(of)
        return ended

    monkeypatch.setattr(serve, "_listening", lambda at: contextlib.nullcontext(("listener", at)))
    monkeypatch.setattr(serve, "_flight", lambda out: contextlib.nullcontext((process, pipe)))
    monkeypatch.setattr(serve, "_serve", serving)
    with pytest.raises(raised, match=ended[1]) if raised else contextlib.nullcontext():
        serve.serve(lambda: "scenario", tmp_path, place, print)
    assert begun == [(("listener", place), pipe, print, place)]
    assert (sent, done) == (["scenario"], [])

    def wrong():
        raise BadInput("no such scenario")

    with pytest.raises(BadInput, match="no such scenario"):
        serve.serve(wrong, tmp_path, place, print)
    assert (len(begun), len(sent), done) == (1, 1, ["terminated"])


@pytest.mark.parametrize("alive", [False, True])
def test_the_flight_s_process_is_told_to_end_and_made_to(monkeypatch, tmp_path, alive):
    made, done = [], []

    def process(**how):
        made.append(how)
        return SimpleNamespace(
            start=lambda: done.append("start"), join=lambda *wait_s: done.append(("join", *wait_s)),
            is_alive=lambda: alive, terminate=lambda: done.append("terminate"),
        )  # fmt: skip

    ours = SimpleNamespace(send=done.append)
    theirs = SimpleNamespace(close=lambda: done.append("closed"))
    context = SimpleNamespace(Pipe=lambda: (ours, theirs), Process=process)
    monkeypatch.setattr(serve.multiprocessing, "get_context", lambda how: context if how == "spawn" else None)
    with serve._flight(tmp_path) as (_, pipe):
        assert pipe is ours
        assert done == ["start", "closed"]
    assert done[2:] == [(EVERYONE, "end"), ("join", 3.0), *(["terminate", ("join",)] if alive else [])]
    (how,) = made
    assert (how["target"], how["args"], how["daemon"]) == (serve._fly, (theirs, str(tmp_path)), True)


def test_a_token_that_opens_nothing_and_a_page_that_leaves_are_shown_to_the_pilot(monkeypatch):
    monkeypatch.setattr(server, "SLOW_S", 0.0)
    site, told = Site(), []
    monkeypatch.setattr(site.pages, "tell_class", lambda gate: told.append((gate.wrong, len(site.pages))))
    site.get(f"{site.gate.flyer.room}/", "token=wrong")
    assert told == [(1, 0)]
    site.talk(says(do="name", name="Ada"), cookie=site.keys[0], seat=site.gate.guests[0])
    assert told == [(1, 0), (1, 1), (1, 1), (1, 0)]  # it joins, has a name, and is gone
