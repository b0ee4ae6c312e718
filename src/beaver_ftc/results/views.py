"""The views of a flight, for the figures and the report alike: those that the columns of its log allow."""

import re
from collections.abc import Sequence
from typing import Any

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.panels import Panel, View, panel_of, ratio_panel
from beaver_ftc.results.series import (
    COMMANDED_AIRSPEED_COLUMN,
    MEAN_AIRSPEED_COLUMN,
    RATIO_ENDING,
    UNLIKE_ENDING,
    source_columns,
)
from beaver_ftc.results.words import MOTION_OF_AXIS, without_underscores
from beaver_ftc.scenario.diagnosis import MODES
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS

AXIS_NAMES = {axis: f"{motion} rate {axis}" for axis, motion in MOTION_OF_AXIS.items()}

SIDES = ("left", "right")
SURFACE_ROLES = tuple(f"surface {i}" for i in range(8))  # roles of the surfaces, in the order of the aircraft
ATTAINABLE_AIRSPEED_COLUMN = "airspeed_limited_mps"  # the commanded airspeed, as far as it can be held
BEAVER_POWER_COLUMN = "manifold_pressure_inhg"
# Columns that may stand before that of the engine power: alarm, sensor monitor, sensors of the monitor alone.
_BEFORE_POWER = {"detected", "watch_test", "watch_missing", *(row.column for row in ROWS[N_IN_EQUATIONS:])}
MEAN_AIRSPEED_EXPECTATION = "airspeed_within_mps"  # the expectation about the mean airspeed

Names = Sequence[str]
"""Names of columns, surfaces or estimators, in the order of the log or of the aircraft."""


def estimators(columns: Names) -> tuple[str, ...]:
    """Names of the isolation estimators whose columns a log has, in the order of the log."""
    matches = (re.fullmatch(r"fie_(.+)_excluded", column) for column in columns)
    return tuple(match.group(1) for match in matches if match)


def surfaces(columns: Names) -> tuple[str, ...]:
    """Names of the surfaces whose columns a log has, in the order of the aircraft."""
    ending = "_cmd_rad"
    return tuple(column.removesuffix(ending) for column in columns if column.endswith(ending))


def views_of_flight(columns: Names, metrics: Metrics) -> tuple[View, ...]:
    """Every view of a flight whose log has these columns."""
    return views(columns, bool(metrics.engine_power), expected_airspeed_mps(metrics))


def expected_airspeed_mps(metrics: Metrics) -> float | None:
    """Largest deviation of the mean airspeed from the command that the scenario expects, m/s; None without
    such an expectation."""
    return next(
        (
            expectation.expected
            for expectation in metrics.expectations
            if expectation.name == MEAN_AIRSPEED_EXPECTATION
        ),
        None,
    )


def views(columns: Names, power: bool = False, within_mps: float | None = None) -> tuple[View, ...]:
    """Every view whose columns a log has. power: whether the law has used the engine. within_mps: as
    `expected_airspeed_mps` returns it."""
    known_columns = set(columns)
    surface_names = surfaces(columns)
    engine = power_column(columns)
    isolating = estimators(columns)
    all_views = (
        _TRACKING, _profile_view(ATTAINABLE_AIRSPEED_COLUMN in known_columns, engine, within_mps),
        _surfaces_view(surface_names), _DETECTION, _SENSOR_MONITOR, _likelihood_view(columns),
        _candidates_view(surface_names, isolating), _isolation_view(isolating), _ratio_view(isolating),
        _effectiveness_view(surface_names), _SUPERVISOR, *((_ENGINE,) if power else ()), _STATES,
    )  # fmt: skip
    return tuple(
        view for view in all_views if view.panels and known_columns.issuperset(source_columns(view.columns))
    )


