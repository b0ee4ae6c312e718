"""Tables of recorded-flights.md: ways to diagnose the flights in the folder `BEAVER_FTC_FLIGHTS`."""

import os
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks import own_logs as own

from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_logs.recorded.benchmark import LABEL_TITLES, SURFACE_KINDS, run_benchmark
from beaver_ftc_logs.recorded.comparison import result_files
from tools.docs.tables import aside, picture, shared, table_of

Document = dict[str, Any]
OWN_SEEDS = (209, 210, 211)
AIRCRAFT_SEEDS = (9403, 9404)
CLAIMED_SEEDS = (*OWN_SEEDS, *AIRCRAFT_SEEDS)
AIRCRAFT_AND_AIR = (
    ("jsbsim:737", "light"), ("jsbsim:737", "none"), ("jsbsim:c172p", "light"), ("jsbsim:c172p", "none"),
    ("beaver", "none"),
)  # fmt: skip
AIR_TEXT = {"light": "light turbulence", "none": "still"}
PROBED_S = 20.0  # of each training flight of the probe
OWN = {  # column of benchmarks/own_logs.py: head on the page
    "fault": "fault",
    "flights": "flights",
    "false alarms": "false alarms",
    "found": "found",
    "told": "found by the informed test",
    "named rightly": "named rightly",
    "named wrongly": "named wrongly",
    "held by bounds": "held by bounds",
    "held at fault": "held, faulty surface",
}
OWN_OF_AIRCRAFT = OWN | {"refused": "refused"}
SHOWN = ("classes", "healthy_or_faulty", "mean_error", "held_by_bounds")
NOT_COUNTED = {"false_alarms_per_hour": {"value": None}}  # of a published method
DELAYS = (
    '*Table 2. Delays on the failures of ALFA. "found": failures found, of all failures of this surface. '
    '"delay": mean time from failure to alarm, for the failures found, s. "within 5 s": failures found '
    "within 5 s, of all aileron and rudder failures. Empty: not published.*"
)


def _folder() -> Path:
    return Path(os.environ["BEAVER_FTC_FLIGHTS"])


@shared
def _benchmark() -> Document:
    return run_benchmark(_folder())


def recorded_alfa() -> str:
    """Failures of the ALFA flights: what each method finds, how late, and what else it finds."""
    document = _benchmark()
    picture("recorded-flights.png", "", result_files(document)["flights.png"])
    part = _part(document, "alfa")
    rows = (*part["rows"], *part["published"])
    found = {
        "method": "method", "precision": "precision .2f", "recall": "recall .2f", "accuracy": "accuracy .2f",
        "false alarms per hour": "false_alarms_per_hour.value .1f",
        "95 % interval": lambda row: _interval(row["false_alarms_per_hour"]),
        "healthy flights alarmed": _healthy,
    }  # fmt: skip
    late = (
        "method",
        *(head for kind in SURFACE_KINDS for head in (f"{kind}: found", "delay, s")),
        "within 5 s",
    )
    return (
        f"{table_of([NOT_COUNTED | row for row in rows], found, '')}\n\n{DELAYS}\n\n"
        f"{markdown_table(late, [_delay_row(row) for row in rows])}"
    )


def recorded_enac() -> str:
    """Labels of the ENAC flight: how many rows each method has right."""
    part = _part(_benchmark(), "enac")
    rows = [dict.fromkeys(SHOWN) | row for row in (*part["rows"], *part["published"])]
    return table_of(rows, {"method": "method", **{LABEL_TITLES[key]: f"{key} .3f" for key in SHOWN}}, "")


def own_logs() -> str:
    """Simulated flights in light turbulence, diagnosed by identified models, beside a test that is told."""
    results = [one for seed in OWN_SEEDS for one in _by_identified(own.Campaign(air="light", seed=seed))]
    return markdown_table(tuple(OWN.values()), _own_rows(results, OWN))


def own_logs_of_aircraft() -> str:
    """The same of other aircraft, in turbulence and in still air."""
    campaigns = [own.Campaign(*of_it, seed) for of_it in AIRCRAFT_AND_AIR for seed in AIRCRAFT_SEEDS]
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        flown = dict(zip(campaigns, pool.map(_by_identified, campaigns), strict=True))
    rows = []
    for aircraft, air in AIRCRAFT_AND_AIR:
        results = [one for seed in AIRCRAFT_SEEDS for one in flown[own.Campaign(aircraft, air, seed)]]
        rows += [
            [aircraft.removeprefix("jsbsim:"), AIR_TEXT[air], *row]
            for row in _own_rows(results, OWN_OF_AIRCRAFT)
        ]
    table = Table(("aircraft", "air", *OWN_OF_AIRCRAFT.values()), rows)
    return aside("own-logs-of-aircraft", "Simulated losses, other aircraft and still air", table)


def _by_identified(of: own.Campaign) -> list[Document]:
    return own.flown(of, ["identified"])


def _own_rows(results: list[Document], head_of_column: dict[str, str]) -> list[list[str]]:
    of_it = [own.HEAD.index(name) for name in head_of_column]
    return [[row[i].removeprefix(f"{own.LOSS} ") for i in of_it] for row in own.table(results)]


def own_logs_probe() -> str:
    """The end of one of these flights, by a model of two others, one of each law, a third as long."""
    of = own.Campaign(air="light", seed=OWN_SEEDS[0])
    with TemporaryDirectory() as folder:
        trained = [one | {"duration_s": PROBED_S} for one in islice(own.training(of), 2)]
        model = own.identified([own.recorded(one, Path(folder)) for one in trained])
        quiet = next(one for one in own.scenarios(of) if one["sensors"] == "ideal")  # as those two are
        rows, _ = own.by_model(own.recorded(quiet, Path(folder)), model)
    return f"{rows.fault_probability[-1]:.2g} {rows.effectiveness_low[-1]} {rows.effectiveness_high[-1]}"


def _part(document: Document, name: str) -> Document:
    return next(part for part in document["sets"] if part["set"] == name)


def _interval(alarms: Document) -> str:
    return "" if alarms["value"] is None else f"{alarms['low']:.1f} to {alarms['high']:.0f}"


def _healthy(row: Document) -> str:
    alarmed, flights = (row.get(f"healthy_flights{end}") for end in ("_with_an_alarm", ""))
    return "" if alarmed is None else f"{alarmed} of {flights}"


def _delay_row(row: Document) -> list[str]:
    """Delays are means, of so many of so many failures."""
    cells = [
        row["method"],
        *(cell for kind in SURFACE_KINDS for cell in _delay(row["delay_s"].get(kind, {}))),
    ]
    if "false_alarms_per_hour" not in row:
        return [*cells, ""]
    lateral = [row["delay_s"][kind] for kind in SURFACE_KINDS[:2]]
    soon, failures = (sum(of[key] for of in lateral) for key in ("within_5_s", "failures"))
    return [*cells, f"{soon} of {failures}"]


def _delay(of: Document) -> tuple[str, str]:
    mean = "" if of.get("mean") is None else f"{of['mean']:.1f}"
    if "failures" not in of:
        return "", mean
    return f"{of['found']} of {of['failures']}", mean or "never"
