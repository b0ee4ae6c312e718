"""The command over its sockets: what it prints, keeps and returns, for both protocols; who is let in, how it
ends."""

import contextlib
import json
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import pandas as pd
import pytest
from pymavlink.dialects.v20 import common
from tools.autopilots import peers
from tools.autopilots.small import Small
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results import verdict
from beaver_ftc.results.model import Metrics
from beaver_ftc_links.commands import address
from beaver_ftc_links.sitl import Protocol
from beaver_ftc_links.sitl import serve as serving
from beaver_ftc_links.sitl.serve import Endpoint, Options, Pace, serve
from beaver_ftc_links.sitl.telling import Text

CODE = "from beaver_ftc.cli.main import main; main()"
CASE = """
name: case
duration_s: 2.5
rate_hz: 100
faults: [{type: loss_of_effectiveness, actuator: elevator, magnitude: 0.4, at_s: 1}]
expect: {isolated_as: elevator, detected_within_s: 0.1, no_false_alarm: true}
"""


def scenario(**keys):
    return bf.load("fault-free").with_({"expect": {}, "duration_s": 1.0, **keys})


@contextmanager
def served(protocol, flown=None, **options):
    """`serve` in a thread: where it listens, what it says; after the block, what came of it."""
    said, came, there = [], [], threading.Event()

    def say(line):
        said.append(line)
        if "127.0.0.1:" in line and line.startswith(("ArduPilot", "PX4")):
            there.set()

    def run():
        came.append(serve(flown or scenario(), Options(Protocol(protocol), port=0, **options), say))

    thread = threading.Thread(target=run)
    thread.start()
    assert there.wait(60)
    (line,) = (line for line in said if re.match("ArduPilot|PX4", line))
    at = SimpleNamespace(address=("127.0.0.1", int(line.rpartition(":")[2])), said=said)
    yield at
    thread.join(30)
    assert not thread.is_alive()
    at.flight = came[0]


def test_a_flight_over_udp():
    with served("ardupilot") as at:
        autopilot = peers.Ardupilot(Small().outputs, 100)
        autopilot.fly(at.address, 500)
    link = at.flight.metrics["link"]
    assert (autopilot.count, link["frames"], link["repeated"]) == (99, 99, 0)
    assert at.flight.metrics["frames"] == 100
    assert at.flight.metrics["flight"]["law"] == "ArduPilot"
    assert 0 < link["latency_ms"]["median"] <= link["latency_ms"]["p99"] <= link["latency_ms"]["largest"]
    assert link["interval_ms"]["mean"] > 0


def test_a_flight_over_tcp_with_a_second_caller_and_a_ground_station():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(5)
        with served("px4", ground=ground.getsockname(), speed=0.0, rate_hz=100) as at:
            autopilot = peers.Px4(Small().outputs, silent=2)
            with socket.create_connection(at.address) as line, socket.create_connection(at.address) as other:
                while data := line.recv(65536):
                    if answer := autopilot.hear(data):
                        line.sendall(answer)
                assert other.recv(10) == b""
        heartbeat = common.MAVLink(None).parse_buffer(ground.recv(65536))[0]
    assert heartbeat.get_type() == "HEARTBEAT"
    metrics = at.flight.metrics
    assert metrics["frames"] == 100
    assert metrics["link"]["frames"] + 2 == len(autopilot.stamps) - 1
    assert metrics["link"]["strangers"] == 1
    assert at.said[-2:] == ["connected", "disconnected"]
    assert (autopilot.gps.fix_type, autopilot.gps.satellites_visible) == (3, 12)