def power_column(columns: Names) -> str:
    """The log column of the engine power that is commanded along a profile; empty if there is none.

    The Beaver always has BEAVER_POWER_COLUMN. The column of another aircraft stands before the differences of
    its engines and `altitude_command_m`, the first command of the profile; without such a column, one of
    _BEFORE_POWER stands there.
    """
    if BEAVER_POWER_COLUMN in columns:
        return BEAVER_POWER_COLUMN
    if "altitude_command_m" not in columns:
        return ""
    before = columns[: columns.index("altitude_command_m")]
    neighbour = [name for name in before if not name.endswith("_difference")][-1]
    return "" if neighbour in _BEFORE_POWER else neighbour


_TRACKING = View(
    "tracking",
    "Tracking: body rates against their reference",
    tuple(
        panel_of(
            AXIS_NAMES[axis],
            (f"{axis}_reference_rad_s", "reference", "command"),
            (f"{axis}_model_rad_s", "reference model", "target"),
            (f"{axis}_rad_s", "aircraft", "actual"),
        )
        for axis in AXES
    ),
)


def _profile_view(limited: bool, power: str, within_mps: float | None) -> View:
    """Commanded and flown altitude, airspeed, heading and bank, and engine power. limited: whether the log
    has the attainable airspeed. power: its column, or empty."""
    flown = (
        ("altitude", "altitude_command_m", "altitude_m"),
        ("airspeed", "airspeed_command_mps", "airspeed_mps"),
        ("heading ψ", "heading_command_rad", "psi_rad"),
        ("bank φ", "bank_command_rad", "phi_rad"),
    )
    mean = _mean_airspeed_traces(within_mps)
    further = {"airspeed": [(ATTAINABLE_AIRSPEED_COLUMN, "attainable", "command")] if limited else []}
    panels = [
        panel_of(
            label, (command, "commanded", "target"), *further.get(label, ()), (actual, "flown", "actual"),
            *(mean if label == "airspeed" else ()),
        )
        for label, command, actual in flown
    ]  # fmt: skip
    words = power.removesuffix("_inhg").replace("_", " ")
    engine = [panel_of(f"engine: {words}", (power, "flown", "actual"))] if power else []
    return View("profile", "Profile: commanded and flown", (*panels, *engine))


def _mean_airspeed_traces(within_mps: float | None) -> list[tuple[Any, ...]]:
    """Traces of the mean airspeed, and of the limits that the scenario expects of it."""
    mean = MEAN_AIRSPEED_COLUMN, "10 s mean", "residual"
    if within_mps is None:
        return [mean]
    bound = f"± {within_mps:g} m/s, expected of the mean"
    upper = COMMANDED_AIRSPEED_COLUMN, bound, "bound", 1.0, within_mps
    return [mean, upper, (COMMANDED_AIRSPEED_COLUMN, "", "bound", 1.0, -within_mps)]


def surfaces_by_kind(names: Names) -> dict[str, list[str]]:
    """Names of surfaces by kind, in their order. The kind is the last word that is no side and no number:
    `left_inboard_elevator`, `elevator_2` and `outboard_elevator_left` are elevators."""
    by_kind: dict[str, list[str]] = {}
    for name in names:
        kinds = [word for word in name.split("_") if not word.isdigit() and word not in SIDES]
        by_kind.setdefault(kinds[-1] if kinds else name, []).append(name)
    return by_kind


Labelled = dict[str, list[tuple[str, str, str]]]
"""By kind of surface, (name, label, role) of each surface."""


def _labels_and_roles_by_kind(names: Names) -> Labelled:
    """(name, label, role) of each surface by its kind. If there are at most as many surfaces as roles, all
    are of one kind without a name, so that each has a look of its own."""
    if names and len(names) <= len(SURFACE_ROLES):
        return {"": [(name, name, role) for name, role in zip(names, SURFACE_ROLES, strict=False)]}
    labelled: Labelled = {}
    for kind, group in surfaces_by_kind(names).items():
        for name, role in zip(group, SURFACE_ROLES * len(group), strict=False):
            others = " ".join(word for word in name.split("_") if word != kind)
            labelled.setdefault(kind, []).append((name, others or kind, role))
    return labelled


