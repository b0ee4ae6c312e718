"""The aerodynamics: six body-axis coefficients about a reference point, each a sum of terms from the tables.

Angles of tables in deg, deflections in rad. A term that is zero, or equal to one that is there, is not looked
up. Undamaged, tables go on in straight lines beyond their ends; in damage those of the rates hold them.

Signs: elevator, aileron, flap and stabiliser trailing edge down, rudder trailing edge left, spoiler up.
"""

from math import radians

import numpy as np

from beaver_ftc_aircraft.gtm.database import Database, Table
from beaver_ftc_aircraft.gtm.elements import (
    FAR_ALPHA_DEG,
    FAR_BETA_DEG,
    FAR_HAT,
    declared,
    do,
    extended,
    function,
    piecewise,
    read,
    table,
    unless_zero,
)
from beaver_ftc_aircraft.gtm.parameters import DAMAGE_CASE, GEAR, OUTPUTS, parameters, surfaces
from beaver_ftc_aircraft.gtm.systems import engine_functions

ALPHA, BETA, MIRRORED = "aero/alpha-deg", "aero/beta-deg", "aero/beta-mirrored-deg"
# A left surface acts as the right one does at the opposite sideslip, with these signs of CX CY CZ Cl Cm Cn.
MIRROR = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
LONGITUDINAL, LATERAL = ("CX", "CZ", "Cm"), ("CY", "Cl", "Cn")
_DAMAGED = do("gt", read(DAMAGE_CASE), 0.0)
_CASES = np.arange(1.0, 7.0)


def effective(surface: str) -> str:
    """The deflection that acts."""
    return f"fcs/{surface}-effective-rad"


class _Terms:
    """The functions so far, and what each coefficient is the sum of."""

    def __init__(self) -> None:
        self.functions: list[str] = []
        self.of: dict[str, list[str]] = {output: [] for output in OUTPUTS}

    def add(self, output: str, of: str, says: str, body: str) -> None:
        """A term of a coefficient."""
        name = f"aero/coefficient/{output}_{of}"
        self.functions.append(function(name, says, body))
        self.of[output].append(read(name))

    def helper(self, name: str, says: str, body: str) -> str:
        """A function that terms read; returns its name."""
        self.functions.append(function(name, says, body))
        return name


def aerodynamics(base: Database) -> str:
    """The element of the model."""
    terms = _Terms()
    _flow(terms, base["C6_bas"])
    _static(terms, base)
    _elevator(terms, base["dC3_ele"])
    _ailerons(terms, base["dC6_ail"])
    _rudder(terms, base["dC6_rud"])
    _spoilers(terms, base["dC6_spo"])
    _flaps(terms, base)
    _rates(terms, base)
    alpha3 = do("product", read("failures/unanticipated/Cm-alpha3"), *[read("aero/alpha-rad")] * 3)
    terms.add("Cm", "unanticipated", "The unanticipated fault: extra pitching moment on alpha cubed", alpha3)
    for output, parts in terms.of.items():
        name = f"aero/coefficient/{output}"
        terms.functions.append(function(name, f"Sum of the {output} terms", do("sum", *parts)))
    properties = declared("failures/unanticipated/Cm-alpha3")
    return f"<aerodynamics>{properties}{engine_functions()}{''.join(terms.functions)}{_axes()}</aerodynamics>"


def _axes() -> str:
    """Forces in lbf along the body axes; moments in lbf ft about the reference point of the metrics."""
    found = []
    for axis, output, length, unit in (
        ("X", "CX", "", "force/X-lbs"), ("Y", "CY", "", "force/Y-lbs"), ("Z", "CZ", "", "force/Z-lbs"),
        ("ROLL", "Cl", "metrics/bw-ft", "moment/L-lbsft"),
        ("PITCH", "Cm", "metrics/cbarw-ft", "moment/M-lbsft"),
        ("YAW", "Cn", "metrics/bw-ft", "moment/N-lbsft"),
    ):  # fmt: skip
        factors = [
            "aero/qbar-psf",
            "metrics/Sw-sqft",
            *([length] if length else []),
            f"aero/coefficient/{output}",
        ]
        body = function(f"aero/{unit}", f"From {output}", do("product", *map(read, factors)))
        found.append(f'<axis name="{axis}">{body}</axis>')
    return "".join(found)


