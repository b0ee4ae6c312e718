"""The bookkeeping of a sweep of a million flights: rows land, the process is killed, resumed, reported.

    python benchmarks/sweep_bookkeeping.py 1000000

Nothing is flown: each row is made up from the one of a real flight, so that what is timed is all that a sweep
does beside flying. Half the rows land in a process that is then killed; another one goes on, joins the parts
and draws the report. Prints seconds and the most memory each process took.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from functools import partial
from pathlib import Path

from beaver_ftc.scenario.sweeps import Sweep, load_sweep_text
from beaver_ftc.studies.engine.workers import ThisProcess, Work
from beaver_ftc.studies.sweep import campaign
from beaver_ftc.studies.sweep.one_flight import fly_one
from beaver_ftc.studies.sweep.sampling import Assignment, Plan

SWEEP = """\
name: bookkeeping
base: elevator-partial-loss
set: {{duration_s: 15}}
runs: {runs}
seed: 1
vary:
  faults[0].magnitude: {{uniform: [0.05, 1.0]}}
  faults[0].actuator: {{choice: [aileron, elevator, rudder]}}
  initial.airspeed_mps: {{uniform: [40, 50]}}
"""


def made_up(template: dict, case: Assignment) -> dict:
    """A row like the template's, with this case's values and a delay that follows from them."""
    values = case.values
    delay_s = 0.02 / values["faults[0].magnitude"]
    found = {"detection.delay_s": delay_s, "fault.actuator": values["faults[0].actuator"]}
    return template | {"run": case.run, **values, "seed": case.run, **found}


def sweep_of(runs: int) -> Sweep:
    return load_sweep_text(SWEEP.format(runs=runs))


def go_on(sweep: Sweep, out: Path, until: float) -> None:
    """Land rows until a share of them is there, then end this process as a kill would; or conclude."""
    template = fly_one(sweep, Plan(sweep).assignments([0])[0])
    campaign._workers = lambda *_: ThisProcess(Work(partial(made_up, template)))
    began = time.perf_counter()

    def progress(counts: Counter[str]) -> None:
        if counts["done"] >= until * sweep.flights:
            say(began)
            sys.stdout.flush()
            os._exit(9)

    campaign.run_sweep(
        sweep, campaign.Options(out=out, resume=True), progress if until < 1 else lambda counts: None
    )
    say(began)


def say(began: float) -> None:
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    wall_s, cpu_s = time.perf_counter() - began, time.process_time()
    print(json.dumps({"s": round(wall_s, 1), "cpu_s": round(cpu_s, 1), "peak_mb": round(peak_mb)}))


def main() -> None:
    if len(sys.argv) > 2:
        runs, out, until = int(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])
        go_on(sweep_of(runs), out, until)
        return
    with tempfile.TemporaryDirectory() as folder:
        for what, until in (("half, then killed", 0.5), ("to the last row, then killed", 1 - 1e-9),
                            ("resumed and reported", 1.0)):  # fmt: skip
            command = [sys.executable, __file__, sys.argv[1], folder, str(until)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            print(f"{what:32}", done.stdout.strip() or done.stderr)


if __name__ == "__main__":
    main()
