"""Tables of aircraft.md: what `derive` makes of aircraft of the jsbsim package; are promises kept?"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from benchmarks.any_aircraft import HEALTHY_S, TWELVE, row_of
from benchmarks.unknown_instant import Cell, Survey, cells_of, shares_of

from beaver_ftc.plant.instrumented import names
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_aircraft.derive.derivation import derive
from beaver_ftc_aircraft.derive.first_use import derive_if_needed
from tools.docs.pages import ROOT

PROGRAM = "from beaver_ftc.cli.main import main; main()"
LONGEST_S = 600
FLIGHTS, HOURS, SEED = 10, 0.2, 90417
PROBE = "pa28"
WATCHED = ("737", "A4", "B747", "MD11", "c172p", "c310", "J3Cub", "OV10", "T37", "pa28", "p51d", "t6texan2")
LOST, HEALTHY, FIRST = 20, 72, 500_000  # flights, and the first seed
BESIDE = ("aircraft", "losses", "told", "ours", "share", "told, shipped", "ours, shipped", "share, shipped")
# Of the example: a derivative in its model, and the term it becomes.
SAME = {"Cmalpha": "Cm_alpha", "Cmde": "Cm_elevator", "Cmadot": "Cm_alpha_rate", "Cmq": "Cm_qh"}
FLOWN = ("healthy", "false alarms", "losses", "detected", "named", "wrong", "left out", "certain", "late")


def derived_aircraft() -> str:
    """All of them, and in words those that cannot be derived."""
    return _derived(names())


def derived_aircraft_probe() -> str:
    """One of them, and one that cannot be."""
    return _derived((PROBE, "ball"))


def any_aircraft() -> str:
    """`python benchmarks/any_aircraft.py`, with fewer flights: do the promises hold for them?"""
    return _flown(TWELVE, FLIGHTS, HOURS)


def any_aircraft_probe() -> str:
    """Two flights of each kind of one."""
    return _flown((PROBE,), 2, 0.0)


def unknown_instant() -> str:
    """`python benchmarks/unknown_instant.py`, aileron/elevator/rudder in a cell."""
    return _beside(WATCHED, LOST, HEALTHY)


def unknown_instant_probe() -> str:
    """A few flights of one."""
    return _beside((PROBE,), 2, 12)


def _beside(chosen: Iterable[str], flights: int, healthy: int) -> str:
    """A row an aircraft; then of each surface, and of all, with 95 % limits of the shares."""
    cells: list[Cell] = []
    rows = []
    for name in chosen:
        derive_if_needed(f"jsbsim:{name}")
        of_it = cells_of(Survey(f"jsbsim:{name}", "light", flights, healthy, FIRST), [])
        each = [_shares([cell], False) for cell in of_it]
        rows.append((name, *("/".join(parts) for parts in zip(*each, strict=True))))
        cells += of_it
    surfaces = dict.fromkeys(cell.surface for cell in cells)
    rows += [(name, *_shares([cell for cell in cells if cell.surface == name])) for name in surfaces]
    return markdown_table(BESIDE, [*rows, ("all", *_shares(cells))])


def _shares(cells: list[Cell], limits: bool = True) -> list[str]:
    """Losses; found by the test told all but the instant, by ours, theirs over its, in percent; the same at
    the level as shipped."""
    losses, _, found = shares_of(cells)
    row = [str(losses)]
    for told, ours, share, low, high in 100.0 * np.array(found):
        row += [f"{told:.0f}", f"{ours:.0f}", f"{share:.0f}" + (f"({low:.0f}-{high:.0f})" if limits else "")]
    return row


def _flown(chosen: Iterable[str], flights: int, hours: float) -> str:
    args = argparse.Namespace(
        flights=flights,
        first=0,
        seed=SEED,
        healthy_s=HEALTHY_S,
        hours=hours,
        fault_class="published",
        declared=False,
    )
    rows = []
    for name in chosen:
        derive_if_needed(f"jsbsim:{name}")
        rows.append(row_of(name, args)[0][: len(FLOWN) + 1])
    return markdown_table(("aircraft", *FLOWN), rows)


def _derived(chosen: Iterable[str]) -> str:
    """A row of each; one process each: a model that brings JSBSim down, or never ends, costs a line."""
    rows, refused = [], {}
    for name in chosen:
        document, why = _derive(name)
        if document is None:
            refused.setdefault(why, []).append(f"`{name}`")
        else:
            rows.append(_row(name, document))
    says = [f"- {', '.join(those)}: {why}" for why, those in refused.items()]
    return f"{markdown_table(('aircraft', 'm/s', 'error', 'loss'), rows)}\n\n" + "\n".join(says)


def _derive(name: str) -> tuple[dict | None, str]:
    """What `derive` prints, or why it prints nothing."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", PROGRAM, "derive", f"jsbsim:{name}", "--out", folder]
        try:
            run = subprocess.run(
                [*command, "--format", "json"], capture_output=True, text=True, timeout=LONGEST_S, check=False
            )
        except subprocess.TimeoutExpired:
            return None, f"not within {LONGEST_S} s"
    if run.returncode == 0:
        return json.loads(run.stdout), ""
    lines = [line for line in run.stderr.splitlines() if line.strip() and not line.startswith("deriving")]
    why = lines[-1] if lines else f"ended by signal {-run.returncode}"
    return None, why.removeprefix(f"jsbsim:{name}: ").partition(", allowed")[0]


def _row(name: str, document: dict) -> tuple[str, ...]:
    errors = "/".join(f"{document['near_trim_rad_s2'][axis]:.1g}" for axis in "pqr")
    losses = document["smallest_certain_loss"].values()
    loss = "/".join(f"{100 * share:.0f}" if share <= 1.0 else "-" for share in losses)
    return name, f"{document['trim']['airspeed_mps']:.0f}", errors, loss


def own_aircraft() -> str:
    """Derivatives of the example as they were typed, and as `derive` finds them; the bound it declares."""
    model = ROOT / "examples" / "own-aircraft" / "navion.xml"
    typed = {
        function.get("name").rpartition("/")[2]: float(function.find(".//value").text)
        for function in ElementTree.parse(model).iter("function")
    }
    with tempfile.TemporaryDirectory() as folder:
        derived = derive(str(model), Path(folder))
    found = {term.name: term.value for term in derived.aircraft.moments}
    rows = [(name, f"{typed[name]:g}", f"`{term}`", f"{found[term]:.4g}") for name, term in SAME.items()]
    bound = max(derived.aircraft.model_error_rad_s2)
    return (
        f"{markdown_table(('typed', 'value', 'found', 'value'), rows)}\n\nDeclared bound: {bound:.1g} rad/s²."
    )