def _flow(terms: _Terms, static: Table) -> None:
    """Sideslip mirrored; airspeed as the rates' tables have it; whether the static table goes so far."""
    ends = *static.axes["alpha"][[0, -1]], static.axes["beta"][-1]
    of = parameters()["rates"]
    terms.helper(MIRRORED, "Sideslip as the left half of the wing has it", do("product", -1.0, read(BETA)))
    knots = do("product", read("velocities/vt-fps"), of["knots_per_ft_s"])
    within = do("min", of["most_knots"], do("max", of["least_knots"], knots))
    says = (
        "Airspeed in the dimensionless rates, ft/s: knots made of ft/s and back with the source's own factors"
    )
    terms.helper("aero/airspeed-of-rates-fps", says, do("product", within, of["ft_s_per_knot"]))
    inside = (
        do("ge", read(ALPHA), ends[0]), do("le", read(ALPHA), ends[1]),
        do("le", do("abs", read(BETA)), ends[2]),
    )  # fmt: skip
    terms.helper("aero/envelope-valid", "1 inside the static tables", do("and", *inside))


def _along_angles(of: Table, i: int) -> tuple[np.ndarray, ...]:
    """Output i of a table of alpha and beta, to where these angles end, with both grids."""
    data, alphas = extended(of.data[..., i], of.axes["alpha"], FAR_ALPHA_DEG, 0)
    data, betas = extended(data, of.axes["beta"], FAR_BETA_DEG, 1)
    return data, alphas, betas


def _static(terms: _Terms, base: Database) -> None:
    """The whole aircraft; what damage adds (held at its ends); the gear."""
    damaged, gear = base["dC6_damage.bas"], base["dC3_lgr"]
    for i, output in enumerate(OUTPUTS):
        data, alphas, betas = _along_angles(base["C6_bas"], i)
        neutral = table(data, [(ALPHA, alphas), (BETA, betas)])
        terms.add(output, "airframe", "Static, controls neutral", neutral)
        keys = [(ALPHA, damaged.axes["alpha"]), (BETA, damaged.axes["beta"]), (DAMAGE_CASE, _CASES)]
        added = table(damaged.data[..., i], keys)
        terms.add(output, "damage", "What damage adds", unless_zero(DAMAGE_CASE, added))
    for i, output in enumerate(LONGITUDINAL):
        data, alphas = extended(gear.data[:, 1, i], gear.axes["alpha"], FAR_ALPHA_DEG, 0)
        down = unless_zero(GEAR, table(data, [(ALPHA, alphas)]))
        terms.add(output, "gear", "Landing gear that is not up", down)


def _between(tables: dict[str, str], surface: str, grid: list[float], is_first: bool) -> str:
    """Straight lines over a surface's deflection between tables by name, an empty one at neutral. Where a
    table is read first, it stands itself."""
    body = piecewise(effective(surface), grid, [read(name) if of else "" for name, of in tables.items()])
    for name, of in tables.items() if is_first else ():
        body = body.replace(read(name), of, 1)
    return body


