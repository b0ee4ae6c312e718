"""Tables of docs/results/robustness.md: detection and tracking with real errors, and with undeclared ones."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.detectability.command import schemes_study
from beaver_ftc.studies.detectability.grid import GRIDS
from beaver_ftc.studies.detectability.probabilities import DUELS_S
from beaver_ftc.studies.detectability.schemes import contenders
from beaver_ftc.studies.detectability.schemes_shown import who_is_better
from beaver_ftc.studies.engine.statistics import share_within, wilson
from beaver_ftc.studies.engine.study import fly_all
from beaver_ftc.studies.matrix.informed import columns_of, informed_row
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table, tabulated
from beaver_ftc.studies.sensitivity.beyond import TOGETHER
from beaver_ftc.studies.sensitivity.command import errors_study
from beaver_ftc.studies.sensitivity.errors_shown import COLUMNS
from beaver_ftc.studies.sensitivity.errors_shown import error_sentences as sentences
from beaver_ftc.studies.sweep.one_flight import fly_one, scenario_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan
from tools.docs.tables import aside, picture, studied, table_of

Document = dict[str, Any]
Rows = list[dict[str, Any]]

# Losses under each kind of error.
CONDITIONS = ("sensors", "servo", "coefficients", "air", "all", "all-published")
SOON_S = 0.5
LOSSES_HEAD = (
    "errors", "within 0.5 s, %", "from, %", "to, %", "median, s", "95 %, s", "99 %, s", "detected",
    "rightly named", "false alarms",
)  # fmt: skip

# Losses and biased instruments, with sensors in doubt.
DOUBT_HEAD = (
    "part", "sensors", "detected", "rightly named", "wrongly named", "median time to the name, s",
)  # fmt: skip
DOUBTED_SWEEP = "robust-elevator-all"
DOUBTED_S = 30.0  # the attitude needs some seconds to refute a gyro error
DOUBTED_FLIGHTS, TOLD_FLIGHTS = 60, 12
DOUBTED = ("elevator", "rudder", "aileron")
OF_DOUBT = {
    "sound": {"sensor_monitor": "never"},
    "in doubt": {"sensor_monitor": "always"},
    "in doubt, all fault types": {"fault_class": "all"},
}
BIASED = {"gyro, bias of 0.5 deg/s": ("pqr", 0.5), "vane, bias of 2 deg": (("alpha", "beta"), 2.0)}

# Losses found by scheme, surface and air.
AIRS = {"none": "still", "light": "light"}
SURFACES = ("aileron", "rudder", "elevator")
CAPTION_BY_TIME_S = {
    "1": "*Table 2. Share of the faults that are found within 1 s, %; rows as explained above.*",
    "5": "*Table 3. Share of the faults that are found within 5 s, %.*",
}

# Verdicts beyond what is declared.
DECAYS = ("elevator-loss-in-turbulence", "elevator-partial-loss")  # all of it declared; next to nothing
DECAY_HEAD = (
    "error", "declared", "times", "false alarms, %", "detected, %", "named rightly, %", "named wrongly, %",
    "tracking RMS, deg/s",
)  # fmt: skip
DECAY_WORDS = ("error", "declared")
DECAY_CAPTION = (
    "*Table 1. Verdicts beyond the declaration. Shares in % of the flights; tracking: median of the flights, "
    "deg/s. Columns as explained above.*"
)
DECAY_TITLE = "Verdicts beyond the declaration: shares in % of the flights, and median tracking error"
DECAY_FIGURE = (
    "*Figure 2. False alarms, right names (both in % of the flights) and tracking RMS (deg/s) for "
    "`elevator-loss-in-turbulence`. Horizontal: size of the error divided by its declared size, or by its "
    "unit. Columns: error, with its declared size or unit. Bars: 95 % intervals.*"
)
_PICTURED = "False alarms, right names and tracking over the size of each error, with 95 % intervals"
PUBLISHED = "The published case has no margin"
PUBLISHED_COLUMNS = {
    "error": "error", "declared": "declared", "times": "factor g", "false alarms": "false_alarm.count",
    "named wrongly": "misnamed.count",
}  # fmt: skip


def robustness_losses() -> str:
    """Elevator losses under each kind of error."""
    return markdown_table(LOSSES_HEAD, [
        (condition, *_of_losses(_flown(f"robust-elevator-{condition}", 500))) for condition in CONDITIONS
    ])  # fmt: skip


def robustness_losses_probe() -> str:
    """A few of these flights, to more digits: the delay, and how near the residual came to its threshold."""
    return "\n".join(
        f"robust-elevator-{condition}: " + ", ".join(
            f"{row['detection.delay_s']} {row['worst_residual_ratio']:.6g}"
            for row in _flown(f"robust-elevator-{condition}", 3, workers=1)
        )
        for condition in CONDITIONS
    )  # fmt: skip


def _flown(name: str, count: int, workers: int = 2) -> Rows:
    """The first flights of a built-in sweep, a row each."""
    sweep = load_sweep(name)
    return fly_all(partial(fly_one, sweep), list(Plan(sweep).assignments(range(count))), workers)


def _of_losses(rows: Rows) -> Iterator[str]:
    """The cells of LOSSES_HEAD, but for the first."""
    delays = [row["detection.delay_s"] for row in rows]
    found = [row for row in rows if row["detection.delay_s"] is not None]
    soon = wilson(sum(row["detection.delay_s"] <= SOON_S + 1e-9 for row in found), len(rows))
    yield from (f"{100 * share:.1f}" for share in (soon.value, soon.low, soon.high))
    for share in (0.5, 0.95, 0.99):
        within = share_within(delays, share)
        yield f"{within:.3f}" if np.isfinite(within) else "never"
    yield str(len(found))
    yield str(sum(bool(row["isolation.correct"]) for row in found))
    yield str(sum(bool(row["false_alarm"]) for row in rows))


def robustness_doubt() -> str:
    """Losses with all errors together, sensors assumed sound and in doubt; then biased instruments."""
    rows = [_of_doubt(surface, sensors) for surface in DOUBTED for sensors in OF_DOUBT]
    rows += [_of_doubt(part, "in doubt") for part in BIASED]
    return markdown_table(DOUBT_HEAD, rows)


def robustness_doubt_bound() -> str:
    """What a test that is told a loss of Table 4 has to tell it from the error of any gyro."""
    return markdown_table(
        ("surface", "flights", "least deflection, standard deviations", "chance, %"), map(_told, DOUBTED)
    )


def _told(surface: str) -> tuple[str, ...]:
    """The row of a surface: the least deflection of a few flights, and their mean chance."""
    seen = []
    for one in _doubted(surface, {"sensor_monitor": "always"}, TOLD_FLIGHTS):
        scenario = scenario_of(load_sweep(DOUBTED_SWEEP), one)
        kept = columns_of(scenario.airframe)
        fly(scenario, kept)
        seen.append(informed_row(scenario, kept, surface))
    least = min(each["told_deflection"] for each in seen)
    chance = np.mean([each["told_chance"] for each in seen])
    return surface, str(TOLD_FLIGHTS), f"{least:.0f}", f"{100 * chance:.0f}"


def _of_doubt(part: str, sensors: str) -> tuple[str, ...]:
    """The row of DOUBT_HEAD for a surface or BIASED instruments, with the settings OF_DOUBT."""
    rows = fly_all(
        partial(fly_one, load_sweep(DOUBTED_SWEEP)), _doubted(part, OF_DOUBT[sensors], DOUBTED_FLIGHTS), 2
    )
    right = [row for row in rows if row["isolation.correct"]]
    named = [row for row in rows if row["isolation.isolated"]]
    median_s = f"{np.median([row['isolation.delay_s'] for row in right]):.2f}" if right else "-"
    found = sum(row["detection.delay_s"] is not None for row in rows)
    counts = (found, len(right), len(named) - len(right))
    return (part, sensors, *(f"{count} of {DOUBTED_FLIGHTS}" for count in counts), median_s)


def _doubted(part: str, fdi: dict[str, str], count: int) -> list[Assignment]:
    """The first flights of DOUBTED_SWEEP, with this part at fault."""
    keys = {f"fdi.{key}": value for key, value in fdi.items()}
    drawn = Plan(load_sweep(DOUBTED_SWEEP)).assignments(range(count))
    return [one._replace(values=_with_fault(one, part) | keys) for one in drawn]


def _with_fault(one: Assignment, part: str) -> Document:
    """What varies in a long flight, with the loss on another surface, or a biased instrument instead."""
    if part in DOUBTED:
        return {**one.values, "faults[0].actuator": part, "duration_s": DOUBTED_S}
    (sensors, size), at_s = BIASED[part], one.values["faults[0].at_s"]
    fault = {"sensor": sensors[one.run % len(sensors)], "type": "bias", "magnitude": size, "at_s": at_s}
    kept = {key: value for key, value in one.values.items() if not key.startswith("faults")}
    return kept | {"faults": [fault], "duration_s": DOUBTED_S}


def robustness_power() -> str:
    """Share of losses found under tactical-grade sensors, by scheme, surface and air; and a picture of it."""
    document, drawn = studied(schemes_study(GRIDS["quick"], contenders(None)), 2)
    picture("power-tactical-grade.png", "", drawn["detectability.png"])
    return _power_of(document)


def robustness_power_probe() -> str:
    """The same of a few flights, and each alarm level to more digits: it moves with the parameters of a
    scheme where shares of a few flights do not. That of multiple-models is 0 if no odds favour a fault."""
    grid = replace(GRIDS["quick"], blocks=1, magnitudes=(1.0,), excitations_deg_s=(3.0,), healthy_h=0.01)
    document, _ = studied(schemes_study(grid, contenders(None)))
    levels = (f"{each['turbulence']}, {each['scheme']}: {each['level']:.6g}" for each in document["levels"])
    return "\n".join((_power_of(document), *levels))


def _power_of(document: Document) -> str:
    """At the same rate of false alarms for all; `both` at its default level as well."""
    parts = [
        part
        for soon, title in CAPTION_BY_TIME_S.items()
        for part in (title, _power_within(document, soon), _best(document, soon))
    ]
    return "\n\n".join([*parts, *(_duels(document["comparison"], within_s) for within_s in DUELS_S)])


def _best(document: Document, soon: str) -> str:
    """Who finds most, a line an air and a surface."""
    sensors = document["grid"]["conditions"][0][0]
    return "\n".join(
        f"- {air.capitalize()} air, {sentence}"
        for turbulence, air in AIRS.items()
        for sentence in who_is_better(document, sensors, turbulence, float(soon))
    )


def _power_within(document: Document, soon: str) -> str:
    """A row a scheme, a column an air and a surface."""

    def cells(lines: list[Document], within: Callable[[Document], Document], **scheme: str) -> Iterator[str]:
        for air in AIRS:
            for surface in SURFACES:
                where = {"turbulence": air, "surface": surface, **scheme}
                of = within(next(line for line in lines if where.items() <= line.items()))
                yield f"{100 * _share(of[soon]):.0f}" if of else "-"

    totals = document["totals"]
    schemes = dict.fromkeys(line["scheme"] for line in totals)
    head = ("scheme", *(f"{air}: {surface}" for air in AIRS.values() for surface in SURFACES))
    rows = [(name, *cells(totals, lambda of: of["within"], scheme=name)) for name in schemes]
    own = ("both, default level", *cells(totals, lambda of: of["own_level"]["within"], scheme="both"))
    informed = ("informed test", *cells(document["limits"], lambda of: of["within"]))
    return markdown_table(head, [*rows, own, informed])


def _duels(comparison: list[Document], within_s: float) -> str:
    """How often our two detectors together find more, or less, of the same faults so soon."""
    place = {"ours": "both", "within_s": within_s}
    verdicts = [duel["verdict"] for duel in comparison if place.items() <= duel.items()]
    better, worse = (verdicts.count(verdict) for verdict in ("better", "worse"))
    rest = len(verdicts) - better - worse
    return (
        "The scheme *both* was compared with each rival, for each surface and each kind of air. The "
        f"comparison counts the faults found within {within_s:g} s. In {better} of these {len(verdicts)} "
        f"comparisons *both* finds significantly more faults, and in {worse} significantly fewer. In the "
        f"other {rest} the difference is not significant."
    )


def _share(within: Any) -> float:
    """The share itself, of one that may have an interval."""
    return within["value"] if isinstance(within, dict) else within


def robustness_decay() -> str:
    """How verdicts decay beyond what is declared, of two scenarios; and a picture of the first."""
    (whole, drawn), (published, _) = (studied(errors_study(load_scenario(one)), 2) for one in DECAYS)
    shown = picture("decay.png", _PICTURED, drawn["sensitivity.png"])
    table = aside("robustness-decay", DECAY_TITLE, _decay_table(whole))
    return "\n\n".join([table, shown, DECAY_FIGURE, f"### {PUBLISHED}", _published(published)])


def robustness_decay_probe() -> str:
    """Two flights of each row of the first."""
    document, _ = studied(errors_study(load_scenario(DECAYS[0]), 2))
    says = "\n".join(f"- {sentence}" for sentence in sentences(document))
    flown = f"`{document['scenario']}`, {document['flights']} flights a row"
    table = _decay_table(document)
    return f"{flown}:\n\n{says}\n\n{DECAY_CAPTION}\n\n{markdown_table(table.head, table.rows)}"


def _decay_table(document: Document) -> Table:
    """A table without intervals, which the figure has."""
    shown = [
        row
        for row in document["rows"]
        if row["factor"] > 1.0 or row["error"] == TOGETHER or _is_undeclared(document, row)
    ]
    heads, lines = tabulated(COLUMNS, shown)
    rows = [
        tuple(
            cell if head in DECAY_WORDS else cell.partition(" (")[0]
            for head, cell in zip(heads, line, strict=True)
            if head in DECAY_HEAD
        )
        for line in lines
    ]
    return Table(DECAY_HEAD, rows)


def _published(document: Document) -> str:
    """All together as declared; then of each error the least size with a wrong verdict, or the largest."""
    rows = document["rows"]
    together = [row for row in rows if row["error"] == TOGETHER]
    each = [
        next((row for row in of if row["false_alarm"]["count"] or row["misnamed"]["count"]), of[-1])
        for name in dict.fromkeys(row["error"] for row in rows)
        for of in [[row for row in rows if row["error"] == name]]
    ]
    caption = (
        f"*Table 6. Verdicts of `{document['scenario']}`. First row: all errors as declared. Other "
        'rows: the smallest size with a wrong verdict. "times": this size, divided by the declared size or '
        f"by the unit. Last columns: numbers of flights, of {document['flights']} a row.*"
    )
    return f"{caption}\n\n{table_of((together[0], *each), PUBLISHED_COLUMNS)}"


def _is_undeclared(document: Document, row: Document) -> bool:
    """Whether no bound covers the error of a row."""
    return any(e["error"] == row["error"] and not e["is_declared"] for e in document["errors"])
