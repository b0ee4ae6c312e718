"""What `sitl` promises, measured: lockstep, latency, memory, the published case, healthy hours.

    python benchmarks/sitl.py lockstep [--frames 100000]
    python benchmarks/sitl.py latency [--frames 20000]
    python benchmarks/sitl.py memory [--frames 1000000]
    python benchmarks/sitl.py published
    python benchmarks/sitl.py healthy [--hours 50] [--rate 100]

The autopilots are those of tools/autopilots: neither ArduPilot nor PX4 is needed. Exit status 1 where a bar is missed.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import beaver_ftc as bf
from beaver_ftc.integrations.sitl.ardupilot import Ardupilot
from beaver_ftc.integrations.sitl.link import Link
from beaver_ftc.integrations.sitl.vehicle import Vehicle
from tools.autopilots import peers
from tools.autopilots.small import Small

HEALTHY = "elevator-loss-in-turbulence"  # its air, sensors, servos, tolerances and what is declared of them


def healthy(hours: float, rate_hz: int) -> Iterator[str]:
    """Flights of an hour under the small autopilot in light turbulence, nothing broken: alarms, and how near."""
    base = bf.load(HEALTHY).with_({"faults": [], "expect": {}, "duration_s": 3600})
    alarms, flown_s, lost, nearest, outside_s = 0, 0.0, 0, 0.0, 0.0
    for seed in range(round(hours)):
        vehicle = Vehicle(base.with_({"seed": seed}), pulses=True, log=False)
        end, autopilot = Ardupilot(vehicle, Link()), peers.Ardupilot(Small().outputs, rate_hz)
        while not vehicle.over:
            autopilot.hear(end.take(autopilot.next(), "it", 0.0) or b"")
        document = vehicle.flight.land().metrics
        alarms += document["false_alarm"]
        lost += document["departure"] is not None
        flown_s += document["flight"]["flown_s"]
        outside_s += document["envelope"]["outside_s"]
        nearest = max(nearest, (document["detection"]["statistical"] or {}).get("closest_approach") or 0.0)
        vehicle.flight.release()
        yield f"seed {seed}: {document['flight']['flown_s']:.0f} s, alarm {document['detection']['time_s']}"
    said = f"{flown_s / 3600:.2f} h at {rate_hz} Hz: {alarms} false alarms, {lost} lost"
    yield f"{said}, {outside_s:.0f} s outside the envelope, statistical test at most {nearest:.2f} of its level"
    if alarms or lost:
        raise SystemExit(1)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("lockstep", "latency", "memory", "published", "healthy"))
    parser.add_argument("--frames", type=int, default=None)
    parser.add_argument("--hours", type=float, default=50.0)
    parser.add_argument("--rate", type=int, default=100)
    given = parser.parse_args()
    lines = {
        "healthy": lambda: healthy(given.hours, given.rate),
    }
    for line in lines[given.what]():
        print(line, flush=True)


if __name__ == "__main__":
    main()