def _surfaces_view(names: Names) -> View:
    """A panel for each surface; of many surfaces, two panels for each kind."""
    if len(names) > len(SURFACE_ROLES):
        panels = tuple(
            panel_of(
                f"{kind}: {label}", *((f"{name}_{ending}_rad", called, role) for name, called, role in group)
            )
            for kind, group in _labels_and_roles_by_kind(names).items()
            for ending, label in (("cmd", "commanded"), ("effective", "as the aerodynamics see it"))
        )
        return View("surfaces", "Control surfaces by kind", panels, n_panel_columns=2)
    panels = tuple(
        panel_of(
            surface,
            (f"{surface}_cmd_rad", "command", "demand"),
            (f"{surface}_effective_rad", "effective", f"effective {place}"),
            (f"{surface}{UNLIKE_ENDING}", "position, where it differs from effective", "unlike"),
            shade_column=f"{surface}_saturated",
            shade_label="saturated",
            clips_spikes=True,
        )
        for place, surface in enumerate(names)
    )
    return View("surfaces", "Control surfaces: commanded, and effective on the aerodynamics", panels)


def detection_panel(axis: str, label: str, role: str = "residual") -> Panel:
    """The residual of the detection estimator on an axis, within its threshold."""
    threshold = f"{axis}_threshold_rad_s"
    bounds = (threshold, "± threshold", "bound"), (threshold, "", "bound", -1.0)
    return panel_of(label, *bounds, (f"{axis}_residual_rad_s", "residual", role))


def isolation_panel(name: str, axis: str, label: str, threshold: str = "± threshold") -> Panel:
    """The residual of an isolation estimator on an axis, within its thresholds."""
    stem = f"fie_{name}_{axis}"
    shade = f"fie_{name}_excluded"
    bounds = (f"{stem}_lower_rad_s", threshold, "bound"), (f"{stem}_upper_rad_s", "", "bound")
    residual = f"{stem}_residual_rad_s", "residual", "actual"
    return panel_of(label, *bounds, residual, shade_column=shade, shade_label="excluded")


_DETECTION = View(
    "detection",
    "Detection: the test that raises the alarm (above 1), and the detection estimator",
    (
        ratio_panel(
            "alarm test: |residual| / threshold",
            *((f"{axis}_alarm{RATIO_ENDING}", axis, axis) for axis in AXES),
        ),
        *(detection_panel(axis, f"{AXIS_NAMES[axis]}: detection residual") for axis in AXES),
    ),
    closeup=True,
)
_SENSOR_MONITOR = View(
    "watch",
    "Sensor monitor: largest residual between sensors over its bound; above 1 one of them is faulty",
    (ratio_panel("largest residual between sensors / bound", ("watch_share", "largest", "actual")),),
    closeup=True,
)


def _likelihood_view(columns: Names) -> View:
    """A panel for the tests of each kind of surface, and one for those of the axes."""
    ending = "_loss_likelihood_share"
    names = [column.removesuffix(ending) for column in columns if column.endswith(ending)]
    losses = {
        kind: [(f"{name}{ending}", f"{called} loss", role) for name, called, role in group]
        for kind, group in _labels_and_roles_by_kind(names).items()
    }
    steps = [(f"{axis}_step_likelihood_share", f"{axis}'", axis) for axis in AXES]
    panels = (
        *(
            ratio_panel(f"loss of {kind or 'a surface'}: test / alarm level", *traces)
            for kind, traces in losses.items()
        ),
        ratio_panel("step or tone of an acceleration, or its force: test / alarm level", *steps),
    )
    title = "Detection: likelihood ratio tests against their alarm level"
    return View("likelihood", title, panels, closeup=True)


