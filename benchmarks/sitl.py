"""What `sitl` promises of many frames, measured: latency, memory, false alarms in healthy hours.

    python benchmarks/sitl.py latency
    python benchmarks/sitl.py memory
    python benchmarks/sitl.py healthy

The autopilots are those of tools/autopilots: neither ArduPilot nor PX4 is needed. Exit status 1 where a bar
is missed.
"""

import argparse
import json
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tools.autopilots import peers
from tools.autopilots.small import Small

import beaver_ftc as bf
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.vehicle import Vehicle

MOST_LATENCY_MS, MOST_GROWTH_MB = 0.5, 2.0
RATE_HZ = 100
ANSWERED, FLOWN, HEALTHY_H = 20_000, 1_000_000, 50.0  # frames answered, frames of one flight, hours
HEALTHY = "elevator-loss-in-turbulence"  # its air, sensors, servos, tolerances and what is declared of them


def healthy() -> Iterator[str]:
    """Flights of an hour under the small autopilot in light turbulence, nothing broken: alarms, and how
    near."""
    base = bf.load(HEALTHY).with_({"faults": [], "expect": {}, "duration_s": 3600})
    seed, alarms, flown_s, lost, nearest, outside_s = 0, 0, 0.0, 0, 0.0, 0.0
    while flown_s < 3600 * HEALTHY_H:
        vehicle = Vehicle(base.with_({"seed": seed}), pulses=True, log=False)
        next_frame = connected(vehicle)
        while not vehicle.over:
            next_frame(0.0)
        document = vehicle.flight.land().metrics
        alarms += document["false_alarm"]
        lost += document["departure"] is not None
        flown_s += document["flight"]["flown_s"]
        outside_s += document["envelope"]["outside_s"]
        nearest = max(nearest, (document["detection"]["statistical"] or {}).get("closest_approach") or 0.0)
        vehicle.flight.release()
        seed += 1
        yield f"seed {seed - 1}: {document['frames']} frames, alarm {document['detection']['time_s']}"
    said = f"{flown_s / 3600:.2f} h at {RATE_HZ} Hz: {alarms} false alarms, {lost} lost"
    yield f"{said}, {outside_s:.0f} s outside the envelope, statistical test at most {nearest:.2f} of its bar"
    if alarms:
        raise SystemExit(1)


def connected(vehicle: Vehicle) -> Callable[[float], object]:
    """What flies the next frame of a vehicle at a time by the clock, s, under the small autopilot."""
    end, autopilot = Ardupilot(vehicle, Link()), peers.Ardupilot(Small().outputs, RATE_HZ)
    return lambda now_s: autopilot.hear(end.take(autopilot.next(), "it", now_s) or b"")


def started(*arguments: str) -> tuple[subprocess.Popen, tuple[str, int]]:
    """The command as a user starts it, and where it listens."""
    code = "from beaver_ftc.cli.main import main; main()"
    options = ("--port", "0", "--no-report", "--format", "json")
    command = [sys.executable, "-c", code, "sitl", *arguments, *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(r"(?:UDP|TCP) ([\d.]+):(\d+)", line):
            return process, (found[1], int(found[2]))
    raise SystemExit(f"sitl has ended: {process.wait()}")


def latency() -> Iterator[str]:
    """From a packet to its answer, in another process, at 400 Hz and as fast as it goes."""
    late = False
    with tempfile.TemporaryDirectory() as out:
        file = Path(out) / "long.yaml"
        file.write_text("name: long\nduration_s: 36000\n", encoding="utf-8")
        ends = {"ardupilot": peers.Ardupilot(Small().outputs, 400), "px4": peers.Px4(Small().outputs)}
        for protocol, end in ends.items():
            process, address = started(
                str(file), "--as", protocol, "--rate", "400", "--speed", "0", "--out", out
            )
            end.fly(address, ANSWERED)
            process.send_signal(signal.SIGINT)
            link = json.loads(process.communicate()[0])["link"]
            yield f"{protocol}: {link['frames']} frames, answered within {link['latency_ms']} ms"
            late |= link["latency_ms"]["p99"] > MOST_LATENCY_MS
    if late:
        raise SystemExit(1)


def memory() -> Iterator[str]:
    """Resident memory while a flight goes on and on, log and all."""
    base = bf.load("fault-free").with_({"expect": {}, "duration_s": 36_000})
    next_frame, seen = connected(Vehicle(base, pulses=True)), []
    for k in range(1, FLOWN + 1):
        next_frame(0.001 * k)
        if k % (FLOWN // 10) == 0:
            seen.append(resident_mb())
            yield f"{k} frames: {seen[-1]:.1f} MB"
    if seen[-1] - seen[0] > MOST_GROWTH_MB:
        raise SystemExit(1)


def resident_mb() -> float:
    """Of this process, files it has mapped left out."""
    text = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(re.search(r"RssAnon:\s+(\d+)", text)[1]) / 1024


MEASURED = {"latency": latency, "memory": memory, "healthy": healthy}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=MEASURED)
    for line in MEASURED[parser.parse_args().what]():
        print(line, flush=True)


if __name__ == "__main__":
    main()
