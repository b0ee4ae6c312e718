"""The survey for the terminal: a table a condition, then where ours is better or worse."""

from typing import Any

from beaver_ftc.studies.power.contenders import BUILT_IN
from beaver_ftc.studies.power.document import JUDGED_S, SIGNIFICANT
from beaver_ftc.studies.power.grid import WITHIN_S
from beaver_ftc.studies.present.tables import plain, printed

Document = dict[str, Any]
WIDTH = 140
OWN = "  as it ships"
TOLD = "(told the fault)"


def as_text(document: Document, colour: bool = False) -> str:
    """Tables, legend, comparison and failures."""
    tables = [_table(document, *condition) for condition in document["grid"]["conditions"]]
    said = [*_legend(document), "", *comparison(document), *_failures(document)]
    return "\n".join([printed(tables, WIDTH, colour), *said])


def _table(document: Document, sensors: str, turbulence: str) -> Any:
    surfaces = document["grid"]["surfaces"]
    rows = []
    for level in document["levels"]:
        if (level["sensors"], level["turbulence"]) == (sensors, turbulence):
            cells = [_total(document, level, surface) for surface in surfaces]
            rows.append([level["scheme"], _rate(level["calibration"]), _rate(level["before_faults"]), *cells])
            if level["scheme"] in BUILT_IN:
                own = [_total(document, level, surface, own=True) for surface in surfaces]
                rows.append([OWN, _rate(level["own_level"]), "", *own])
    rows.append([TOLD, "", "", *(_limit(document, sensors, turbulence, surface) for surface in surfaces)])
    head = ["scheme", "false alarms/h", "before faults/h", *surfaces]
    return plain(title_of(sensors, turbulence), head, rows)


def title_of(sensors: str, turbulence: str) -> str:
    """A condition in words."""
    air = "still air" if turbulence == "none" else f"{turbulence} turbulence"
    return f"{sensors} sensors, {air}"


def _rate(alarms: Document | None) -> str:
    if alarms is None or alarms["per_h"] is None:
        return "-"
    high = "" if alarms["per_h_high"] is None else f" to {alarms['per_h_high']:.0f}"
    return f"{alarms['per_h']:.0f} ({alarms['per_h_low']:.0f}{high})"


def _limit(document: Document, sensors: str, turbulence: str, surface: str) -> str:
    for found in document["limits"]:
        if (found["sensors"], found["turbulence"], found["surface"]) == (sensors, turbulence, surface):
            return "/".join(f"{100 * share:.0f}" for share in found["within"].values())
    return "-"


def _total(document: Document, level: Document, surface: str, own: bool = False) -> str:
    for total in document["totals"]:
        if total["surface"] == surface and _same(total, level):
            return shares(total["own_level"] if own else total)
    return "-"


def _same(total: Document, level: Document) -> bool:
    return all(total[name] == level[name] for name in ("sensors", "turbulence", "scheme"))


def shares(total: Document) -> str:
    """Per cent found within each delay, and the median delay."""
    if not total["flights"]:
        return "-"
    percent = "/".join(f"{100 * total['within'][f'{within_s:g}']['value']:.0f}" for within_s in WITHIN_S)
    median_s = total["median_delay_s"]
    return f"{percent} {'never' if median_s is None else f'{median_s:.2f} s'}"


def _legend(document: Document) -> list[str]:
    grid = document["grid"]
    hours = [level["calibration"]["hours"] for level in document["levels"]]
    within = "/".join(f"{within_s:g}" for within_s in WITHIN_S)
    chance = document["false_alarms_per_h"] * WITHIN_S[-1] / 36.0
    losses = ", ".join(f"{100 * magnitude:g}" for magnitude in grid["magnitudes"])
    references = ", ".join(f"{excitation:g}" for excitation in grid["excitations_deg_s"])
    return [
        f"per surface: % of losses of {losses} % detected within {within} s, and the median delay, under "
        f"references of {references} deg/s.",
        "false alarms/h: every scheme at the level of its statistic with at most "
        f"{document['false_alarms_per_h']:g} per hour, on the same {min(hours, default=0.0):.2f} h of "
        "healthy flight (95 % limits);",
        f"before faults: the same on other flights. By chance alone {chance:.1f} % are detected within "
        f"{WITHIN_S[-1]:g} s.",
        f"{OWN.strip()}: at the level that follows from what it declares.",
        f"{TOLD}: a test that knows surface, magnitude and instant, made once in that time at the same rate.",
        _shown(grid["vanes"]),
    ]


def _shown(vanes: bool) -> str:
    if vanes:
        return "plug-ins and that test are shown the air as the statistical scheme sees it by the vanes."
    return "plug-ins and that test have the rates alone; the statistical scheme sees the air by its vanes."


def comparison(document: Document) -> list[str]:
    """Where ours finds more or fewer faults than another scheme, and is unlikely to by chance."""
    duels = document["comparison"]
    lines = [
        f"{ours} is {verdict} than {against}: {'; '.join(_places(duels, ours, against, verdict))}"
        for ours in dict.fromkeys(duel["ours"] for duel in duels)
        for verdict in ("worse", "better")
        for against in dict.fromkeys(duel["against"] for duel in duels)
        if _places(duels, ours, against, verdict)
    ]
    return [*lines, *_counts(duels)]


def _places(duels: list[Document], ours: str, against: str, verdict: str) -> list[str]:
    """`surface, surface in condition` for each condition in which that is so."""
    found: dict[str, list[str]] = {}
    for duel in duels:
        if (duel["ours"], duel["against"], duel["verdict"]) == (ours, against, verdict):
            found.setdefault(title_of(duel["sensors"], duel["turbulence"]), []).append(duel["surface"])
    return [f"{', '.join(surfaces)} with {condition}" for condition, surfaces in found.items()]


def _counts(duels: list[Document]) -> list[str]:
    return [
        f"{ours}, faults found within {JUDGED_S:g} s, {len(verdicts)} comparisons: better in "
        f"{verdicts.count('better')}, worse in {verdicts.count('worse')}, no difference at "
        f"p < {SIGNIFICANT:g} in the rest"
        for ours in dict.fromkeys(duel["ours"] for duel in duels)
        for verdicts in [[duel["verdict"] for duel in duels if duel["ours"] == ours]]
    ]


def _failures(document: Document) -> list[str]:
    return [f"could not be judged: {failure}" for failure in document["failures"]]