def test_a_flight_goes_on_after_its_autopilot_is_started_again():
    jam = {"type": "stuck", "actuator": "elevator", "position_deg": 8, "at_s": 0.1}
    with served("px4", scenario(faults=[jam]), speed=0.0, rate_hz=100) as at:
        first = peers.Px4(Small().outputs, silent=0)
        first.fly(at.address, 60)
        peers.Px4(Small().outputs, silent=0).fly(at.address, 500)
    metrics = at.flight.metrics
    assert (metrics["frames"], metrics["link"]["resets"]) == (100, 1)
    alarms = [line for line in at.said if line.endswith("FDI: alarm on q") or line == "restarted"]
    assert alarms == [alarms[0], "restarted", alarms[0]]  # what is said of the first is forgotten
    assert [text["text"] for text in metrics["link"]["said"]].count("FDI: alarm on q") == 1


def test_the_ground_station_breaks_a_servo():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(5)
        small = Small()

        def pilot(told):
            if told.t_s == 0.2:
                _, sender = ground.recvfrom(65536)
                ground.sendto(peers.Px4(None).inject(102, 2, 4), sender)
            return small.outputs(told)

        with served("ardupilot", ground=ground.getsockname(), speed=20.0) as at:
            peers.Ardupilot(pilot, 100).fly(at.address, 500)
    (fault,) = at.flight.metrics["faults"]
    assert (fault["actuator"], fault["type"]) == ("rudder", "stuck")
    assert "rudder: stuck" in at.said