def _elevator(terms: _Terms, of: Table) -> None:
    """Stabiliser, and four segments that each act by a quarter of a whole elevator's increment at the
    stabiliser's angle, with arms in spans for roll and yaw."""
    elev, stab = of.axes["elev"], np.radians(of.axes["stab"])
    neutral = int(np.flatnonzero(elev == 0.0)[0])
    grid = [radians(point) for point in elev]
    segments = surfaces("elevator")
    for i, output in enumerate(LONGITUDINAL):
        data, alphas, betas = _along_angles(of, i)
        alone = data[..., neutral]
        stabiliser = table(alone, [(ALPHA, alphas), (BETA, betas), (effective("stabiliser"), stab)])
        terms.add(output, "stabiliser", "Stabiliser", unless_zero(effective("stabiliser"), stabiliser))
        stands = [(ALPHA, alphas), (BETA, betas), ("fcs/stabiliser-stands-rad", stab)]
        tables = {}
        for j, point in enumerate(elev):
            name = f"aero/elevator/{output}-at-{'up' if point < 0 else 'down'}-{abs(point):.0f}-deg"
            tables[name] = "" if j == neutral else table(data[..., j] - alone, stands, name)
        before: list[str] = []
        for surface in segments:
            body = _between(tables, surface, grid, not before)
            for other in before:
                same = do("eq", read(effective(surface)), read(effective(other)))
                body = do("ifthen", same, read(f"aero/elevator/{output}-of-{other}"), body)
            says = f"{output} of a whole elevator that stands as this segment"
            terms.helper(f"aero/elevator/{output}-of-{surface}", says, unless_zero(effective(surface), body))
            before.append(surface)
    for output, source, sign in (
        *((output, output, 0) for output in LONGITUDINAL),
        ("Cl", "CZ", 1),
        ("Cn", "CX", -1),
    ):
        parts = [
            do(
                "product",
                sign * of["arm"] if sign else 1.0,
                read(f"aero/elevator/{source}-of-{surface}"),
            )
            for surface, of in segments.items()
        ]
        terms.add(output, "elevator", "Four segments", do("product", 0.25, do("sum", *parts)))


def _ailerons(terms: _Terms, of: Table) -> None:
    """Each by itself, from the table of the right one."""
    far = 90.0
    for surface, about in surfaces("aileron").items():
        left = about["side"] == "left"
        for i, output in enumerate(OUTPUTS):
            data, alphas, betas = _along_angles(of, i)
            data, deflections = extended(data, of.axes["ail"], far, 2)
            keys = [(ALPHA, alphas), (MIRRORED if left else BETA, betas)]
            found = table(
                data * (MIRROR[i] if left else 1.0), [*keys, (effective(surface), np.radians(deflections))]
            )
            terms.add(
                output,
                surface,
                f"{surface.replace('_', ' ').capitalize()}",
                unless_zero(effective(surface), found),
            )


def _rudder(terms: _Terms, of: Table) -> None:
    """Both halves from the table of negative deflections, mirrored for positive ones; each by its shares."""
    upper, lower = surfaces("rudder")
    for surface in (upper, lower):
        positive = do("ge", read(effective(surface)), 0.0)
        sign = do("ifthen", positive, -1.0, 1.0)
        terms.helper(f"aero/{surface}/sign", "-1 where the table is mirrored", sign)
        for name, of_it in (("beta-deg", BETA), ("mirrored-rad", effective(surface))):
            body = do("product", read(f"aero/{surface}/sign"), read(of_it))
            terms.helper(f"aero/{surface}/{name}", "What its table is read at", body)
    for i, output in enumerate(OUTPUTS):
        data, alphas, betas = _along_angles(of, i)
        data, deflections = extended(data, of.axes["rud"], 90.0, 2)
        data, deflections = data[..., :-1], deflections[:-1]  # never beyond neutral
        for surface in (upper, lower):
            keys = [(ALPHA, alphas), (f"aero/{surface}/beta-deg", betas)]
            found = table(data, [*keys, (f"aero/{surface}/mirrored-rad", np.radians(deflections))])
            if MIRROR[i] < 0.0:
                found = do("product", read(f"aero/{surface}/sign"), found)
            if surface == lower:
                same = do("eq", read(effective(lower)), read(effective(upper)))
                found = do("ifthen", same, read(f"aero/rudder/{output}-of-{upper}"), found)
            says = f"{output} of a whole rudder that stands as this half"
            terms.helper(f"aero/rudder/{output}-of-{surface}", says, unless_zero(effective(surface), found))
        shares = [
            do("product", about["share"][i], read(f"aero/rudder/{output}-of-{surface}"))
            for surface, about in surfaces("rudder").items()
        ]
        terms.add(output, "rudder", "Upper and lower half", do("sum", *shares))


