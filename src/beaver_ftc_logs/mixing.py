"""The *mixing* of a vehicle, i.e. which command moves which surface, by the parameters in an autopilot's log.

`mixing_ardupilot` and `mixing_px4` read the parameters.

A command is the autopilot's own value for a surface, from -1 to 1, in the autopilot's sense: reversal and
range of an output are undone.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs.mixing_ardupilot import ardupilot_mixing
from beaver_ftc_logs.mixing_parts import Axes, CheckedParameters, Outputs, Surface, Weights, tidy
from beaver_ftc_logs.mixing_px4 import px4_mixing
from beaver_ftc_logs.recording import Floats, Parameters

# The outputs of both follow the aileron command with the same sign, and the flap command with opposite signs.
_FLAPERONS = ("left_flaperon", "right_flaperon")


@dataclass
class Mixing:
    """The commands and surfaces by the parameters of a log, in the form of the vehicle file.

    entry_by_column: column -> its entry of the key `commands`. surfaces: as the key of the file. lines:
    remarks on the surfaces that are used, and on those that are left out.
    """

    entry_by_column: Document = field(default_factory=dict)
    surfaces: dict[str, Weights] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    @property
    def commands(self) -> list[Any]:
        """The entries of the columns that the surfaces follow, each once."""
        used = dict.fromkeys(column for weights in self.surfaces.values() for column in weights)
        return [self.entry_by_column.get(column, column) for column in used]


def mixing_of_log(reader: str, params: Parameters, column_names: Collection[str]) -> Mixing:
    """The mixing by the parameters of a log, with commands out of these columns. It has no surfaces if the
    parameters give none, if the log has none of their commands, or if no autopilot wrote the log.
    """
    mixing = Mixing()
    names = set(column_names)
    read = CheckedParameters(params, mixing.lines)
    if reader == "ardupilot":
        surfaces, outputs, axes = ardupilot_mixing(read)
    elif reader == "ulog":
        surfaces, outputs, axes = px4_mixing(read, names)
    else:
        return mixing
    if surfaces:
        # There are several ways to log the outputs; the one that has the outputs of most surfaces is used.
        # The surfaces follow these outputs if no fewer surfaces have one than can follow the axes.
        n_logged = [sum(column in names for column, _ in columns) for columns in outputs]
        n_by_output = max(n_logged)
        if n_by_output and n_by_output >= sum(not axes.problem_of(surface, names) for surface in surfaces):
            _add_surfaces_by_output(mixing, surfaces, outputs[n_logged.index(n_by_output)], names)
        else:
            _add_surfaces_by_axis(mixing, surfaces, axes, names)
    mixing.lines += read.lines_on_changes
    if not mixing.surfaces:
        mixing.lines.append("the parameters of the log give no mixing: it stays out")
    return mixing


def _add_surfaces_by_output(
    mixing: Mixing, all_surfaces: Sequence[Surface], outputs: Outputs, names: set[str]
) -> None:
    """Add each surface with the command of its own output.

    If the shares of roll, pitch and yaw in a command are a linear combination of those in earlier commands,
    its surface follows the same combination of the earlier ones, since a fit cannot distinguish commands that
    move together. The command itself is then used only for a flaperon (`_weights_of_own_columns`). basis:
    positions of the independent commands.
    """
    used = []
    for surface, (column, reading) in zip(all_surfaces, outputs, strict=True):
        if column in names:
            used.append((surface, column, reading))
        else:
            mixing.lines.append(surface.stays_out(f"{column} is not in the log"))
    surfaces, columns, _ = zip(*used, strict=True)
    rows = _rows_of_commands(surfaces)
    own_weights = _weights_of_own_columns(surfaces)
    basis: list[int] = []
    for k, (surface, column, (scale, offset, text)) in enumerate(used):
        factors = np.linalg.lstsq(rows[basis].T, rows[k], rcond=None)[0] if basis else np.zeros(0)
        if basis and np.allclose(factors @ rows[basis], rows[k], atol=1e-6):
            shares = factors @ own_weights[basis]
        else:
            basis.append(k)
            shares = own_weights[k]
        weights = tidy(dict(zip(columns, shares.tolist(), strict=True)))
        mixing.surfaces[surface.name] = weights
        mixing.entry_by_column[column] = _command_entry(column, scale, offset)
        shared = "" if column in weights else f"; it moves with {' and '.join(weights)}"
        mixing.lines.append(f"{surface}: {surface.reason}{text}{shared}")


def _weights_of_own_columns(surfaces: Sequence[Surface]) -> Floats:
    """For each surface a row of shares of the outputs (k, k), as if each follows its own output alone. The
    flap command adds to one flaperon and subtracts from the other, so half of the sum of both outputs is the
    command without flaps.
    """
    weights = np.eye(len(surfaces))
    flaps = [k for k, surface in enumerate(surfaces) if surface.name in _FLAPERONS]
    if len(flaps) == len(_FLAPERONS):
        weights[np.ix_(flaps, flaps)] = 0.5
    return weights


def _rows_of_commands(surfaces: Sequence[Surface]) -> Floats:
    """Shares of roll, pitch and yaw in each surface, (k, 3). If those of a surface are unknown: a row for
    each surface with 1 in the column of its kind, so that only surfaces of one kind move together.
    """
    known = [surface.axis_shares for surface in surfaces if surface.axis_shares is not None]
    if len(known) == len(surfaces):
        return np.array(known)
    kinds = [surface.kind for surface in surfaces]
    return np.equal.outer(kinds, [*dict.fromkeys(kinds)]).astype(float)


def _add_surfaces_by_axis(mixing: Mixing, surfaces: Sequence[Surface], axes: Axes, names: set[str]) -> None:
    """Add each surface as a mix of the commands of roll, pitch and yaw, for a log without commands of
    outputs."""
    for surface in surfaces:
        if problem := axes.problem_of(surface, names):
            mixing.lines.append(surface.stays_out(f"its output is not in the log, and {problem}"))
            continue
        weights = axes.weights(surface)
        mixing.surfaces[surface.name] = weights
        mixing.entry_by_column |= {column: _command_entry(column, axes.scale, 0.0) for column in weights}
        mix = " ".join(f"{weight:+.4g} {column}" for column, weight in weights.items())
        mixing.lines.append(f"{surface}, {mix}: {surface.reason}{surface.mixer_reason}")


def _command_entry(column: str, scale: float, offset: float) -> Any:
    """The entry of a column in `commands` of a vehicle file: the name alone if scale and offset are 1 and
    0."""
    if (scale, offset) == (1.0, 0.0):
        return column
    entry = {"column": column, "scale": float(f"{scale:.10g}")}
    return entry | ({"offset": float(f"{offset:.10g}")} if offset else {})
