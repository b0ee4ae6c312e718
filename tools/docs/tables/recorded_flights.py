"""Tables of recorded-flights.md: ways to diagnose the flights in the folder `BEAVER_FTC_FLIGHTS`."""

import os
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks import own_logs as own

from beaver_ftc.studies.present.page import write_files
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_logs.recorded.benchmark import SCORE_TITLES, SURFACE_KINDS, result_files, run_benchmark
from tools.docs.tables import shared

Document = dict[str, Any]
PICTURE = "images/recorded-flights.png"
OWN_SEEDS = (206, 207, 208)
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
SHOWN = ("classes", "healthy_or_faulty", "mean_error", "held_by_bounds")


def _folder() -> Path:
    return Path(os.environ["BEAVER_FTC_FLIGHTS"])


@shared
def _benchmark() -> Document:
    return run_benchmark(_folder())


def recorded_alfa() -> str:
    """Failures of the ALFA flights: what each method finds, how late, and what else it finds."""
    document = _benchmark()
    Path("images").mkdir(exist_ok=True)
    picture = result_files(document)["flights.png"]
    write_files(Path("images"), {Path(PICTURE).name: picture})
    return _alfa(document)


def recorded_enac() -> str:
    """Labels of the ENAC flight: how many rows each method has right."""
    return _enac(_benchmark())


def own_logs() -> str:
    """Simulated flights in light turbulence, diagnosed by identified models, beside a test that is told."""
    of_it = [own.HEAD.index(name) for name in OWN]
    results = [
        one
        for seed in OWN_SEEDS
        for one in own.flown(own.Campaign(air="light", seed=seed), "table", ["identified"])
    ]
    rows = own.table(results)
    return markdown_table(
        tuple(OWN.values()), [[row[i].removeprefix(f"{own.LOSS} ") for i in of_it] for row in rows]
    )


def own_logs_probe() -> str:
    """The end of one of these flights, by a model of two others, one of each law, a third as long."""
    of = own.Campaign(air="light", seed=OWN_SEEDS[0])
    with TemporaryDirectory() as folder:
        trained = [one | {"duration_s": PROBED_S} for one in islice(own.training(of), 2)]
        logs = [own.recorded(one, "table", Path(folder)) for one in trained]
        model = own.identified(of, logs)
        quiet = next(one for one in own.scenarios(of) if one["sensors"] == "ideal")  # as those two are
        rows, _ = own.by_model(own.recorded(quiet, "table", Path(folder)), model)
    return f"{rows.fault_probability[-1]:.2g} {rows.effectiveness_low[-1]} {rows.effectiveness_high[-1]}"


def _part(document: Document, name: str) -> Document:
    return next(part for part in document["sets"] if part["set"] == name)


def _alfa(document: Document) -> str:
    part = _part(document, "alfa")
    head = ("method", "precision/recall/accuracy", *(f"{kind}, s" for kind in SURFACE_KINDS),
            "within 5 s", "false alarms/h (95 %)", "healthy flights alarmed")  # fmt: skip
    return markdown_table(head, [_event_row(row) for row in (*part["rows"], *part["published"])])


def _event_row(row: Document) -> list[str]:
    """Delays are means, of so many of so many failures."""
    cells = [row["method"], "/".join(f"{row[key]:.2f}" for key in ("precision", "recall", "accuracy"))]
    cells += [_delay(row["delay_s"].get(kind, {})) for kind in SURFACE_KINDS]
    if "false_alarms_per_hour" not in row:
        return [*cells, "", "", ""]
    lateral = [row["delay_s"][kind] for kind in SURFACE_KINDS[:2]]
    soon, failures = (sum(of[key] for of in lateral) for key in ("within_5_s", "failures"))
    alarms = row["false_alarms_per_hour"]
    return [
        *cells, f"{soon}/{failures}",
        f"{alarms['value']:.1f} ({alarms['low']:.1f}-{alarms['high']:.0f})",
        f"{row['healthy_flights_with_an_alarm']}/{row['healthy_flights']}",
    ]  # fmt: skip


def _delay(of: Document) -> str:
    if of.get("mean") is None:
        return "never" if of.get("failures") else ""
    return f"{of['mean']:.1f}" + (f" ({of['found']}/{of['failures']})" if "found" in of else "")


def _enac(document: Document) -> str:
    part = _part(document, "enac")
    return markdown_table(("method", *(SCORE_TITLES[key] for key in SHOWN)), [
        (row["method"], *_shares(row, SHOWN)) for row in (*part["rows"], *part["published"])
    ])  # fmt: skip


def _shares(row: Document, keys: tuple[str, ...]) -> list[str]:
    return ["" if row.get(key) is None else f"{row[key]:.3f}" for key in keys]
