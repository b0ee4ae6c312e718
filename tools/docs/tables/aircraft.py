"""Tables of aircraft.md: what `derive` makes of aircraft of the jsbsim package; are promises kept?"""

import json
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

from benchmarks.any_aircraft import TWELVE, row_of
from benchmarks.unknown_instant import Cell, Survey, cells_of, shares_of

from beaver_ftc.plant.instrumented import names
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_aircraft.derive.derivation import derive
from beaver_ftc_aircraft.derive.first_use import derive_if_needed
from tools.docs.pages import ROOT
from tools.docs.tables import aside, beaver

DERIVED_TITLE = "Derived aircraft: error of the design model near trim, and smallest certain losses"
EACH_TITLE = "The same for each aircraft, at 0.001 false alarms an hour"
EACH = (  # of the probe
    "*Table 4. Each aircraft at 0.001 false alarms an hour, the default: share of the losses that each test "
    "finds within 1 s, %.*"
)
LONGEST_S = 600
FLIGHTS, HOURS, SEED = 10, 0.2, 90417
PROBE = "pa28"
WATCHED = ("737", "A4", "B747", "MD11", "c172p", "c310", "J3Cub", "OV10", "T37", "pa28", "p51d", "t6texan2")
LOST, HEALTHY, FIRST = 20, 72, 500_000  # flights, and the first seed
BESIDE = ("false alarms, 1/h", "surface", "losses", "Page, %", "ours, %", "ratio, %", "from, %", "to, %")
BY_AIRCRAFT = ("Page, %", "ours, %")
RATES = ("20", "0.001")
# Of the example: a derivative in its model, and the term it becomes.
SAME = {"Cmalpha": "Cm_alpha", "Cmde": "Cm_elevator", "Cmadot": "Cm_alpha_rate", "Cmq": "Cm_qh"}
DERIVED = (
    "aircraft", "airspeed, m/s", "error p, rad/s²", "error q, rad/s²", "error r, rad/s²",
    "aileron, %", "elevator, %", "rudder, %",
)  # fmt: skip
REFUSED = "*Table {}. Aircraft of the package that cannot be derived, and the reason.*"
FLOWN = ("healthy", "false alarms", "losses", "detected", "named", "wrong", "left out", "certain", "late")


def derived_aircraft() -> str:
    """All of them, and in words those that cannot be derived."""
    rows, refused = _derived(names())
    shown = aside("derived-aircraft", DERIVED_TITLE, Table(DERIVED, rows))
    return f"{shown}\n\n{REFUSED.format(4)}\n\n{refused}"


def derived_aircraft_probe() -> str:
    """One of them, and one that cannot be."""
    rows, refused = _derived((PROBE, "ball"))
    return f"{markdown_table(DERIVED, rows)}\n\n{REFUSED.format(6)}\n\n{refused}"


def any_aircraft() -> str:
    """Random flights: do the promises hold for them?"""
    return _flown(TWELVE, FLIGHTS, HOURS)


def any_aircraft_probe() -> str:
    """Two flights of each kind of one."""
    return _flown((PROBE,), 2, 0.0)


def unknown_instant() -> str:
    """The diagnosis beside Page's test."""
    together, each = _beside(WATCHED, LOST, HEALTHY)
    return f"{together}\n\n{aside('unknown-instant', EACH_TITLE, each)}"


def unknown_instant_probe() -> str:
    """A few flights of one."""
    together, each = _beside((PROBE,), 2, 12)
    return f"{together}\n\n{EACH}\n\n{markdown_table(each.head, each.rows)}"


