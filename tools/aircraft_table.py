"""What `beaver-ftc derive` makes of every aircraft of the jsbsim package, as docs/aircraft.md.

    python -m tools.aircraft_table [--only NAME ...]

Each is derived by the command itself, in a process of its own: a model that brings JSBSim down, or never
ends, costs one line of the table.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from beaver_ftc.plant.instrumented import names

PAGE = Path(__file__).parents[1] / "docs" / "aircraft.md"
LONGEST_S = 60
HEAD = """# Aircraft

Three ways to name what flies: `aircraft: beaver` (built in), `aircraft: jsbsim:c172p` (of the installed
jsbsim package, after `beaver-ftc derive jsbsim:c172p`), and `aircraft: ./my-uav` (a folder beside the
scenario with a JSBSim model and an `aircraft.yaml`). `beaver-ftc list aircraft` says what there is.

`beaver-ftc derive jsbsim:NAME [--envelope FILE] [--out DIR]` copies the aircraft, puts the failures of
the built-in one between actuators and aerodynamics, trims it in level flight, samples it over an
envelope about that, and fits sparse terms. The largest error over the samples and over twice as many
that the fit did not see, with a tenth more, is added to the declared bound of the uncertainty. The
aircraft's own flight control no longer moves the surfaces of the copy: stability augmentation and trim
are not in it. An envelope file has the keys `airspeed_mps`, `alpha_deg` and `altitude_m`.

Written by `python -m tools.aircraft_table`; do not edit. Bound: of the angular acceleration, rad/s2.

| aircraft | level flight, m/s | terms of Cl, Cm, Cn | bound p | bound q | bound r |
|---|---|---|---|---|---|
"""


def row_of(name: str) -> str:
    """A line of the table."""
    with tempfile.TemporaryDirectory() as folder:
        program = "from beaver_ftc.cli.main import main; main()"
        command = [sys.executable, "-c", program, "derive", f"jsbsim:{name}"]
        try:
            run = subprocess.run(
                [*command, "--out", folder, "--format", "json"],
                capture_output=True, text=True, timeout=LONGEST_S, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"| {name} | not within {LONGEST_S} s | | | | |"
    if run.returncode != 0:
        said = [line for line in run.stderr.splitlines() if line.strip() and not line.startswith("deriving")]
        why = said[-1].replace("|", "/") if said else f"ended by signal {-run.returncode}"
        why = re.sub(r'"?/[^ ]*/[^ ]*', "...", why)  # paths of this machine
        return f"| {name} | {why[:160]} | | | | |"
    document = json.loads(run.stdout)
    bound = document["largest_error_rad_s2"]["declared"]
    terms = ", ".join(str(document["terms"][c]) for c in ("Cl", "Cm", "Cn"))
    errors = " | ".join(f"{bound[axis]:.3g}" for axis in "pqr")
    return f"| {name} | {document['trim']['airspeed_mps']:.1f} | {terms} | {errors} |"


def main() -> None:
    """Derive them all and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="*", help="Print the lines of these, and write nothing.")
    only = parser.parse_args().only
    rows = []
    with ThreadPoolExecutor(os.cpu_count()) as at_once:
        for row in at_once.map(row_of, only or names()):
            rows.append(row)
            print(row, flush=True)
    if not only:
        PAGE.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
