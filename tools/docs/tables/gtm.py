"""Tables and pictures of the GTM: the converted model beside its specification, `BEAVER_FTC_GTM`."""

import os
import tempfile
from functools import cache
from math import radians
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from beaver_ftc.studies.present.page import Table
from beaver_ftc_aircraft.gtm.steady import Bench, Condition, Steady
from tools.docs.tables import aside, picture, shared
from tools.gtm import flights, manoeuvres, modes
from tools.gtm.flights import ADAMS_BASHFORTH, FINE_S, MOTION
from tools.gtm.specification import SURFACES, Specification, axes_of

SPEEDS_KT = (46, 55, 65, 75, 85, 95, 105, 115, 130)
ALPHAS_DEG = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16)
BETWEEN_DEG = (3.0, 5.0, 7.0, 8.5, 9.5, 10.5, 11.5)
DRAWN = 500
TITLES = {  # of the tables beside the page
    "checks": "Coefficients, mass, atmosphere, trim and modes: largest differences",
    "spiral": "A steady steep spiral, in JSBSim and as published",
    "flights": "Eight flights: largest differences, % of the span of the signal",
}
_SHOWN = (
    ("airspeed V, m/s", None, 0.3048),
    ("roll rate p, deg/s", 3, 57.2958),
    ("pitch rate q, deg/s", 4, 57.2958),
    ("yaw rate r, deg/s", 5, 57.2958),
)


def _where() -> Path:
    return Path(os.environ["BEAVER_FTC_GTM"])


@cache
def _bench() -> Bench:
    return flights.bench(_where(), Path(tempfile.mkdtemp(prefix="beaver-ftc-")))


@cache
def _specifications() -> tuple[Specification, Specification]:
    """With the source's gravity, and with JSBSim's."""
    source = Specification(_where())
    return source, Specification(_where(), flights.gravity_of(_bench(), source))


@cache
def _steady(heavy: bool) -> Steady:
    wanted = Condition(alpha_deg=3.0)
    return flights.specified_trim(_specifications()[heavy], wanted, _bench().steady(wanted))


@shared
def _flown() -> dict[str, tuple[np.ndarray, ...]]:
    """Of each manoeuvre: the specification with JSBSim's gravity and with the source's, JSBSim at 1 kHz and
    at 200 Hz as it comes."""
    found = {}
    for k in range(8):
        mine, source = (_manoeuvre(k, heavy) for heavy in (True, False))
        of, spec = _specifications(), mine.by_specification
        rows = spec(of[1]), source.by_specification(of[0])
        found[mine.name] = (
            *rows,
            mine.by_jsbsim(_bench(), FINE_S, ADAMS_BASHFORTH),
            mine.by_jsbsim(_bench()),
        )
    return found


def _manoeuvre(k: int, heavy: bool) -> flights.Manoeuvre:
    if k == 0:
        return manoeuvres.doublets(_steady(heavy))
    return manoeuvres.spin(_specifications()[1]) if k == 1 else manoeuvres.damaged(_steady(heavy), k - 1)


def gtm_flights() -> str:
    """Largest differences of u v w p q r, as shares of each signal's span, and the picture."""
    rows = []
    for name, (mine, source, fine, usual) in _flown().items():
        differ = [100.0 * flights.largest(mine, other)[MOTION].max() for other in (fine, usual, source)]
        rows.append([name, *(f"{share:.2f}" for share in differ)])
    head = ("flight", "integrator 1 kHz, %", "integrator 200 Hz, %", "gravity, %")
    alt = "Airspeed and body rates of eight flights: specification and JSBSim at 1 kHz"
    table = aside("gtm-flights", TITLES["flights"], Table(head, rows))
    return f"{table}\n\n{picture('gtm-flights.png', alt, _drawn(), dpi=110)}"


def _drawn() -> Figure:
    """A row a flight: the specification as a broad line, JSBSim at 1 kHz as a thin one in it."""
    flown = _flown()
    figure, axes = plt.subplots(len(flown), len(_SHOWN), figsize=(11, 1.45 * len(flown)), sharex="row")
    for row, (name, (mine, _, fine, _)) in zip(axes, flown.items(), strict=True):
        t = 0.005 * np.arange(len(mine))
        for axis, (_, column, factor) in zip(row, _SHOWN, strict=True):
            for of, style in (
                (mine, {"lw": 3.2, "color": "#9ec9e8", "label": "specification"}),
                (fine, {"lw": 0.9, "color": "#10304d", "label": "JSBSim at 1 kHz"}),
            ):
                values = np.linalg.norm(of[:, :3], axis=1) if column is None else of[:, column]
                axis.plot(t, factor * values, **style)
            if name in flights.CASES:
                axis.axvline(flights.Manoeuvre.onset_s, color="#d55e00", lw=1.0, ls="--", label="damage")
            axis.tick_params(labelsize=7)
            axis.grid(alpha=0.3)
        row[0].set_ylabel(name.replace("-flap-off", "-\nflap-off"), fontsize=7)
    for axis, (says, *_) in zip(axes[0], _SHOWN, strict=True):
        axis.set_title(says, fontsize=9)
    for axis in axes[-1]:
        axis.set_xlabel("time, s", fontsize=8)
    figure.legend(
        *axes[-1, 0].get_legend_handles_labels(), loc="upper center", ncols=3, fontsize=9, frameon=False
    )
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.98))
    return figure


