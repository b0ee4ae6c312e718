"""`aircraft.yaml` as frozen, strict sections.

A term of a coefficient is its value times powers of dimensionless signals and, where it has a surface,
that surface's deflection in rad. Signals: alpha and beta in rad, ph = p b/2V, qh = q c/V (full chord), rh
= r b/2V, and those the file declares.

The section `channels` says which output of an autopilot moves which surface. An output is a pulse of
`pwm_us`, or what an autopilot that knows no pulses says of it, -1 to 1. Its share of full travel is

    x = (pulse - trim) / (upper end - trim) above the trim, (pulse - trim) / (trim - lower end) below it

and a surface goes the sum of its outputs' `share` x towards its upper stop, or its lower one: several
outputs on one surface are a mix (elevons, a V-tail, flaperons).
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from beaver_ftc.documents.document import Conflict, Flag, Number, Section, Whole, entry, number, refuse
from beaver_ftc.documents.errors import suggestion

MOST_CHANNELS = 32  # of the longest packet there is
PWM_US = (1000.0, 2000.0)

_Pulse = Annotated[Number, Field(ge=500, le=2500)]


def _in_order(given: tuple[float, float]) -> tuple[float, float]:
    if not given[0] < given[1]:
        refuse([((), "ends out of order, allowed: [lower, upper]")])
    return given


def _not_nothing(share: float) -> float:
    if share == 0.0:
        refuse([((), "0 moves nothing, allowed: -1 to 1 without 0")])
    return share


class OutputSection(Section):
    """One output of an autopilot that moves a surface or the engine.

    channel: number of the output, counted from 1
    share: deflection at full output, divided by the travel. Negative: towards the lower stop
    reversed: true: a longer pulse gives a smaller output
    pwm_us: shortest and longest pulse, us
    trim_us: pulse of 0 deg or closed throttle; left out: the middle of `pwm_us`, or its lower end for a
    throttle, us
    """

    channel: Whole = Field(ge=1, le=MOST_CHANNELS, examples=[1])
    share: Annotated[Number, Field(ge=-1, le=1), AfterValidator(_not_nothing)] = number(
        1.0, "1", examples=[-1]
    )
    reversed: Flag = False
    pwm_us: Annotated[tuple[_Pulse, _Pulse], AfterValidator(_in_order)] = number(
        PWM_US, "us", examples=[[1100, 1900]]
    )
    trim_us: _Pulse | None = number(None, "us", examples=[1500])

    @model_validator(mode="after")
    def _trim_is_in_range(self) -> Self:
        low, high = self.pwm_us
        if self.trim_us is not None and not low <= self.trim_us <= high:
            refuse([(("trim_us",), f"is out of range, allowed: {low:g} to {high:g}, as pwm_us says")])
        return self


class ChannelsSection(Section):
    """The outputs of an autopilot. A surface that is not listed stays at trim.

    surfaces: the outputs of each surface
    throttle: the output of the engine
    """

    surfaces: dict[str, Annotated[tuple[OutputSection, ...], Field(min_length=1, max_length=8)]]
    throttle: OutputSection | None = None


MAX_SURFACES, MAX_SIGNALS, MAX_DAMAGE = 20, 6, 50
MAX_TERMS_OF_ONE, MAX_MONOMIALS = 64, 64
MAX_TERMS = 3 * MAX_TERMS_OF_ONE
MAX_BOXES, MAX_LEVELS, MAX_AGES = 20, 6, 4  # of the map of the model's error
MAX_EFFECTORS = 8
MAX_LEVERS = 1 + MAX_EFFECTORS  # that of all engines first
MAX_THRUST = 8  # airspeeds and settings of the table of thrust
FLOW_SIGNALS = ("alpha", "beta", "ph", "qh", "rh")
RATE_SIGNALS = ("ph", "qh", "rh")
SIDESLIP_RATE = "betadoth"  # betadot b/2V: known to linear analysis, to no instrument
NAME_PATTERN = r"^[A-Za-z][A-Za-z0-9_-]*$"
PROPERTY_PATTERN = r"^[A-Za-z_][A-Za-z0-9_./\[\]-]*$"
FILE_PATTERN = r"^[A-Za-z0-9_-][A-Za-z0-9_.-]*\.xml$"

Name = Annotated[str, Field(pattern=NAME_PATTERN, max_length=60)]
# Properties of JSBSim that write a file whenever they are set; the second where the model's name says.
WRITING_PROPERTIES = ("simulation/write-state-file", "simulation/do_linearization")
Text = Annotated[str, Field(max_length=2000)]
Power = Annotated[Whole, Field(ge=1, le=9)]


def writing_property(text: str) -> str:
    """The property of JSBSim that writes a file and is named in a text; empty if none is."""
    return next((name for name in WRITING_PROPERTIES if name.rpartition("/")[2] in text), "")


def _only_data(name: str) -> str:
    if writing_property(name):
        refuse([((), "makes JSBSim write a file, allowed: other properties")])
    return name


Property = Annotated[str, Field(pattern=PROPERTY_PATTERN, max_length=200), AfterValidator(_only_data)]


def _not_reversed(given: tuple[float, float]) -> tuple[float, float]:
    if given[0] > given[1]:
        refuse([((), "ends out of order, allowed: [lower, upper]")])
    return given


NotNegative = Annotated[Number, Field(ge=0)]
Interval = Annotated[
    tuple[Number, Number], AfterValidator(_in_order), Field(json_schema_extra={"range": "rising"})
]
_Stop = Annotated[Number, Field(ge=-3.2, le=3.2)]  # rad: no surface turns further, a stop in degrees does
Stops = Annotated[tuple[_Stop, _Stop], AfterValidator(_in_order)]


class SurfaceSection(Section):
    """One control surface."""

    command: Property = Field(description="property of the command", examples=["fcs/elevator-cmd-rad"])
    position: Property = Field(
        description="property of the position",
        json_schema_extra={"unit": "rad"},
        examples=["fcs/elevator-pos-rad"],
    )
    effective: Property = Field(
        description="property of the effective deflection",
        json_schema_extra={"unit": "rad"},
        examples=["fcs/elevator-effective-rad"],
    )
    travel_rad: Stops = Field(
        description="lower and upper stop, rad", json_schema_extra={"unit": "rad"}, examples=[[-0.49, 0.49]]
    )


class SignalSection(Section):
    """A further measured signal, dimensionless."""

    property: Property = Field(description="property of the signal", examples=["aero/dpt"])
    sensed: Literal[True] = Field(
        default=True,
        description="whether an instrument measures the signal",
        examples=[True],
    )


class MassSection(Section):
    """Mass, and inertia about the centre of gravity in body axes. Jxz enters the tensor with a minus sign."""

    mass_kg: Number | None = number(
        None, unit="kg", says="mass. `engine.thrust` requires it", ge=1e-6, le=1e7, examples=[2288.231]
    )
    Ix_kgm2: Number = number(..., unit="kg m2", says="roll inertia", ge=1e-12, le=1e9, examples=[5368.39])
    Iy_kgm2: Number = number(..., unit="kg m2", says="pitch inertia", ge=1e-12, le=1e9, examples=[6928.93])
    Iz_kgm2: Number = number(..., unit="kg m2", says="yaw inertia", ge=1e-12, le=1e9, examples=[11158.75])
    Jxz_kgm2: Number = number(
        0.0, unit="kg m2", says="product of inertia", ge=-1e9, le=1e9, examples=[117.64]
    )

    @model_validator(mode="after")
    def _is_a_body(self) -> Self:
        if self.Jxz_kgm2**2 >= self.Ix_kgm2 * self.Iz_kgm2:
            refuse([(("Jxz_kgm2",), "is too large for Ix and Iz, allowed: Jxz^2 below Ix Iz")])
        return self


class GeometrySection(Section):
    """Reference dimensions."""

    wing_area_m2: Number = number(..., unit="m2", says="wing area", ge=1e-6, le=1e4, examples=[23.23])
    span_m: Number = number(..., unit="m", says="wing span", ge=1e-3, le=500, examples=[14.63])
    chord_m: Number = number(..., unit="m", says="mean aerodynamic chord", ge=1e-3, le=500, examples=[1.5875])


class TermSection(Section):
    """One term of a coefficient. The term is `value` times powers of signals (`of`). With `surface`, it is
    also multiplied by the deflection of this surface.

    name: name of the term, used once
    source: source of the value
    description: meaning of the term
    """

    name: Name = entry(..., examples=["Cm_alpha"])
    value: Number = number(
        ...,
        "1",
        "coefficient. Angles and deflections in the term are in rad",
        range="any",
        examples=[-0.6028],
    )
    of: dict[str, Power] = Field(
        default_factory=dict,
        description="exponents of `alpha`, `beta`, ph = p b/(2 V), qh = q c/V, rh = r b/(2 V), and of "
        "`signals`; in `forces` also of betadoth = betadot b/(2 V). In `moments`, a term with a `surface` "
        "contains no rate",
        examples=[{"alpha": 1}],
    )
    surface: Name | None = Field(
        default=None,
        description="surface that multiplies the term",
        examples=["elevator"],
    )
    source: Text = entry("", examples=["TM88"])
    description: Text = entry("", examples=["static stability"])


class Moments(Section):
    """Terms of the moment coefficients.

    Cl: rolling moment
    Cm: pitching moment
    Cn: yawing moment
    """

    Cl: tuple[TermSection, ...] = ()
    Cm: tuple[TermSection, ...] = ()
    Cn: tuple[TermSection, ...] = ()


class Forces(Section):
    """Terms of the force coefficients along the body axes.

    CX: forward
    CY: to the right
    CZ: down
    """

    CX: tuple[TermSection, ...] = ()
    CY: tuple[TermSection, ...] = ()
    CZ: tuple[TermSection, ...] = ()


class EnvelopeSection(Section):
    """Flight conditions in which the terms are valid.

    airspeed_mps: lowest and highest true airspeed, m/s
    alpha_deg: lowest and highest angle of attack, deg
    altitude_m: lowest and highest altitude above sea level; left out: any altitude, m
    """

    airspeed_mps: Interval = entry(..., examples=[[30, 55]])
    alpha_deg: Interval = entry(..., examples=[[-5.7, 16]])
    altitude_m: Interval | None = entry(None, examples=[[0, 3000]])


_Share = Annotated[Number, Field(ge=-1, le=1, json_schema_extra={"unit": "1"})]


class TrimSection(Section):
    """Quantities that trim changes besides the main surface of each axis."""

    throttle: Property = Field(
        description="property of the power setting", examples=["engine/manifold-pressure-inhg"]
    )
    together: dict[Name, dict[Name, _Share]] = Field(
        default_factory=dict,
        description="surfaces that move together in trim",
        examples=[{"aileron": {"rudder": 0.2}}],
    )


class LimitSection(Section):
    """A property that must be within a range in trim.

    property: property of JSBSim
    says: name in messages
    unit: unit in messages
    range: lowest and highest value
    """

    property: Property = entry(..., examples=["engine/power-kw"])
    says: Text = entry("", examples=["engine power"])
    unit: Text = entry("", examples=["kW"])
    range: Interval = number(..., "the unit in `unit`", range="rising", examples=[[-40, 400]])


class SettingSection(LimitSection):
    """An engine setting that a scenario can have.

    default: default of the scenario
    """

    default: Number = number(..., "the unit in `unit`", range="in `range`", examples=[100])

    @model_validator(mode="after")
    def _default_is_in_range(self) -> Self:
        if not self.range[0] <= self.default <= self.range[1]:
            refuse([(("default",), "is out of range, allowed: a value in `range`")])
        return self


def _rising(given: tuple[float, ...]) -> tuple[float, ...]:
    if any(after <= before for before, after in pairwise(given)):
        refuse([((), "values out of order, allowed: rising ones")])
    return given


Steps = Annotated[
    tuple[Number, ...],
    Field(min_length=2, max_length=MAX_THRUST, json_schema_extra={"range": "rising"}),
    AfterValidator(_rising),
]
_Force = Annotated[Number, Field(ge=-1e8, le=1e8)]
_Forces = Annotated[tuple[_Force, ...], Field(min_length=2, max_length=MAX_THRUST)]


class ThrustSection(Section):
    """Steady force of the engine along the body x axis. The force depends on airspeed and on the setting
    that trim moves.

    airspeed_mps: true airspeeds, m/s
    setting: values of `trim.throttle`
    force_n: force, a row for each airspeed, a column for each setting, N
    lag_s: time constant of the thrust, s
    """

    airspeed_mps: Steps = entry(..., unit="m/s", examples=[[40, 60]])
    setting: Steps = entry(..., unit="as the setting has it", examples=[[10, 20, 30]])
    force_n: tuple[_Forces, ...] = number(
        ...,
        "N",
        range="one row for each airspeed, rising or equal in a row",
        max_length=MAX_THRUST,
        examples=[[[-100, 900, 2000], [-300, 500, 1500]]],
    )
    lag_s: Number = entry(0.0, unit="s", ge=0, le=60, examples=[0.8])

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        if [len(row) for row in self.force_n] != [len(self.setting)] * len(self.airspeed_mps):
            refuse([(("force_n",), "is no table of airspeed_mps by setting")])
        falling = (i for i, row in enumerate(self.force_n) if any(b < a for a, b in pairwise(row)))
        refuse([(("force_n", i), "falls with the setting, allowed: a force that does not") for i in falling])
        return self


class EngineSection(Section):
    """Settings of the engine, which are keys of `initial` of a scenario, and limits for trim.

    start: how the engines start. `steady`: they run. `run_up`: starters start them
    settings: settings
    limits: limits in trim
    thrust: force at each power setting; left out: `forces` alone hold the airspeed
    """

    settings: dict[Name, SettingSection] = Field(default_factory=dict)
    limits: dict[Name, LimitSection] = Field(default_factory=dict)
    start: Literal["steady", "run_up", "off"] = "steady"
    thrust: ThrustSection | None = None


class EffectorSection(Section):
    """An engine with a lever of its own, which the law moves.

    throttle: property of the lever of this engine, which is added to the common lever
    share: share of the thrust of all engines, `engine.thrust`
    """

    throttle: Property = entry(..., examples=["fcs/actuated-throttle-0-difference"])
    share: Number = number(..., "1", "share of the thrust of all engines", gt=0, le=1, examples=[0.5])
    right_m: Number = number(
        ..., "m", "distance to the right of the centre of gravity", ge=-100, le=100, examples=[-4.9]
    )
    down_m: Number = number(0.0, "m", "distance below the centre of gravity", ge=-100, le=100, examples=[1.1])


class ModelErrorSection(Section):
    """Largest error of each angular acceleration, besides `fdi.bounds`."""

    p: Number = number(0.0, unit="rad/s2", says="roll", ge=0, le=100, examples=[0.01])
    q: Number = number(0.0, unit="rad/s2", says="pitch", ge=0, le=100, examples=[0.01])
    r: Number = number(0.0, unit="rad/s2", says="yaw", ge=0, le=100, examples=[0.01])


Range = Annotated[
    tuple[Number, Number],
    AfterValidator(_not_reversed),
    Field(json_schema_extra={"range": "lowest, highest"}),
]
Shares = Annotated[tuple[NotNegative, ...], Field(min_length=1, max_length=MAX_LEVELS)]
Ages = Annotated[tuple[NotNegative, ...], Field(min_length=1, max_length=MAX_AGES)]
Errors = Annotated[tuple[Shares, ...], Field(min_length=1, max_length=MAX_AGES)]


class ErrorBox(Section):
    """A box of states, and the largest error in this box. An error is a table with one row for each time in
    `until_s`, and one column for each part in `travel_share`.

    airspeed_mps: true airspeed, m/s
    alpha_rad: angle of attack, rad
    beta_rad: sideslip, rad
    p_rad_s: roll rate, rad/s
    q_rad_s: pitch rate, rad/s
    r_rad_s: yaw rate, rad/s
    density_kg_m3: air density, kg/m3
    signals: a range for each declared signal
    error_p_rad_s2: largest error in roll, rad/s2
    error_q_rad_s2: largest error in pitch, rad/s2
    error_r_rad_s2: largest error in yaw, rad/s2
    engines_apart: largest yawing moment coefficient Cn of the running engines at equal levers, without that
    of the thrust; left out: unknown
    """

    airspeed_mps: Range = entry(..., examples=[[40, 50]])
    alpha_rad: Range = entry(..., examples=[[0, 0.1]])
    beta_rad: Range = entry(..., examples=[[-0.1, 0.1]])
    p_rad_s: Range = entry(..., examples=[[-0.2, 0.2]])
    q_rad_s: Range = entry(..., examples=[[-0.1, 0.1]])
    r_rad_s: Range = entry(..., examples=[[-0.1, 0.1]])
    density_kg_m3: Range = number(..., "kg/m3", range="lowest, highest", examples=[[0.9, 1.1]])
    signals: dict[Name, Range] = number(dict, "1", range="lowest, highest", examples=[{"dpt": [0, 1]}])
    error_p_rad_s2: Errors = entry(..., examples=[[[0.01]]])
    error_q_rad_s2: Errors = entry(..., examples=[[[0.01]]])
    error_r_rad_s2: Errors = entry(..., examples=[[[0.01]]])
    engines_apart: Number | None = number(None, unit="1", ge=0, le=100, examples=[0.0003])

    def ends(self, signals: Iterable[str]) -> list[Range]:
        """Ends of the box: rates, angle of attack, sideslip, airspeed, density, then these signals."""
        rates = self.p_rad_s, self.q_rad_s, self.r_rad_s
        flow = self.alpha_rad, self.beta_rad, self.airspeed_mps, self.density_kg_m3
        return [*rates, *flow, *(self.signals[name] for name in signals)]


class ErrorMapSection(Section):
    """The measured error of the angular accelerations. A box is a range of states, and each box contains the
    boxes before it.

    Outside of all boxes the error is unknown, and no alarm of a surface is raised.
    boxes: the boxes, the innermost one first
    """

    travel_share: Shares = number(
        ...,
        "share of 1",
        "parts of the travel of the surfaces, rising, for each of which the error is measured",
        examples=[[1]],
    )
    stand_ins: Number = number(
        1.0,
        unit="share of 1",
        says="factor on all but the last part, for stand-ins",
        gt=0,
        le=1,
    )
    until_s: Ages = entry(
        ...,
        "times since the start of the flight, rising, as fuel burns, s",
        examples=[[600]],
    )
    boxes: tuple[ErrorBox, ...] = Field(min_length=1, max_length=MAX_BOXES)

    @model_validator(mode="after")
    def _sizes_agree(self) -> Self:
        refuse(
            [
                (("boxes", i, f"error_{axis}_rad_s2"), "is no table of until_s by travel_share")
                for i, box in enumerate(self.boxes)
                for axis in "pqr"
                if [len(row) for row in getattr(box, f"error_{axis}_rad_s2")]
                != [len(self.travel_share)] * len(self.until_s)
            ]
        )
        return self

    @property
    def knows_engines(self) -> bool:
        """Whether it says of all boxes how alike engines under one lever pull."""
        return all(box.engines_apart is not None for box in self.boxes)


class StartSection(Section):
    """Flight condition at the start, if the scenario has none. Left out: 45 m/s, or the middle of
    `envelope` if it does not contain 45 m/s; 1828.8 m."""

    airspeed_mps: Number | None = number(None, unit="m/s", says="true airspeed", gt=0, le=1000, examples=[45])
    altitude_m: Number | None = number(
        None, unit="m", says="altitude above sea level", ge=-300, le=30000, examples=[1800]
    )


class GroundSection(Section):
    """The aircraft on the ground. Without this section there is no ground, not even at sea level.

    present: property that is 1 if there is a ground, otherwise 0
    """

    present: Property = entry(..., examples=["ground/present"])
    height_m: Number = number(
        ...,
        unit="m",
        says="height of the standing centre of gravity",
        gt=0,
        le=100,
        examples=[1.5],
    )
    pitch_deg: Number = number(
        ..., unit="deg", says="pitch angle of the standing aircraft", ge=-45, le=45, examples=[11]
    )


class DamageSection(Section):
    """One case of damage. If a flight has several cases at once, only the first case acts.

    property: property that is 1 if the damage is present, otherwise 0
    takes: surfaces that the damage removes
    """

    property: Property = entry(..., examples=["failures/damage/left-wing-tip-off"])
    takes: tuple[Name, ...] = entry((), examples=[["aileron"]])


class AircraftFile(Section):
    """Name, JSBSim model and sections of one aircraft.

    jsbsim: JSBSim model in the same folder
    groups: groups of surfaces that replace each other, each by the next
    model_error_rad_s2: largest error of the design model. It is added to the bound in `fdi.bounds`
    model_error_map: largest error of the design model for each range of states, instead of one value
    channels: outputs of an autopilot, and the surfaces that they move
    ground: the aircraft on the ground; left out: no flight begins on the ground
    damage: cases of damage that a scenario can have, by name
    name: name of the aircraft
    description: description in one line
    surfaces: two or more control surfaces, by name
    signals: measured dimensionless signals that multiply terms
    mass: mass and inertia
    geometry: reference dimensions
    moments: terms of the moment coefficients
    forces: terms of the force coefficients; left out: no airspeed can be held
    envelope: range in which the terms are valid
    trim: power setting, and surfaces that move together in trim
    engine: settings and limits of the engine
    effectors: engines with which the law turns the aircraft if the surfaces are not sufficient
    start: flight condition at the start, if the scenario has no other
    """

    name: Name = entry(..., examples=["my-uav"])
    description: Text = entry("", examples=["DHC-2 Beaver"])
    jsbsim: str = Field(pattern=FILE_PATTERN, max_length=200, examples=["my-uav.xml"])
    surfaces: dict[Name, SurfaceSection] = Field(min_length=2, max_length=MAX_SURFACES)
    groups: dict[Name, tuple[Name, ...]] = entry(
        ..., examples=[{"pitch": ["elevator", "flap"], "lateral": ["aileron", "rudder"]}]
    )
    signals: dict[Name, SignalSection] = Field(default_factory=dict, max_length=MAX_SIGNALS)
    mass: MassSection
    geometry: GeometrySection
    moments: Moments
    forces: Forces | None = None
    envelope: EnvelopeSection
    trim: TrimSection
    engine: EngineSection = Field(default_factory=EngineSection)
    effectors: dict[Name, EffectorSection] = Field(default_factory=dict, max_length=MAX_EFFECTORS)
    model_error_rad_s2: ModelErrorSection = Field(default_factory=ModelErrorSection)
    model_error_map: ErrorMapSection | None = None
    start: StartSection = Field(default_factory=StartSection)
    channels: ChannelsSection | None = None
    ground: GroundSection | None = None
    damage: dict[Name, DamageSection] = Field(default_factory=dict, max_length=MAX_DAMAGE)

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        refuse([*self._groups(), *self._terms(), *self._names(), *self._thrust(), *self._taken()])
        return self

    def _groups(self) -> Iterator[Conflict]:
        """Every surface belongs to one group."""
        seen: set[str] = set()
        for group, members in self.groups.items():
            for i, surface in enumerate(members):
                if surface not in self.surfaces:
                    yield ("groups", group, i), f"unknown surface{suggestion(surface, self.surfaces)}"
                elif surface in seen:
                    yield ("groups", group, i), f"{surface} is in two groups, allowed: in one"
                seen.add(surface)
        for surface in self.surfaces:
            if surface not in seen:
                yield ("groups",), f"{surface} is in no group, allowed: every surface in one"

    def _taken(self) -> Iterator[Conflict]:
        """Damage takes surfaces there are, and trim moves them together."""
        led: set[str] = set(self.trim.together)
        for name, of in self.trim.together.items():
            here = ("trim", "together", name)
            if name not in self.surfaces:
                yield here, f"unknown surface{suggestion(name, self.surfaces)}"
            for surface in of:
                if surface not in self.surfaces:
                    yield (*here, surface), f"unknown surface{suggestion(surface, self.surfaces)}"
                elif surface in led:
                    yield (*here, surface), "goes with another or leads itself, allowed: one of it"
                led.add(surface)
        for case, damage in self.damage.items():
            for i, name in enumerate(damage.takes):
                if name not in self.surfaces:
                    yield ("damage", case, "takes", i), f"unknown surface{suggestion(name, self.surfaces)}"

    def _terms(self) -> Iterator[Conflict]:
        """Terms multiply signals and surfaces there are."""
        for section, coefficient, i, term in self.terms():
            here = (section, coefficient, i)
            known = [*FLOW_SIGNALS, *self.signals, *([SIDESLIP_RATE] if section == "forces" else [])]
            for signal in term.of:
                if signal not in known:
                    yield (*here, "of", signal), f"unknown signal{suggestion(signal, known)}"
            if term.surface is not None and term.surface not in self.surfaces:
                yield (*here, "surface"), f"unknown surface{suggestion(term.surface, self.surfaces)}"
            if section == "moments" and term.surface is not None and set(term.of) & set(RATE_SIGNALS):
                says = "multiplies a rate and a surface, allowed: one of them, for G is that of y"
                yield (*here, "of"), says

    def _names(self) -> Iterator[Conflict]:
        """Names are unique, and there is room for all of them."""
        seen: set[str] = set()
        for section, coefficient, i, term in self.terms():
            if term.name in seen:
                yield (section, coefficient, i, "name"), f"{term.name} is there twice, allowed: once"
            seen.add(term.name)
        for section in ("moments", "forces"):
            for coefficient, terms in getattr(self, section) or ():
                if len(terms) > MAX_TERMS_OF_ONE:
                    yield (section, coefficient), f"{len(terms)} terms, allowed: at most {MAX_TERMS_OF_ONE}"
        for i, box in enumerate(self.model_error_map.boxes if self.model_error_map else ()):
            if set(box.signals) != set(self.signals):
                says = "has other signals than the aircraft, allowed: a range for each of them"
                yield ("model_error_map", "boxes", i, "signals"), says
        for name in self.channels.surfaces if self.channels else ():
            if name not in self.surfaces:
                yield ("channels", "surfaces", name), f"unknown surface{suggestion(name, self.surfaces)}"
        for name in set(self.signals) & {*FLOW_SIGNALS, SIDESLIP_RATE}:
            yield ("signals", name), f"{name} is measured in any case, allowed: another name"

    def _thrust(self) -> Iterator[Conflict]:
        """What power gives needs a setting to give it by, and a mass to move."""
        if self.engine.thrust is None:
            if self.effectors:
                yield ("effectors",), "want what their thrust is, allowed: with engine.thrust"
            return
        if sum(of.share for of in self.effectors.values()) > 1.001:
            yield ("effectors",), "shares add up to more than 1, allowed: at most 1"
        here, setting = ("engine", "thrust"), self.power_setting
        if setting is None:
            yield here, "no setting has the property of trim.throttle, allowed: with one that has"
        elif not (
            setting[1].range[0] <= self.engine.thrust.setting[0]
            and self.engine.thrust.setting[-1] <= setting[1].range[1]
        ):
            yield (*here, "setting"), f"leaves the range of {setting[0]}, allowed: settings in it"
        if self.mass.mass_kg is None:
            yield here, "wants a mass, allowed: with mass.mass_kg"

    @property
    def power_setting(self) -> tuple[str, SettingSection] | None:
        """The engine setting that trim moves, and what a scenario calls it."""
        return next((of for of in self.engine.settings.items() if of[1].property == self.trim.throttle), None)

    def terms(self) -> Iterator[tuple[str, str, int, TermSection]]:
        """(section, coefficient, index, term) of every term in the file."""
        for section, coefficients in (("moments", self.moments), ("forces", self.forces or ())):
            for coefficient, terms in coefficients:
                yield from ((section, coefficient, i, term) for i, term in enumerate(terms))
