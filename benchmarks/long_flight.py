"""A flight of ten hours, log file and all, in bounded memory.

    python benchmarks/long_flight.py [--hours H]

Attitude is open loop, and to hold the horizon an aircraft must pitch down as the Earth curves away: hence the
reference. It climbs as it goes, out of the validated envelope after some hours, and does not depart.
"""

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.scenario.schema import Scenario

RATE_HZ = 100


def long_scenario(hours: float) -> Scenario:
    """Near-level flight for so long."""
    horizon = [{"step": {"amplitude_deg_s": -4e-4, "start_s": 0}}]
    initial = {"airspeed_mps": 45, "altitude_m": 1800, "manifold_pressure_inhg": 21.2}
    return Scenario.model_validate(
        {
            "name": "ten-hours",
            "duration_s": 3600 * hours,
            "rate_hz": RATE_HZ,
            "initial": initial,
            "reference": {"q": horizon},
        }
    )


def main() -> int:
    """Fly, and print what it took."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hours", type=float, default=10.0)
    hours = parser.parse_args().hours
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.parquet"
        start, start_processor = time.perf_counter(), time.process_time()
        with ParquetLog(path) as log:
            flight = fly(long_scenario(hours), log)
        wall_s, processor_s = time.perf_counter() - start, time.process_time() - start_processor
        size_mb = path.stat().st_size / 2**20
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (
        2**20 if sys.platform == "darwin" else 2**10
    )
    print(f"{flight.frames} frames, {hours:g} h of flight, departure: {flight.departure}")
    print(f"{wall_s:.1f} s, {3600 * hours / wall_s:.0f} times as fast as life; processor {processor_s:.1f} s")
    print(f"{1e6 * processor_s / flight.frames:.2f} us a frame with the log file, {size_mb:.0f} MB of it")
    print(f"peak memory {peak_mb:.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