def gtm_checks() -> str:
    """Coefficients, mass properties, trim and modes: the largest differences."""
    given, drawn = _points()
    speed = _trims([Condition(eas_kt=float(v)) for v in SPEEDS_KT])
    alpha = _trims([Condition(alpha_deg=float(a)) for a in ALPHAS_DEG])
    frequency, damping = _modes()
    rows = [
        ("coefficients at the 60 points of the source", f"{given:.1e}", "share of the span"),
        (f"coefficients at {DRAWN} drawn points", f"{drawn:.1e}", "share of the span"),
        ("mass, inertia, centre of gravity", f"{_masses():.1e}", "share"),
        ("pressure and density at 800 ft", f"{_air():.1e}", "share"),
        (f"surfaces in trim at {len(SPEEDS_KT)} airspeeds", f"{speed:.3f}", "deg"),
        (f"surfaces in trim at {len(ALPHAS_DEG)} angles of attack", f"{alpha:.3f}", "deg"),
        ("frequency of the modes", f"{frequency:.1e}", "share"),
        ("damping of the modes", f"{damping:.1e}", "1"),
    ]
    table = Table(("quantity", "largest difference", "unit"), rows)
    return aside("gtm-checks", TITLES["checks"], table)


def _air() -> float:
    _bench().place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    found = np.array([_bench().fdm[f"atmosphere/{name}"] for name in ("P-psf", "rho-slugs_ft3")])
    return float(np.abs(found / _specifications()[0].air(800.0) - 1.0).max())


def _points() -> tuple[float, float]:
    """Largest differences at the given points and at drawn ones, of the span over the given ones."""
    given, found = flights.at_the_given_points(_bench(), _where())
    span, rng, worst = np.ptp(given, axis=0), np.random.default_rng(1), 0.0
    for k in range(DRAWN):
        deg = {name: float(rng.choice([0.0, rng.uniform(-35, 35)])) for name in SURFACES}
        deg["STAB"] = rng.uniform(-12, 4)
        alpha, beta = radians(rng.uniform(-15, 95)), radians(rng.uniform(-60, 60))
        state = alpha, beta, rng.uniform(70, 230), rng.normal(0, [1.5, 0.7, 0.7]), deg, k % 7
        off = flights.coefficients(_bench(), *state) - _specifications()[0].coefficients(*state)
        worst = max(worst, float((np.abs(off) / span).max()))
    return float((np.abs(found - given) / span).max()), worst


def _masses() -> float:
    """The largest relative difference of weight, centre of gravity and inertia, over all cases."""
    off = []
    for case in range(7):
        weight, cg, inertia = _specifications()[0].mass(case)
        found = flights.masses(_bench(), case)[[0, 1, 3, 4, 5, 6, 8]]
        wanted = np.array([weight, cg[0], cg[2], *np.diag(inertia), inertia[0, 2]])
        off.append(np.abs(np.abs(found / wanted) - 1.0).max())
    return max(off)


def _trims(wanted: list[Condition]) -> float:
    """Largest difference of a surface in these flights."""
    pairs = ((here := _bench().steady(each), _specified(each, here)) for each in wanted)
    names = ("elevator_deg", "aileron_deg", "rudder_deg")
    return max(abs(getattr(a, name) - getattr(b, name)) for a, b in pairs for name in names)


def _specified(wanted: Condition, here: Steady) -> Steady:
    return flights.specified_trim(_specifications()[1], wanted, here)


def _modes() -> tuple[float, float]:
    """The largest relative difference of a frequency, and that of a damping ratio."""
    frequency = damping = 0.0
    for alpha_deg in BETWEEN_DEG:
        here = _bench().steady(Condition(alpha_deg=alpha_deg))
        there = _specified(Condition(alpha_deg=alpha_deg), here)
        found = modes.modes(modes.linear_jsbsim(_bench(), here))
        wanted = modes.modes(modes.linear_specified(_specifications()[1], there))
        for name, (omega, zeta) in wanted.items():
            frequency = max(frequency, abs(found[name][0] / omega - 1.0))
            damping = max(damping, abs(found[name][1] - zeta))
    return frequency, damping


# A steep spiral in equilibrium, elevators at -30 deg, other surfaces at 0, no thrust [Cunis2018]; m/s, deg,
# deg/s.
SPIRAL = {
    "airspeed": ("m/s", 43.32), "angle of attack": ("deg", 20.05), "sideslip": ("deg", -7.55),
    "roll rate": ("deg/s", -122.9), "pitch rate": ("deg/s", 49.1), "yaw rate": ("deg/s", -45.4),
    "bank angle": ("deg", -47.3), "pitch attitude": ("deg", -61.5),
}  # fmt: skip
_SETTLED = slice(2000, 2400)  # of 12 s at 5 ms: the height is that of the sea there


def gtm_spiral() -> str:
    """A steady steep spiral of NASA's simulation: JSBSim, which starts there at 1500 ft, and as published."""
    V, *angles = (value for _, value in SPIRAL.values())
    alpha, beta, p, q, r, phi, theta = map(radians, angles)
    along = V / 0.3048 * axes_of(alpha, beta)
    start = np.array([*along, p, q, r, phi, theta, 0.0, 1500.0])
    held = flights.of_commands(-30.0, 0.0, 0.0, 0.0)
    rows = flights.Manoeuvre("spiral", start, lambda t: held, 12.0).by_jsbsim(_bench())[_SETTLED]
    u, v, w = rows[:, :3].T
    size = np.sqrt(u * u + v * v + w * w)
    found = [size * 0.3048, *np.degrees([np.arctan2(w, u), np.arcsin(v / size), *rows[:, 3:8].T])]
    table = Table(
        ("quantity", "unit", "JSBSim", "published", "difference"),
        [
            (name, unit, f"{of.mean():.2f}", f"{given}", f"{of.mean() - given:.2f}")
            for (name, (unit, given)), of in zip(SPIRAL.items(), found, strict=True)
        ],
    )
    return aside("gtm-spiral", TITLES["spiral"], table)