def _beside(chosen: Iterable[str], flights: int, healthy: int) -> tuple[str, Table]:
    """All aircraft together at each rate of false alarms; then each of them at the default rate."""
    found: dict[str, list[Cell]] = {}
    for name in chosen:
        derive_if_needed(f"jsbsim:{name}")
        found[name] = cells_of(Survey(f"jsbsim:{name}", "light", flights, healthy, FIRST))
    cells = [cell for of_it in found.values() for cell in of_it]
    surfaces = tuple(dict.fromkeys(cell.surface for cell in cells))
    groups = {name: [cell for cell in cells if cell.surface == name] for name in surfaces} | {"all": cells}
    together = [
        (rate, name, *_shares(of_it, k)) for k, rate in enumerate(RATES) for name, of_it in groups.items()
    ]
    head = ("aircraft", *(f"{name}: {share}" for name in surfaces for share in BY_AIRCRAFT))
    each = [
        (name, *(share for cell in of_it for share in _shares([cell], -1)[1:3]))
        for name, of_it in found.items()
    ]
    caption = "*Table 3. All aircraft together; columns as explained above.*"
    return f"{caption}\n\n{markdown_table(BESIDE, together)}", Table(head, each)


def _shares(cells: list[Cell], rate: int) -> list[str]:
    """Losses; found by Page's test and by ours, ours over Page's with its limits, %."""
    losses, found = shares_of(cells)
    return [str(losses), *(f"{100.0 * share:.0f}" for share in found[rate])]


def _flown(chosen: Iterable[str], flights: int, hours: float) -> str:
    rows = []
    for name in chosen:
        derive_if_needed(f"jsbsim:{name}")
        rows.append(row_of(name, flights, hours, SEED))
    return markdown_table(("aircraft", *FLOWN), rows)


def _derived(chosen: Iterable[str]) -> tuple[list[tuple[str, ...]], str]:
    """A row of each, and a table of those refused; one process each: a model that brings JSBSim down, or
    never ends, costs a line."""
    rows, refused = [], {}
    for name in chosen:
        document, why = _derive(name)
        if document is None:
            refused.setdefault(why, []).append(f"`{name}`")
        else:
            rows.append(_row(name, document))
    reasons = [(", ".join(those), why) for why, those in refused.items()]
    return rows, markdown_table(("aircraft", "reason"), reasons)


def _derive(name: str) -> tuple[dict | None, str]:
    """What `derive` prints, or why it prints nothing."""
    with tempfile.TemporaryDirectory() as folder:
        asked = ("derive", f"jsbsim:{name}", "--out", folder, "--format", "json")
        try:
            run = beaver(*asked, cwd=Path(folder), longest_s=LONGEST_S)
        except subprocess.TimeoutExpired:
            return None, f"not within {LONGEST_S} s"
    if run.returncode == 0:
        return json.loads(run.stdout), ""
    lines = [line for line in run.stderr.splitlines() if line.strip() and not line.startswith("deriving")]
    why = lines[-1] if lines else f"ended by signal {-run.returncode}"
    return None, why.removeprefix(f"jsbsim:{name}: ").partition(", allowed")[0]


def _row(name: str, document: dict) -> tuple[str, ...]:
    errors = (f"{document['near_trim_rad_s2'][axis]:.1g}" for axis in "pqr")
    losses = (
        f"{100 * share:.0f}" if share <= 1.0 else "-" for share in document["smallest_certain_loss"].values()
    )
    return name, f"{document['trim']['airspeed_mps']:.0f}", *errors, *losses


def own_aircraft() -> str:
    """Derivatives of the example as they were typed, and as `derive` finds them."""
    model = ROOT / "examples" / "own-aircraft" / "navion.xml"
    typed = {
        function.get("name").rpartition("/")[2]: float(function.find(".//value").text)
        for function in ElementTree.parse(model).iter("function")
    }
    with tempfile.TemporaryDirectory() as folder:
        derived = derive(str(model), Path(folder))
    found = {term.name: term.value for term in derived.aircraft.moments}
    rows = [(name, f"{typed[name]:g}", f"`{term}`", f"{found[term]:.4g}") for name, term in SAME.items()]
    return markdown_table(("typed", "value", "found", "value"), rows)
