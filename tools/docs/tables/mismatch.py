"""Tables of docs/results/validation.md, truth against the design model."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

from beaver_ftc.aircraft import AXES
from beaver_ftc.scenario.schema import load
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import beaver, table_of

DESIGNS = ("declared", "engine-neglected", "linearised", "frozen-alpha", "heavy")
CONDITIONS = ((30.0, 0.0), (35.0, 1829.0), (45.0, 1829.0), (50.0, 3000.0), (55.0, 4000.0))
SWING = ("short_period", "phugoid", "dutch_roll")


def mismatch_designs() -> str:
    """What a wrong design model costs: the published elevator case, each with the published bound."""
    given = ("elevator-partial-loss", "--variant", ",".join(DESIGNS), "--no-report", "--format", "json")
    with TemporaryDirectory() as folder:
        run = beaver("mismatch", *given, cwd=Path(folder))
        run.check_returncode()
        runs = json.loads(run.stdout)["runs"]
    names = [run["scenario"].removeprefix("elevator-partial-loss").lstrip("-") or "declared" for run in runs]
    flights = dict(zip(names, runs, strict=True))
    columns = {
        "design model": "name",
        **{f"{axis}, % of bound": f"bound.{axis}.worst_ratio *100 .0f" for axis in AXES},
        **{f"{axis}, rad/s²": f"bound.{axis}.smallest_constant_rad_s2 .2g" for axis in AXES},
        "largest source": "dominant.source",
        "false alarm": "false_alarm",
    }
    return table_of([flights[name] | {"name": name} for name in DESIGNS], columns)


def mismatch_modes() -> str:
    """Frequency, rad/s, and damping of the truth's modes, and how far two other linear models are off."""
    rows = []
    for airspeed_mps, altitude_m in CONDITIONS:
        initial = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m}
        modes = linear_document(analyse(load({"name": "modes", "initial": initial})))["modes"]
        found = [value for name, mode in modes.items() for value in _said(name, mode["truth"])]
        worst = (
            max(mode["deviation"]["fdc"] for mode in modes.values()),
            max(mode["jsbsim_own_deviation"] for mode in modes.values()),
        )
        rows.append(
            (f"{airspeed_mps:g}", f"{altitude_m:g}", *found, *(f"{100 * share:.2f}" for share in worst))
        )
    heads = [head for name in modes for head in _heads(name)]
    return markdown_table(("airspeed, m/s", "altitude, m", *heads, "FDC, %", "JSBSim, %"), rows)


def _heads(name: str) -> tuple[str, ...]:
    words = name.replace("_", " ")
    return (f"{words}, rad/s", f"{words}, damping") if name in SWING else (f"{words}, 1/s",)


def _said(name: str, mode: dict[str, float]) -> tuple[str, ...]:
    """Frequency, and damping where it swings."""
    frequency = f"{mode['frequency_rad_s']:.3g}"
    return (frequency, f"{mode['damping']:.2g}") if name in SWING else (frequency,)
