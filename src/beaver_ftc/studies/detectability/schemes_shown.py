"""The share found in a grid of flights, by schemes: as sentences, a table and files."""

from collections import Counter
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import Any

from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.rivals import Standing, leader
from beaver_ftc.studies.detectability.figures import INFORMED, draw_schemes
from beaver_ftc.studies.detectability.grid import WATCHED_S, WITHIN_S, title_of
from beaver_ftc.studies.detectability.probabilities import SIGNIFICANT
from beaver_ftc.studies.detectability.schemes import BOTH, BUILT_IN
from beaver_ftc.studies.detectability.shown import NAME, SOON, Line, table
from beaver_ftc.studies.present.page import Page, Pictures, study_files
from beaver_ftc.studies.present.tables import bare_percent, grouped, percent, seconds

OWN = ", default level"
_NO_DUEL = {"seeds_theirs": 0, "seeds_ours": 0, "p": 1.0}


def page_of(document: Document) -> Page:
    """The title, and the parts of the page: sentences, picture, table and notes."""
    conditions = document["grid"]["conditions"]
    sentences = [
        f"{title_of(*where)}, {sentence}"
        for where in conditions
        for sentence in who_is_better(document, *where)
    ]
    sentences += comparison(document)
    sentences += [f"could not be judged: {failure}" for failure in document["failures"]]
    lines = [line for condition in conditions for line in _scheme_lines(document, *condition)]
    picture = Pictures([("share of the losses that each scheme detects", NAME)])
    return "Detectability: schemes on the same flights", [
        *sentences,
        picture,
        table(lines),
        *_legend(document),
    ]


def _scheme_lines(document: Document, sensors: str, turbulence: str) -> Iterator[Line]:
    """A line for each surface and scheme under a condition, our schemes also at their default level; then the
    informed test."""
    condition = {"sensors": sensors, "turbulence": turbulence}
    levels = _matching(document["levels"], **condition)
    for surface in document["grid"]["surfaces"]:
        place = {"loss of": surface, "flown": title_of(sensors, turbulence)}
        totals = _by_scheme(document, **condition, surface=surface)
        for level in levels:
            scheme = level["scheme"]
            total = totals.get(scheme)
            row = place | {"scheme": scheme, "false alarms/h": _rate(level["calibration"])}
            yield row | {"before faults/h": _rate(level["before_faults"])} | _share_cells(total)
            if scheme in BUILT_IN:
                row |= {"scheme": f"{scheme}{OWN}", "false alarms/h": _rate(level["own_level"])}
                yield row | _share_cells(total and total["own_level"])
        for informed in _matching(document["limits"], **condition, surface=surface):
            shares = "/".join(map(bare_percent, informed["within"].values()))
            yield place | {"scheme": INFORMED, SOON: shares}


def _share_cells(total: Document | None) -> Line:
    """The shares found within each of WITHIN_S in per cent, the median delay and the number of flights."""
    if not total or not total["flights"]:
        return {SOON: "-"}
    shares = "/".join(bare_percent(total["within"][f"{within_s:g}"]["value"]) for within_s in WITHIN_S)
    return {SOON: shares, "median delay": seconds(total["median_delay_s"]), "flights": str(total["flights"])}


def who_is_better(
    document: Document, sensors: str, turbulence: str, within_s: float = WATCHED_S
) -> Iterator[str]:
    """A sentence for each surface under a condition: the scheme that finds most faults within `within_s`. Of
    our schemes, only BOTH is compared."""
    soon = f"{within_s:g}"
    for surface in document["grid"]["surfaces"]:
        place = {"sensors": sensors, "turbulence": turbulence, "surface": surface}
        against_both = _matching(document["comparison"], **place, ours=BOTH, within_s=within_s)
        duel_of = {line["against"]: line for line in against_both}
        standings = {
            scheme: Standing([*total["within"][soon].values()], _duel(duel_of.get(scheme, _NO_DUEL)))
            for scheme, total in _by_scheme(document, **place).items()
            if total["flights"] and (scheme == BOTH or scheme not in BUILT_IN)
        }
        if BOTH in standings:
            yield leader(standings, BOTH, f"{surface}, found within {soon} s", percent, more_is_better=True)


def _duel(line: Document) -> Document:
    """A comparison with ours, from the side of the other scheme."""
    return {"better": line["seeds_theirs"], "worse": line["seeds_ours"], "p": line["p"]}


def comparison(document: Document) -> list[str]:
    """In how many comparisons each of our schemes finds significantly more or fewer faults than another
    scheme."""
    sentences = []
    for (ours, within_s), duels in grouped(document["comparison"], "ours", "within_s").items():
        n = Counter(duel["verdict"] for duel in duels)
        sentences.append(
            f"{ours}, faults found within {within_s:g} s, {len(duels)} comparisons: better in "
            f"{n['better']}, worse in {n['worse']}, no difference at p < {SIGNIFICANT:g} in the rest"
        )
    return sentences


def _by_scheme(document: Document, **place: str) -> dict[str, Document]:
    """The totals of a place, by scheme."""
    return {total["scheme"]: total for total in _matching(document["totals"], **place)}


def _matching(lines: Sequence[Document], **where: Any) -> list[Document]:
    """The lines that have all these values."""
    return [line for line in lines if where.items() <= line.items()]


def _rate(alarms: Document | None) -> str:
    """A rate of false alarms with its interval, 1/h."""
    if alarms is None or alarms["per_h"] is None:
        return "-"
    high = "" if alarms["per_h_high"] is None else f" to {alarms['per_h_high']:.0f}"
    return f"{alarms['per_h']:.0f} ({alarms['per_h_low']:.0f}{high})"


def _legend(document: Document) -> list[str]:
    """The notes below the table."""
    grid = document["grid"]
    per_h = document["false_alarms_per_h"]
    hours = min((level["calibration"]["hours"] for level in document["levels"]), default=0.0)
    losses = ", ".join(f"{100 * magnitude:g}" for magnitude in grid["magnitudes"])
    references = ", ".join(f"{excitation:g}" for excitation in grid["excitations_deg_s"])
    return [
        f"Losses of {losses} % under references of {references} deg/s. False alarms/h: every scheme at the "
        f"level of its statistic with at most {per_h:g} per hour, on the same {hours:.2f} h of healthy "
        "flight (95 % limits); before faults/h: the same on other flights.",
        f"By chance alone {100.0 * per_h * WATCHED_S / 3600.0:.1f} % are detected within {WATCHED_S:g} s. "
        "Default level: the one that follows from what the scheme declares.",
        f"{INFORMED}: knows surface, magnitude and instant, and the gusts that the vanes show; made once in "
        "that time at the same rate. Plug-ins are given every reading that the statistical scheme uses.",
    ]


FILES = study_files(NAME, page_of, {NAME: attrgetter("behind")}, {NAME: draw_schemes})
