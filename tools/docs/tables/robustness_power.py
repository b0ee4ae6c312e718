"""Tables of docs/results/robustness.md: losses found by scheme, surface and air."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from beaver_ftc.studies.detectability.command import schemes_study
from beaver_ftc.studies.detectability.grid import GRIDS
from beaver_ftc.studies.detectability.probabilities import DUELS_S
from beaver_ftc.studies.detectability.schemes import contenders
from beaver_ftc.studies.detectability.schemes_shown import who_is_better
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import picture, studied

Document = dict[str, Any]

AIRS = {"none": "still", "light": "light"}
SURFACES = ("aileron", "rudder", "elevator")
CAPTION_BY_TIME_S = {
    "1": "*Table 2. Share of the faults that are found within 1 s, %; rows as explained above.*",
    "5": "*Table 3. Share of the faults that are found within 5 s, %.*",
}


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
