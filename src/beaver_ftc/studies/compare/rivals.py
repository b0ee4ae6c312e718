"""Sentences that compare our scheme and our law with their rivals, by the lines of a set (`scores`)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple

from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.trial import LAW, ORACLE, SCHEME, STATISTICAL
from beaver_ftc.studies.present.tables import percent, values_of

# The keys of a line in which `better_than_ours` compares rivals with ours, and their names. The keys of
# MATCHED are those of a point of the trade-off, too.
MATCHED = {"detection_rate": "detection rate", "delay_median_s": "median detection delay, s"}
COMPARED = {
    "false_alarms_per_h": "false alarms per hour",
    **MATCHED,
    "delay_90_s": "90 % detection delay, s",
    "isolation_rate": "isolation accuracy",
}
TRACKING = {
    "ratio_median": "median tracking ratio to the oracle",
    "ratio_90": "90 % tracking ratio to the oracle",
    "departures": "departures",
}
ERROR_AND_EFFORT = {
    "before_median": "median error before the fault, deg/s",
    "before_90": "90 % error before the fault, deg/s",
    "after_median": "median error after the fault, deg/s",
    "after_90": "90 % error after the fault, deg/s",
    "travel_median": "median travel of the surfaces, deg/s",
    "energy_median": "median energy of the surfaces, deg2/s2",
}
MORE_IS_BETTER = ("detection_rate", "isolation_rate")  # less of any other number
SIGNIFICANT = 0.05  # with a smaller p, a difference counts as more than chance
# Schemes and laws that are no rivals: yardsticks, and variants and parts of ours.
NO_RIVALS = ("none", STATISTICAL, ORACLE, "oracle-published", "fault-tolerant-published")


def competitors(lines: Sequence[Document]) -> tuple[dict[str, Document], dict[str, Document]]:
    """The lines of our scheme and its rivals with our law, and of our law and its rivals with our scheme, by
    name."""
    schemes = {row["scheme"]: row for row in lines if row["law"] == LAW and row["scheme"] not in NO_RIVALS}
    laws = {row["law"]: row for row in lines if row["scheme"] == SCHEME and row["law"] not in NO_RIVALS}
    return schemes, laws


def who_is_better(lines: Sequence[Document]) -> Document:
    """A sentence about the schemes, and one about the laws: the best of them, with intervals and
    significance. Empty if no flight has a fault."""
    if not any(values_of(lines, "faults")):
        return {}
    schemes, laws = competitors(lines)
    error = "Tracking error over the oracle's, median"
    return {
        "schemes": leader(_standings(schemes, "detection_rate"), SCHEME, "Faults detected", percent, True),
        "laws": leader(_standings(laws, "ratio_median"), LAW, error, "{:.2f}".format),
    }


class Standing(NamedTuple):
    """A number of a contender, and its duel with ours.

    - estimate: the number, its lower and its upper limit; None for a missing one.
    - duel: in how many flights the contender is `better` and `worse` than ours, and `p`, the probability of a
      result at least as uneven between equals.
    """

    estimate: Sequence[float | None]
    duel: Document


def _standings(rows: Mapping[str, Document], key: str) -> dict[str, Standing]:
    """The standing of each line by the number under this key, whose limits are `<key>_low` and
    `<key>_high`."""
    return {
        name: Standing([row.get(key + end) for end in ("", "_low", "_high")], row["against_ours"])
        for name, row in rows.items()
    }


def leader(
    standings: Mapping[str, Standing], ours: str, title: str, cell: Callable[[float], str],
    more_is_better: bool = False,
) -> str:  # fmt: skip
    """One sentence that compares the best rival with ours, each number with its interval. If their numbers
    are equal, it names all rivals that equal ours.

    standings: of ours and the rivals, by name. ours: our name. title: of the number. cell: its format.
    """
    badness = {name: _badness(each.estimate[0], more_is_better) for name, each in standings.items()}
    texts = {name: f"{name} {_with_interval(each.estimate, cell)}" for name, each in standings.items()}
    rivals = [name for name in standings if name != ours]
    if not rivals:
        return f"{title}: {texts[ours]}."
    best = min(rivals, key=badness.__getitem__)
    if badness[best] == badness[ours]:
        equals = [name for name in rivals if badness[name] == badness[ours]]
        return f"{title}: {ours} and {', '.join(equals)} are equally good: {texts[ours]}."
    duel = standings[best].duel
    wins = {best: duel["better"], ours: duel["worse"]}
    first, second = sorted(wins, key=badness.__getitem__)
    doubt = "" if duel["p"] < SIGNIFICANT else ", so this may be chance"
    return (
        f"{title}: {texts[first]} is better than {texts[second]}; wins: {wins[first]} against "
        f"{wins[second]}, p = {duel['p']:.2g}{doubt}."
    )


def _badness(value: float | None, more_is_better: bool) -> float:
    """A number that is smaller for a better value; no value is the worst."""
    if value is None:
        return inf
    return -value if more_is_better else value


def _with_interval(estimate: Sequence[float | None], cell: Callable[[float], str]) -> str:
    """A number and its interval."""
    missing = ("none", "no limit", "no limit")
    return "{} ({} to {})".format(
        *(none if x is None else cell(x) for x, none in zip(estimate, missing, strict=True))
    )


def better_than_ours(lines: Sequence[Document], free: Document) -> list[str]:
    """One sentence for each number in which a rival is better than ours.

    lines: among them that of our entry. free: by scheme, the point at its most sensitive level without a
    false alarm, if there is one.
    """
    schemes, laws = competitors(lines)
    ours = schemes[SCHEME]
    sentences = [s for name, row in schemes.items() for s in _better(row, ours, COMPARED | TRACKING, name)]
    if SCHEME in free:
        sentences += [
            f"with no false alarm, {sentence}"
            for scheme, point in free.items()
            if scheme in schemes
            for sentence in _better(point, free[SCHEME], MATCHED, scheme)
        ]
    return sentences + [
        s for name, row in laws.items() for s in _better(row, ours, TRACKING | ERROR_AND_EFFORT, name)
    ]


def _better(row: Document, ours: Document, compared: Mapping[str, str], name: str) -> Iterator[str]:
    """The sentences of one rival. A number of ours that does not exist, an infinite delay or an unknown rate,
    is printed as `never`. Our own row is never better than itself."""
    for key, name_of_number in compared.items():
        mine, theirs = (_badness(line.get(key), key in MORE_IS_BETTER) for line in (ours, row))
        if theirs < mine - 1e-9:
            our_text = "never" if ours.get(key) is None else f"{ours[key]:.3g}"
            yield f"{name} has the better {name_of_number}: {row[key]:.3g} against {our_text}"