def _spoilers(terms: _Terms, of: Table) -> None:
    """Two a side, from the table of the right one; a share of what both would do that stand so."""
    grid = [radians(point) for point in of.axes["spo"]]
    for side, beta in (("left", MIRRORED), ("right", BETA)):
        these = {name: about for name, about in surfaces("spoiler").items() if about["side"] == side}
        for i, output in enumerate(OUTPUTS):
            data, alphas, betas = _along_angles(of, i)
            data = data * (MIRROR[i] if side == "left" else 1.0)
            tables = {}
            for j, point in enumerate(of.axes["spo"]):
                name = f"aero/spoiler/{side}-{output}-at-{point:.0f}-deg"
                tables[name] = table(data[..., j], [(ALPHA, alphas), (beta, betas)], name) if j else ""
            parts: list[str] = []
            for surface, about in these.items():
                body = _between(tables, surface, grid, not parts)
                body = do("product", about["share"][i], body)
                parts.append(unless_zero(effective(surface), body))
            says = f"{side.capitalize()} spoilers, inboard and outboard"
            terms.add(output, f"{side}_spoilers", says, do("sum", *parts))


def _flaps(terms: _Terms, base: Database) -> None:
    """Proportional to deflection, each by itself."""
    per_rad = {name: np.degrees(base.flaps[of["table"]]) for name, of in surfaces("flap").items()}
    for i, output in enumerate(OUTPUTS):
        parts = [
            do("product", of[i], read(effective(surface))) for surface, of in per_rad.items() if of[i] != 0.0
        ]
        terms.add(output, "flaps", "Four flaps", do("sum", *parts))


_RATES = (
    ("p", "dC3_p", "phat", LATERAL, "metrics/bw-ft"),
    ("q", "dC3_q", "qhat", LONGITUDINAL, "metrics/cbarw-ft"),
    ("r", "dC3_r", "rhat", LATERAL, "metrics/bw-ft"),
)


def _rates(terms: _Terms, base: Database) -> None:
    """Rotation about the velocity vector, and the oscillatory rest. In damage: no such split, the whole of p,
    q and r, tables held at their ends, scaled by case, and a side force by case."""
    _split(terms)
    rotary, scale, added = base["dC6_w"], base["dC6_damage.ddscale"], base["dC6_damage.ddinc"]
    for i, output in enumerate(OUTPUTS):
        data, alphas = extended(rotary.data[..., i], rotary.axes["alpha"], FAR_ALPHA_DEG, 0)
        data, betas = extended(data, rotary.axes["beta"], FAR_BETA_DEG, 2)
        keys = [(ALPHA, alphas), (BETA, betas), ("aero/rates/rotation-hat", rotary.axes["what"])]
        found = unless_zero("aero/rates/rotation-rad_sec", table(np.swapaxes(data, 1, 2), keys))
        terms.add(output, "rotation", "Steady rotation about the velocity vector", found)
    for k, (rate, name, hat, outputs, _) in enumerate(_RATES):
        of = base[name]
        grids = of.axes["alpha"], of.axes[hat]
        at_alpha = _held(terms, rate, "alpha-deg", ALPHA, grids[0])
        at_hat = _held(terms, rate, "hat", f"aero/{rate}-hat", grids[1])
        for i, output in enumerate(outputs):
            data, alphas = extended(of.data[..., i], grids[0], FAR_ALPHA_DEG, 0)
            data, hats = extended(data, grids[1], FAR_HAT, 1)
            found = table(data, [(at_alpha, alphas), (at_hat, hats)])
            scaled = table(
                scale.data[:, :, k, OUTPUTS.index(output)],
                [(ALPHA, scale.axes["alpha"]), (DAMAGE_CASE, _CASES)],
            )
            body = do("product", found, do("ifthen", _DAMAGED, scaled, 1.0))
            terms.add(output, rate, f"Oscillatory part of {rate}", body)
    parts: list[str] = []
    for k, (rate, *_) in enumerate(_RATES):
        data, alphas = extended(
            added.data[:, :, k, OUTPUTS.index("CY")], added.axes["alpha"], FAR_ALPHA_DEG, 0
        )
        parts.append(
            do("product", table(data, [(ALPHA, alphas), (DAMAGE_CASE, _CASES)]), read(f"aero/{rate}-hat"))
        )
    terms.add(
        "CY",
        "rates_in_damage",
        "Side force of the rates in damage",
        unless_zero(DAMAGE_CASE, do("sum", *parts)),
    )


