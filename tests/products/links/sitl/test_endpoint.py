"""The command over its sockets: what it prints, keeps and returns, for both protocols; who is let in, how it
ends."""

import json
import re
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager
from types import SimpleNamespace

import pandas as pd
import pytest
from pymavlink.dialects.v20 import common
from tools.autopilots import peers
from tools.autopilots.small import Small

import beaver_ftc as bf
from beaver_ftc.cli import address
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_links import commands
from beaver_ftc_links.sitl import Protocol
from beaver_ftc_links.sitl.serve import Options, serve

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
def served(protocol, **options):
    """`serve` in a thread: where it listens, what it says; after the block, what came of it."""
    said, came, there = [], [], threading.Event()

    def say(line):
        said.append(line)
        if "127.0.0.1:" in line and line.startswith(("ArduPilot", "PX4")):
            there.set()

    def run():
        came.append(serve(scenario(), Options(Protocol(protocol), port=0, **options), say))

    thread = threading.Thread(target=run)
    thread.start()
    assert there.wait(60)
    (line,) = (line for line in said if re.match("ArduPilot|PX4", line))
    at = SimpleNamespace(address=("127.0.0.1", int(line.rpartition(":")[2])), said=said)
    yield at
    thread.join(30)
    assert not thread.is_alive()
    at.flight = came[0]


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
    assert address("--mavlink", "10.0.0.1:14550") == ("10.0.0.1", 14550)
    for given in ("nowhere", ":1", "host:0", "host:x", "host:70000", "host:" + "1" * 5000):
        with pytest.raises(BadInput, match="is no address, allowed: HOST:PORT"):
            address("--mavlink", given)
    for name in ("hold", "ground"):
        with pytest.raises(BadInput, match=f"--{name} nan: allowed: a finite number"):
            commands.command(commands.Options("fault-free", Protocol.px4, **{name: float("nan")}))