def started(folder, protocol, *more):
    """The command itself, and where it listens."""
    (folder / "case.yaml").write_text(CASE, encoding="utf-8")
    arguments = ["sitl", "case.yaml", "--as", protocol, "--port", "0", "--no-report", *more]
    command = [sys.executable, "-c", CODE, *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": folder}
    process = subprocess.Popen(command, **pipes)
    for line in process.stderr:
        if found := re.search(r"(?:UDP|TCP) 127.0.0.1:(\d+)", line):
            return process, ("127.0.0.1", int(found[1]))
    raise AssertionError(process.wait())


@pytest.mark.parametrize("protocol", ["ardupilot", "px4"])
def test_the_command_leaves_what_run_leaves(protocol, tmp_path):
    process, at = started(tmp_path, protocol, "--rate", "100", "--speed", "0", "--junit", "verdict.xml")
    autopilot = peers.Ardupilot(Small().outputs) if protocol == "ardupilot" else peers.Px4(Small().outputs)
    autopilot.fly(at, 1000)
    printed, complained = process.communicate(timeout=60)
    assert process.returncode == 0, complained
    folder = tmp_path / "runs" / "case"
    assert {path.name for path in folder.iterdir()} == {"scenario.yaml", "log.parquet", "metrics.json"}
    metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["passed"]
    assert metrics["isolation"]["fault"] == "elevator"
    assert [text["text"] for text in metrics["link"]["said"]] == [
        "FDI: alarm on q", "FDI: elevator, loss of effectiveness", "FDI: elevator, 40 % lost",
    ]  # fmt: skip
    assert len(pd.read_parquet(folder / "log.parquet")) == metrics["frames"] == 250
    assert "case: PASSED" in printed
    assert re.search(rf"link +{protocol}, 2\d\d frames at 100 Hz; latency", printed)
    assert 'failures="0"' in (tmp_path / "verdict.xml").read_text(encoding="utf-8")
    assert bf.open_run(folder).metrics == metrics


def test_an_expectation_that_fails_is_status_1_and_ctrl_c_ends_in_good_order(tmp_path):
    process, at = started(tmp_path, "ardupilot", "--format", "json")
    peers.Ardupilot(Small().outputs).fly(at, 50)
    process.send_signal(signal.SIGINT)
    printed, complained = process.communicate(timeout=60)
    document = json.loads(printed)
    assert process.returncode == 1, complained
    assert (document["passed"], document["frames"]) == (False, 51)
    assert (tmp_path / "runs" / "case" / "log.parquet").exists()


def test_addresses_that_cannot_be_had():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(
            BadInput, match=rf"--host, --port: 127.0.0.1:{port} cannot be had \(.*\), allowed: "
        ):
            serve(scenario(), Options(Protocol.ardupilot, port=port), print)
    assert address(None) is None
    assert address("10.0.0.1:14550") == ("10.0.0.1", 14550)
    for given in ("nowhere", ":1", "host:0", "host:x", "host:70000"):
        with pytest.raises(BadInput, match="is no address, allowed: HOST:PORT"):
            address(given)


def test_the_pace_holds_answers_back_and_lets_go_what_is_late(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    monkeypatch.setattr("time.sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    pace = Pace(2.0)
    for t_s in (0.0, 0.5, 1.0):
        pace.wait(t_s)
    assert now[0] == pytest.approx(100.5)
    now[0] = 110.0  # nobody asked for a while
    pace.wait(1.5)
    pace.wait(2.0)
    assert now[0] == pytest.approx(110.25)
    assert pace.late_s == pytest.approx(9.25)
    pace.wait(0.0)  # begun anew
    pace.wait(0.5)
    assert now[0] == pytest.approx(110.5)


def pair():
    return socket.socketpair()


def test_a_peer_that_never_reads_does_not_keep_the_flight_from_ending():
    """Its buffer is full: sending waits, until somebody ends the flight."""
    near, far = pair()
    endpoint = SimpleNamespace(ended=False)
    end = threading.Timer(0.3, lambda: setattr(endpoint, "ended", True))
    with near, far:
        end.start()
        began_s = time.monotonic()
        serving._send(near, bytes(50_000_000), endpoint)
        assert 0.2 < time.monotonic() - began_s < 2.0


def test_all_of_it_is_sent_to_a_peer_that_reads_slowly():
    near, far = pair()
    data = bytes(range(256)) * 8000
    with near, far:
        got = []
        reader = threading.Thread(target=lambda: got.extend(iter(lambda: far.recv(50_000), b"")))
        reader.start()
        serving._send(near, data, SimpleNamespace(ended=False))
        near.shutdown(socket.SHUT_WR)
        reader.join(10)
    assert b"".join(got) == data


def test_a_peer_that_goes_on_talking_is_hung_up_on():
    near, far = pair()
    talks = threading.Event()

    def talk():
        with contextlib.suppress(OSError):
            while not talks.is_set():
                far.send(b"more")
                time.sleep(0.01)

    talking = threading.Thread(target=talk)
    with near, far:
        talking.start()
        began_s = time.monotonic()
        serving._hang_up(near)
        took_s = time.monotonic() - began_s
        talks.set()
        talking.join()
    assert took_s < 1.5


def test_a_peer_that_still_talks_and_then_hangs_up_is_heard_to_its_end_and_no_longer():
    near, far = pair()

    def last_words():
        time.sleep(0.1)
        far.sendall(b"last")
        far.close()

    with near, far:
        far.sendall(b"first")
        talking = threading.Thread(target=last_words)
        began_s = time.monotonic()
        talking.start()
        serving._hang_up(near)
        took_s = time.monotonic() - began_s
        talking.join()
    assert 0.1 <= took_s < serving.HANG_UP_S


def test_a_slow_pace_ends_with_the_flight():
    pace = Pace(0.001)
    pace.wait(0.0)
    began_s = time.monotonic()
    pace.wait(1.0, lambda: time.monotonic() - began_s > 0.1)  # due in 1,000 s
    assert time.monotonic() - began_s < 1.5


@pytest.mark.parametrize("protocol", ["ardupilot", "px4"])
def test_an_interrupted_flight_is_not_passed(protocol):
    """Nothing is expected of it; whoever ends it has not seen the end."""
    said = []
    endpoint = serving.Endpoint(scenario(), Options(Protocol(protocol)), said.append)
    endpoint.vehicle.flight.step(frames=20)
    endpoint.vehicle.off_rate, endpoint.pace.late_s = 7, 0.0012346
    endpoint._teller.kept.append(Text(0.25, 4, "FDI: alarm on q"))
    endpoint.ended = True
    document = endpoint.result().metrics
    assert (document["passed"], document["interrupted_s"]) == (
        False,
        pytest.approx(endpoint.vehicle.flight.t_s),
    )
    assert verdict.title(Metrics.of(document)).endswith(
        f"INTERRUPTED at {document['interrupted_s']:.2f} s, not passed"
    )
    assert said == [f"interrupted at {endpoint.vehicle.flight.t_s:.2f} s of 1 s: not passed"]
    assert document["flight"]["law"] == {"ardupilot": "ArduPilot", "px4": "PX4"}[protocol]
    tracking = document["tracking"]
    assert (tracking["pre_fault_rms_deg_s"], tracking["post_fault_rms_deg_s"]) == (None, None)
    hz = 100 if protocol == "ardupilot" else 250
    none = {"median": 0.0, "p99": 0.0, "largest": 0.0}
    assert document["link"] == {
        "protocol": protocol, "packets_hz": hz, "frames_hz": hz, "frames": 0, "repeated": 0, "late": 0,
        "missed": 0, "resets": 0, "malformed": 0, "strangers": 0, "off_rate": 7, "silences": 0,
        "latency_ms": none, "interval_ms": {"mean": 0.0, "jitter_rms": 0.0, "largest": 0.0},
        "longest_silence_s": 0.0, "diagnosed_from_s": 0.0, "speed": 0.0 if protocol == "ardupilot" else 1.0,
        "late_ms": 1.235, "said": [{"t_s": 0.25, "severity": 4, "text": "FDI: alarm on q"}],
    }  # fmt: skip


def test_a_complaint_is_said_once_until_another_and_who_goes_ends_nothing(monkeypatch):
    script = [b"slow", b"slow", TimeoutError(), b"fine", ConnectionResetError(), b"gone", b"odd", b"slow"]
    complaints = {b"slow": "10 Hz", b"odd": "5 Hz"}
    said, sent, answered, silences = [], [], [], []

    class Protocol:
        complaint = ""

        def __init__(self, *_):
            pass

        def take(self, datagram, peer, now_s):
            self.complaint = complaints.get(datagram, "")
            return None if self.complaint else datagram

    class Listener:
        def settimeout(self, seconds):
            self.seconds = seconds

        def recvfrom(self, most):
            if isinstance(came := script.pop(0), Exception):
                raise came
            return came, "it"

        def sendto(self, answer, peer):
            if answer == b"gone":
                raise ConnectionRefusedError
            sent.append((answer, peer))

    class Endpoint:
        vehicle = link = None
        over = property(lambda self: not script)

        def listen(self):
            silences.append(len(script))

        def after(self, began_s):
            answered.append(len(script))

    monkeypatch.setattr(serving, "Ardupilot", Protocol)
    listener = Listener()
    serving._serve_datagrams(Endpoint(), listener, said.append)
    assert said == ["10 Hz", "5 Hz", "10 Hz"]
    assert (sent, answered, silences) == ([(b"fine", "it")], [4, 2], [5])
    assert listener.seconds == serving.WAIT_S


class Body:
    """A vehicle that flies nothing: how it was made, and how many outputs were asked of it."""

    def __init__(self, *made):
        self.made, self.checked = made, []
        self.outputs = SimpleNamespace(check=self.checked.append, channels="channels")
        self.flight = SimpleNamespace(frames=30, rate_hz=20.0)


@pytest.mark.parametrize(
    ("options", "made", "speed", "checked"),
    [
        ({"protocol": Protocol.ardupilot}, (True, None, 0.0, None), 0.0, []),
        ({"protocol": Protocol.px4}, (False, 250.0, 0.0, None), 1.0, [16]),
        (
            {"protocol": Protocol.px4, "rate_hz": 50.0, "speed": 0.0, "hold_s": 2.0, "ground_m": 300.0},
            (False, 50.0, 2.0, 300.0), 0.0, [16],
        ),
        ({"protocol": Protocol.ardupilot, "rate_hz": 80.0, "speed": 3.0}, (True, 80.0, 0.0, None), 3.0, []),
    ],
)  # fmt: skip
def test_each_autopilot_has_its_rate_and_its_pace_unless_they_are_given(
    monkeypatch, options, made, speed, checked
):
    """ArduPilot's pulses at the rate of its packets, as fast as it asks; PX4's shares at 250 Hz, by the
    clock."""
    monkeypatch.setattr(serving, "Vehicle", Body)
    endpoint = Endpoint("scenario", Options(**options), print)
    assert endpoint.vehicle.made == ("scenario", *made)
    assert (endpoint.pace.speed, endpoint.vehicle.checked) == (speed, checked)
    assert {Protocol.ardupilot: 9002, Protocol.px4: 4560} == serving.PORTS
    assert (endpoint._ground, endpoint._page, endpoint.ended) == (None, None, False)


def test_what_is_new_is_said_to_all_and_then_the_answer_waits_for_its_time(monkeypatch):
    """To people, and to the ground station before it is asked for commands; a restart is said once."""
    monkeypatch.setattr(serving, "Vehicle", Body)
    done = []
    endpoint = Endpoint("scenario", Options(Protocol.px4, speed=2.0), done.append)
    texts = [Text(1.5, 4, "FDI: alarm on q"), Text(1.5, 2, "FDI: flap")]
    endpoint._teller = SimpleNamespace(
        begin=lambda: done.append("begin"), news=lambda sim: texts if sim is endpoint.vehicle.flight else None
    )

    def serve_ground(now_s, inject):
        assert (now_s, inject) == (77.0, endpoint.inject)
        return ["rudder: stuck"]

    def wait(t_s, ended):
        done.append(("wait", t_s, ended()))
        endpoint.ended = True
        assert ended()
        endpoint.ended = False

    endpoint._ground = SimpleNamespace(say=lambda said: done.append(("ground", said)), serve=serve_ground)
    endpoint._page = SimpleNamespace(tick=lambda: done.append("page"))
    endpoint.pace = SimpleNamespace(wait=wait)
    monkeypatch.setattr(serving, "time", SimpleNamespace(monotonic=lambda: 77.0, perf_counter=lambda: 5.25))
    told = [
        "1.50 s: FDI: alarm on q", "1.50 s: FDI: flap", ("ground", texts), "page", "rudder: stuck",
        ("wait", 1.5, False),
    ]  # fmt: skip
    assert endpoint.after(5.0) == texts
    assert done == told
    done.clear()
    endpoint.link.counts["resets"] += 1
    for before in (["begin", "restarted"], []):
        endpoint.after(5.0)
        assert done == [*before, *told]
        done.clear()
    assert (endpoint.link.latency.count, endpoint.link.latency.largest) == (3, 0.25)
    asked = []
    monkeypatch.setattr(serving.failures, "inject", lambda *of: asked.append(of) or (0, "done"))
    assert endpoint.inject((102.0, 2.0, 3.0)) == (0, "done")
    assert asked == [(endpoint.vehicle.flight, "channels", (102.0, 2.0, 3.0))]


def test_every_option_of_the_command_is_the_endpoint_s(monkeypatch, capsys):
    """Each of another value, and those that it has by itself."""
    given = []

    def stop(scenario, options, say):
        given.append((scenario.name, options))
        say("a line")
        raise BadInput("that is all")

    monkeypatch.setattr(serving, "serve", stop)
    more = "--host 10.0.0.1 --port 7 --rate 80 --speed 3 --hold 2 --ground 300 --mavlink 10.0.0.2:9 --page 11"
    for arguments in ("--as ardupilot", f"--as px4 {more}"):
        done = CliRunner().invoke(app, ["sitl", "fault-free", *arguments.split()])
        assert str(done.exception) == "that is all"
    assert given == [
        ("fault-free", Options(Protocol.ardupilot, "127.0.0.1", None, None, None, 0.0, None, None, None)),
        ("fault-free", Options(
            protocol=Protocol.px4, host="10.0.0.1", port=7, rate_hz=80.0, speed=3.0, hold_s=2.0,
            ground_m=300.0, ground=("10.0.0.2", 9), page=11,
        )),
    ]  # fmt: skip