def _held(terms: _Terms, rate: str, what: str, key: str, grid: np.ndarray) -> str:
    """A key of a table, in damage within the table's ends."""
    inside = do("min", grid[-1], do("max", grid[0], read(key)))
    return terms.helper(
        f"aero/rates/{rate}-at-{what}", f"{key}, in damage held", do("ifthen", _DAMAGED, inside, read(key))
    )


def _split(terms: _Terms) -> None:
    """p, q, r as a rotation about the velocity vector and a rest: of two candidates that leave the third rate
    its sign and no more than its size, the second goes first; none if there is none."""
    p, q, r = (read(f"velocities/{axis}-aero-rad_sec") for axis in "pqr")
    cos_alpha, sin_alpha = do("cos", read("aero/alpha-rad")), do("sin", read("aero/alpha-rad"))
    cos_beta, sin_beta = do("cos", read("aero/beta-rad")), do("sin", read("aero/beta-rad"))
    along_x = read(
        terms.helper(
            "aero/rates/along-x", "Velocity's direction, forward", do("product", cos_alpha, cos_beta)
        )
    )
    along_z = read(
        terms.helper("aero/rates/along-z", "Velocity's direction, down", do("product", sin_alpha, cos_beta))
    )

    def rest(which: str, rate: str, along: str, other: str, along_other: str) -> str:
        """What the other rate keeps if this one is all rotation; beyond any if that cannot be."""
        kept = do("difference", other, do("product", do("quotient", rate, along), along_other))
        there = do("and", do("nq", rate, 0.0), do("nq", along, 0.0))
        return read(
            terms.helper(
                f"aero/rates/left-of-{which}",
                f"{which} beside a rotation",
                do("ifthen", there, kept, 1e30),
            )
        )

    def allowed(left: str, of: str) -> str:
        return do("and", do("le", do("abs", left), do("abs", of)), do("ge", do("product", left, of), 0.0))

    left_of_r = rest("r", p, along_x, r, along_z)
    left_of_p = rest("p", r, along_z, p, along_x)
    by_p = do("ifthen", allowed(left_of_r, r), do("quotient", p, along_x), 0.0)
    by_r = do("ifthen", allowed(left_of_p, p), do("quotient", r, along_z), by_p)
    omega = read(
        terms.helper(
            "aero/rates/rotation-rad_sec",
            "Rotation about the velocity vector",
            do("ifthen", _DAMAGED, 0.0, by_r),
        )
    )
    speed2 = do("product", 2.0, read("aero/airspeed-of-rates-fps"))
    per = {axis: do("quotient", read(length), speed2) for axis, *_, length in _RATES}
    terms.helper("aero/rates/rotation-hat", "Rotation times b/2V", do("product", omega, per["p"]))
    for axis, rate, along in (("p", p, along_x), ("q", q, sin_beta), ("r", r, along_z)):
        rest_of = do("difference", rate, do("product", omega, along))
        terms.helper(
            f"aero/{axis}-hat", f"The rest of {axis}, dimensionless", do("product", rest_of, per[axis])
        )
