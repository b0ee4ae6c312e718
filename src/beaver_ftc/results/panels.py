"""What a figure is: a view is a list of panels, a panel a list of traces, a trace a column of the log.

The figures and the report draw the same views. The unit of a column follows from its name; radians are shown
as degrees.
"""

import math
from dataclasses import dataclass
from typing import Any

from beaver_ftc.results import units

AXIS_QUANTILES = 0.005, 0.995  # these quantiles set an axis that clips spikes
_SHOWN_UNIT = {"rad/s2": "deg/s²", "rad/s": "deg/s", "rad": "deg", "1": ""}  # other units are shown unchanged


@dataclass(frozen=True)
class Trace:
    """One curve: a column of the log or derived from it, its label, and its role, which determines its look
    (style.py).

    The shown value is factor * column + offset; offset has the shown unit.
    """

    column: str
    label: str
    role: str
    sign: float = 1.0
    offset: float = 0.0

    @property
    def factor(self) -> float:
        """Factor from the unit of the column to the shown one, with the sign."""
        return self.sign * shown_unit(self.column)[1]


@dataclass(frozen=True)
class Panel:
    """One pair of axes, over the time in seconds."""

    label: str
    traces: tuple[Trace, ...]
    log_scale: bool = False
    limits: tuple[float, float] | None = None
    value_names: tuple[str, ...] = ()  # names of the values 0, 1, 2, ... of a discrete quantity
    shade_column: str = ""  # a 0/1 column: the panel is shaded while it is 1
    shade_label: str = ""
    line_at: float | None = None  # a horizontal line is drawn at this value
    clips_spikes: bool = False  # AXIS_QUANTILES set the axis; an arrow marks spikes beyond them
    bars: bool = False  # a row for each label, with a bar while one of its traces is 0
    bars_during_column: str = ""  # a 0/1 column: bars are drawn only while it is 1

    @property
    def steps(self) -> tuple[str, ...]:
        """The names along the axis: of the values of a discrete quantity, or of the rows of a panel of
        bars."""
        return tuple(dict.fromkeys(trace.label for trace in self.traces)) if self.bars else self.value_names

    @property
    def unit(self) -> str:
        """The unit of the first trace, which all traces share; empty for a dimensionless quantity."""
        return shown_unit(self.traces[0].column)[0]


@dataclass(frozen=True)
class View:
    """A figure: panels, filled row by row into `n_panel_columns` columns of panels."""

    name: str
    title: str
    panels: tuple[Panel, ...]
    n_panel_columns: int = 1
    text_without_data: str = ""  # written into the panels if the columns have no data
    closeup: bool = False  # also drawn around the events
    folded: bool = False  # details: the report shows them after a click

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that it shows: of the log, or derived from it (series.py)."""
        traced = [trace.column for panel in self.panels for trace in panel.traces]
        flags = [
            flag for panel in self.panels for flag in (panel.shade_column, panel.bars_during_column) if flag
        ]
        return tuple(dict.fromkeys(traced + flags))


def shown_unit(column: str) -> tuple[str, float]:
    """The shown unit of a log column, and the factor from the unit of the column to it."""
    unit = units.unit_of(column)
    return _SHOWN_UNIT.get(unit, unit), math.degrees(1.0) if unit.startswith("rad") else 1.0


def panel_of(label: str, *traces: tuple[Any, ...], **fields: Any) -> Panel:
    """A panel of traces. traces: fields of each `Trace`, (column, label, role) and optionally more. fields:
    further fields of the panel."""
    return Panel(label, tuple(Trace(*trace) for trace in traces), **fields)


def ratio_panel(label: str, *traces: tuple[str, str, str]) -> Panel:
    """A panel of ratios, on a logarithmic scale with a line at 1, which a healthy aircraft does not
    exceed."""
    return panel_of(label, *traces, log_scale=True, line_at=1.0)
