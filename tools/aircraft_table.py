"""What `beaver-ftc derive` makes of every aircraft of the jsbsim package, as docs/aircraft.md.

    python -m tools.aircraft_table [--only NAME ...]

Each is derived by the command itself, in a process of its own: a model that brings JSBSim down, or never
ends, costs one line of the table.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from beaver_ftc.plant.instrumented import names

PAGE = Path(__file__).parents[1] / "docs" / "aircraft.md"
LONGEST_S = 600
PROGRAM = """import atexit, os, sys
atexit.register(lambda: sys.stderr.write(f"cpu {sum(os.times()[:4]):.1f}"))
from beaver_ftc.cli.main import main
main()"""
HEAD = """# Aircraft

Three ways to name what flies: `aircraft: beaver` (built in), `aircraft: jsbsim:c172p` (of the installed
jsbsim package; its design model is derived at first use, in some seconds, and kept), and
`aircraft: ./my-uav` (a folder beside the scenario with a JSBSim model and an `aircraft.yaml`).
`beaver-ftc list aircraft` says what there is.

## What `derive` does

`beaver-ftc derive AIRCRAFT [--envelope FILE] [--out DIR]` takes `jsbsim:NAME`, any JSBSim model (`FILE.xml`;
with `--out`), or an aircraft that has a file already (a built-in name, a folder; with `--out`). An envelope
file has the keys `airspeed_mps`, `alpha_deg`, `altitude_m` and `sideslip_deg`.

1. The aircraft is copied, and the failures of the built-in one are put in between its actuators and its
   aerodynamics. The file on disk stays as it is. Its own flight control no longer moves the surfaces of the
   copy: what it did beside the command (dampers, other surfaces moved along) is found and said in a line.
   An aircraft of which something moves by itself is refused.
2. It is trimmed in level flight at a lift coefficient of 0.45, or another where that does not trim. Engines
   are started as their kind wants it; where JSBSim gives no steady thrust the aircraft is flown gliding.
   What a model reads and only FlightGear would give it is 0 in the copy, and named.
3. It is put into 6000 random states about trim: airspeed, angles, rates, bank, climb, altitude, power and
   surfaces. Sparse terms are fitted to its accelerations by orthogonal matching pursuit. They may multiply
   the thrust coefficient, Mach number, the rate of the angle of attack and of sideslip, and the moments of
   the engines, reckoned from their instruments: of these, the six that are missed most become signals.
4. The error that is left is measured on these and 16000 further states, and in flight: in four boxes about
   trim, one inside the other, for four shares of the surfaces' travel, and for flights of up to 2 minutes, a
   quarter of an hour and 2 hours (fuel burns, and inertia with it). The largest error, with three tenths
   more, is the declared bound there. Outside of the boxes nothing is known, and nothing is concluded.
5. The folder gets a page, `derived.md`: terms, the error over the envelope, what can be diagnosed and how
   small, and what is to be known of the aircraft.

`beaver-ftc derive beaver --out DIR` prints the coefficients found beside those of the aircraft's own file;
`python benchmarks/derived_again.py` flies every built-in scenario with both, and says where they are judged
differently. `python benchmarks/any_aircraft.py` flies healthy and faulty flights of twelve aircraft and
counts false alarms, faults named wrongly, true faults left out, and faults certain to be detected in 0.5 s
that were not.

`run`, `sweep`, `matrix --aircraft`, `compare`, `live` and `detectability` fly any of them. `mismatch` splits
what is left by the terms of the built-in aircraft, and refuses others.

The surfaces are aileron, elevator and rudder. Flaps, slats, speed brakes and spoilers stay as the aircraft's
own flight control moves them: most go in detents at a pace of their own, and no law can control with them.
`derive` says in its page which of them an aircraft has, and where they stand in level flight.
So no surface stands in for the elevator, and where trim needs much of its travel a large loss cannot be
balanced: the P-51 in level flight holds its elevator at half its travel, and with less than half of its
effectiveness left nothing holds the nose up.

An aircraft folder of your own is compared with its JSBSim model when a scenario first names it: 800 states
over its envelope, and a line for each axis on which the difference exceeds what the file declares beside the
published bound. What was found is kept until a file in the folder changes.

## The aircraft of the jsbsim package

Written by `python -m tools.aircraft_table`; do not edit. Error: of the angular acceleration near trim (second
box, within 0.35 of the travel), rad/s2. Loss: the smallest loss of effectiveness of aileron, elevator and
rudder that is certain to be detected 3 deg from neutral; `-` where a total one is not. Time: of one core, for
the whole command. A line without numbers says why there is no design model.

| aircraft | level flight, m/s | terms of Cl, Cm, Cn | error p | error q | error r | loss | time, s | notes |
|---|---|---|---|---|---|---|---|---|
"""


def row_of(name: str) -> str:
    """A line of the table."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", PROGRAM, "derive", f"jsbsim:{name}"]
        try:
            run = subprocess.run(
                [*command, "--out", folder, "--format", "json"],
                capture_output=True, text=True, timeout=LONGEST_S, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"| {name} | not within {LONGEST_S} s | | | | | | | |"
    said, _, cpu_s = run.stderr.rpartition("cpu ")
    if run.returncode != 0:
        lines = [line for line in said.splitlines() if line.strip() and not line.startswith("deriving")]
        why = lines[-1] if lines else f"ended by signal {-run.returncode}"
        return f"| {name} | {why.removeprefix(f'jsbsim:{name}: ').replace('|', '/')} | | | | | | | |"
    document = json.loads(run.stdout)
    terms = ", ".join(str(document["terms"][c]) for c in ("Cl", "Cm", "Cn"))
    errors = " | ".join(f"{document['near_trim_rad_s2'][axis]:.2g}" for axis in "pqr")
    losses = document["smallest_certain_loss"].values()
    loss = ", ".join(f"{share:.0%}" if share <= 1.0 else "-" for share in losses)
    notes = "; ".join(document["notes"]).replace("|", "/")
    speed_mps = document["trim"]["airspeed_mps"]
    return f"| {name} | {speed_mps:.1f} | {terms} | {errors} | {loss} | {cpu_s} | {notes} |"


def main() -> None:
    """Derive them all and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="*", help="Print the lines of these, and write nothing.")
    only = parser.parse_args().only
    rows = []
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as at_once:
        for row in at_once.map(row_of, only or names()):
            rows.append(row)
            print(row, flush=True)
    if not only:
        PAGE.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
