"""Tables of docs/results/mismatch.md."""

import json
import subprocess
import sys
import tempfile

from beaver_ftc.aircraft import AXES
from beaver_ftc.scenario.loader import load
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.present.tables import markdown_table

DESIGNS = ("declared", "engine-neglected", "linearised", "frozen-alpha", "heavy")
CONDITIONS = ((30.0, 0.0), (35.0, 1829.0), (45.0, 1829.0), (50.0, 3000.0), (55.0, 4000.0))
PROGRAM = "from beaver_ftc.cli.main import main; main()"


def mismatch_designs() -> str:
    """What a wrong design model costs: the published elevator case, each with the published bound."""
    given = ("mismatch", "elevator-partial-loss", "--variant", ",".join(DESIGNS), "--no-report")
    command = [sys.executable, "-c", PROGRAM, *given, "--format", "json"]
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    flights = {}
    for found in json.loads(run.stdout)["runs"]:
        flights[found["scenario"].removeprefix("elevator-partial-loss").lstrip("-") or "declared"] = found
    return markdown_table(
        ("design model", *AXES, "largest", "false alarm"),
        [
            (
                name,
                *(_beside_bound(flights[name]["bound"][axis]) for axis in AXES),
                flights[name]["dominant"]["source"],
                "yes" if flights[name]["false_alarm"] else "no",
            )
            for name in DESIGNS
        ],
    )


def _beside_bound(bound: dict[str, float]) -> str:
    return f"{100 * bound['worst_ratio']:.0f}%/{bound['smallest_constant_rad_s2']:.2g}"


def mismatch_modes() -> str:
    """Frequency, rad/s, and damping of the truth's modes, and how far two other linear models are off."""
    rows = []
    for airspeed_mps, altitude_m in CONDITIONS:
        initial = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m}
        modes = linear_document(analyse(load({"name": "modes", "initial": initial})))["modes"]
        of_it = [_said(mode["truth"]) for mode in modes.values()]
        worst = (
            max(mode["deviation"]["fdc"] for mode in modes.values()),
            max(mode["jsbsim_own_deviation"] for mode in modes.values()),
        )
        rows.append((f"{airspeed_mps:g}/{altitude_m:g}", *of_it, *(f"{share:.2%}" for share in worst)))
    names = (name.replace("_", " ") for name in modes)
    return markdown_table(("m/s/m", *names, "FDC", "JSBSim"), rows)


def _said(mode: dict[str, float]) -> str:
    """Frequency, and damping where it swings."""
    damping = f"/{mode['damping']:.2g}" if mode["damping"] < 1.0 else ""
    return f"{mode['frequency_rad_s']:.3g}{damping}"