def _candidates_view(surface_names: Names, estimator_names: Names) -> View:
    """One panel of bars: a surface has a bar from the alarm until all of its estimators are excluded.

    An estimator belongs to the surface with the longest name that its own name begins with.
    """
    roles = dict(zip(surface_names, SURFACE_ROLES * len(surface_names), strict=False))
    traces = [
        (f"fie_{name}_excluded", without_underscores(surface), roles[surface])
        for surface in surface_names
        for name in estimator_names
        if surface
        == max((other for other in surface_names if f"{name}_".startswith(f"{other}_")), key=len, default="")
    ]
    bars = panel_of("surfaces that may be at fault", *traces, bars=True, bars_during_column="detected")
    panels = (bars,) if traces else ()
    title = "Candidates: a bar from the alarm until the surface is excluded"
    return View("candidates", title, panels, text_without_data="no alarm: no candidates", closeup=True)


def _isolation_view(names: Names) -> View:
    """A panel for each isolation estimator and axis. names: of the estimators."""
    panels = tuple(
        isolation_panel(name, axis, f"{without_underscores(name)} estimator: {axis}", "threshold")
        for name in names
        for axis in AXES
    )
    title = "Isolation: residuals of each isolation estimator against its thresholds"
    return View(
        "isolation",
        title,
        panels,
        n_panel_columns=3,
        text_without_data="no alarm: it never ran",
        closeup=True,
        folded=True,
    )


def _ratio_view(names: Names) -> View:
    """A panel for the detection estimator and for each isolation estimator. names: of the latter."""
    stems = [
        ("detection estimator", ""),
        *((f"{without_underscores(name)} estimator", f"fie_{name}_") for name in names),
    ]
    panels = tuple(
        ratio_panel(
            f"{label}: |residual| / threshold",
            *((f"{stem}{axis}{RATIO_ENDING}", axis, axis) for axis in AXES),
        )
        for label, stem in stems
    )
    title = "Residual over threshold: above 1 is an alarm, or an exclusion"
    return View("ratio", title, panels, n_panel_columns=1 if len(panels) <= 4 else 3)


def _effectiveness_view(names: Names) -> View:
    """Estimated and used effectiveness of the surfaces, two panels for each kind."""
    panels = tuple(
        panel_of(
            f"{kind}: {label}" if kind else label,
            *((f"{name}_effectiveness_{which}", called, role) for name, called, role in group),
            limits=(-0.05, 1.1),
        )
        for kind, group in _labels_and_roles_by_kind(names).items()
        for which, label in (("estimate", "estimated (1 healthy)"), ("used", "used by the law"))
    )
    title = "Effectiveness of each surface: estimated by the diagnosis, and used by the law (rate-limited)"
    return View("effectiveness", title, panels, n_panel_columns=1 if len(panels) <= 2 else 2)


_SUPERVISOR = View(
    "supervisor",
    "Supervisor: mode, alarm, envelope",
    (
        panel_of("mode", ("mode", "mode", "actual"), value_names=MODES),
        panel_of("alarm", ("detected", "alarm", "actual"), value_names=("quiet", "alarm")),
        panel_of("envelope", ("envelope_valid", "envelope", "actual"), value_names=("outside", "inside")),
    ),
)


def _panels_of_columns(*columns: tuple[str, str]) -> tuple[Panel, ...]:
    """A panel for each column, under its name."""
    return tuple(panel_of(label, (column, label, "actual")) for column, label in columns)


_ENGINE = View(
    "engine",
    "Engine power on pitch, when elevator and flap are lost",
    _panels_of_columns(
        ("manifold_pressure_inhg", "manifold pressure"), ("dpt", "slipstream dpt"),
        ("airspeed_mps", "airspeed"), ("theta_rad", "pitch θ"),
    ),
)  # fmt: skip
_STATES = View(
    "states",
    "The twelve states",
    _panels_of_columns(
        ("airspeed_mps", "airspeed"), ("alpha_rad", "angle of attack"), ("beta_rad", "sideslip"),
        ("p_rad_s", "roll rate p"), ("q_rad_s", "pitch rate q"), ("r_rad_s", "yaw rate r"),
        ("phi_rad", "bank φ"), ("theta_rad", "pitch θ"), ("psi_rad", "heading ψ"),
        ("north_m", "north"), ("east_m", "east"), ("altitude_m", "altitude"),
    ),
    n_panel_columns=3,
)  # fmt: skip
