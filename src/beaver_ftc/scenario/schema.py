"""The scenario file as frozen, typed, strict sections, and how it is read; ranges are the contract's.

Contradictions between sections are looked for in a finished scenario and in a half-wrong file's data
alike, so that a contradiction is reported along with the mistakes of the sections and not only after they
are mended. What cannot be read is unknown, for instance because it is itself a mistake, and contradicts
nothing.

`load` takes a file, a built-in name or a mapping: every mistake at once, one line each.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    PlainValidator,
    PrivateAttr,
    SerializeAsAny,
    Tag,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from beaver_ftc.aircraft import DEFAULT, Aircraft, UnknownAircraft
from beaver_ftc.aircraft import load as load_aircraft
from beaver_ftc.documents.document import (
    Conflict,
    Document,
    Flag,
    Number,
    Problem,
    Section,
    Whole,
    deny,
    entry,
    number,
    refuse,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.validation import (
    ScenarioError,
    UnusableKeyError,
    parse_document,
    parse_key,
    plain,
    validate,
    with_values,
)
from beaver_ftc.scenario.airframe import (
    Actuators,
    Environment,
    Initial,
    Ratio,
    Ratios,
    TrueActuators,
    aircraft_called,
    checked_against,
    default_initial,
    find_aircraft,
    folder_of,
    given_initial,
    initial_schema,
    known_aircraft,
    left_out,
)
from beaver_ftc.scenario.builtin import read_file, resolve
from beaver_ftc.scenario.diagnosis import (
    BoundedSensors,
    ControlConfig,
    FdiConfig,
    Law,
    Scheme,
    changes_refused,
    leaders_missed,
)
from beaver_ftc.scenario.faults import (
    MOST_FAULTS,
    Fault,
    FaultType,
    Nameable,
    SensorFault,
    SurfaceFault,
    without_effect,
)
from beaver_ftc.scenario.sensors import Sensors
from beaver_ftc.scenario.signals import Autopilot, Reference

DURATION_S = 30.0
RATE_HZ = 100.0
OF_A_FAULT = (
    "detected_within_s", "isolated_as", "isolated_type", "candidate_type", "isolated_within_s",
    "post_fault_rms_deg_s",
)  # fmt: skip
# What can be expected of a profile, below `expect`, and the channel of the autopilot it is of.
_OF_A_PROFILE: dict[tuple[str, ...], str] = {
    ("altitude_within_m",): "altitude_m",
    ("airspeed_within_mps",): "airspeed_mps",
    ("airspeed_within_limits_mps",): "airspeed_mps",
    ("heading_within_deg",): "heading_deg",
    **{("arrives", channel): channel for channel in ("altitude_m", "airspeed_mps", "heading_deg")},
}

Instants = Sequence[float | None]


def conflicts(said: Mapping[str, Any]) -> Iterator[Conflict]:
    """Every contradiction, at the key to change. said: sections by name, faults and changes as they are,
    others as mappings."""
    duration_s = _positive(said.get("duration_s", DURATION_S))
    rate_hz = _positive(said.get("rate_hz", RATE_HZ))
    faults_s, changes_s = (_instants(said.get(section, [])) for section in ("faults", "changes"))
    if duration_s and rate_hz and duration_s * rate_hz < 1:
        yield ("duration_s",), f"{duration_s:g} is less than one frame, allowed: at least {1 / rate_hz:g} s"
    yield from _too_late("faults", faults_s or (), duration_s)
    yield from _too_late("changes", changes_s or (), duration_s)
    yield from _without_effect(said.get("faults", ()))
    yield from _out_of_order(changes_s or ())
    expect = said.get("expect")
    autopilot = said.get("autopilot")
    if faults_s is not None and not faults_s:
        yield from _expected_of_no_fault(expect)
    if isinstance(autopilot, Mapping | None):
        yield from _expected_of_no_profile(expect, autopilot or {})


def _too_late(section: str, starts_s: Instants, end_s: float | None) -> Iterator[Conflict]:
    for i, at_s in enumerate(starts_s):
        if at_s and end_s and at_s >= end_s:
            allowed = f"allowed: earlier than duration_s, {end_s:g} s"
            yield (section, i, "at_s"), f"{at_s:g} is after the end, {allowed}"


def _without_effect(faults: Any) -> Iterator[Conflict]:
    """What a scenario declares is flown: no fault of a surface that another one masks as it begins."""
    if isinstance(faults, list | tuple) and all(
        isinstance(fault, SurfaceFault | SensorFault) for fault in faults
    ):
        yield from ((("faults", i, "at_s"), says) for i, says in without_effect(faults))


def _out_of_order(changes_s: Instants) -> Iterator[Conflict]:
    """Changes stand in the order in which they come, so that a reader need not sort them."""
    for i, (early, late) in enumerate(pairwise(changes_s), start=1):
        if early and late and late <= early:
            allowed = f"allowed: later than {early:g} s"
            yield ("changes", i, "at_s"), f"{late:g} is not after the change before it, {allowed}"


def _expected_of_no_fault(expect: Any) -> Iterator[Conflict]:
    for key in expect if isinstance(expect, Mapping) else ():
        if key in OF_A_FAULT and expect[key] is not None:
            yield ("expect", key), "there is no fault to expect it of, allowed: only with faults"


def _expected_of_no_profile(expect: Any, autopilot: Mapping[str, Any]) -> Iterator[Conflict]:
    for path, channel in _OF_A_PROFILE.items():
        expected = expect
        for key in path:
            expected = expected.get(key) if isinstance(expected, Mapping) else None
        if expected is not None and not autopilot.get(channel):
            says = f"there is no profile to expect it of, allowed: only with autopilot.{channel}"
            yield ("expect", *path), says


def _instants(given: Any) -> Instants | None:
    """`at_s` of each entry of a list, None where it is no positive number."""
    if not isinstance(given, list | tuple):
        return None
    return [_positive(e.get("at_s") if isinstance(e, dict) else getattr(e, "at_s", None)) for e in given]


def _positive(value: Any) -> float | None:
    """The value if it is a positive finite number."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if number and 0 < value <= 1e9 and isfinite(value) else None


NAME_PATTERN = r"^[A-Za-z0-9_-]+$"
MOST_NAMES = 20  # of a flight: as many surfaces as an aircraft may have


class InertiaCoupling(Section):
    """Relative errors of the inertia coupling in the truth. The inertia coupling is the angular acceleration
    that comes from products of two body rates. In the published study [Zhang2005] these errors are at most
    0.25."""

    p: Number = number(0.0, "share of 1", "coefficient of q r", ge=-1, le=1, examples=[0.2])
    q: Number = number(0.0, "share of 1", "coefficient of p r", ge=-1, le=1, examples=[0.2])
    r: Number = number(0.0, "share of 1", "coefficient of p q", ge=-1, le=1, examples=[0.2])


class Sinusoid(Section):
    """amplitude times sin(frequency t), t: time of the flight."""

    amplitude_rad_s2: Number = number(0.0, "rad/s2", "amplitude", ge=0, le=10, examples=[0.02])
    frequency_rad_s: Number = number(10.0, "rad/s", "angular frequency", gt=0, le=1000)


class SinusoidAxes(Section):
    """One sinusoidal acceleration for each axis."""

    p: Sinusoid = Field(default_factory=Sinusoid)
    q: Sinusoid = Field(default_factory=Sinusoid)
    r: Sinusoid = Field(default_factory=Sinusoid)


class TrueInertia(Section):
    """Inertia of the truth, divided by the inertia in the aircraft file."""

    Ix: Number = number(1.0, "1", "roll inertia", ge=0.5, le=2)
    Iy: Number = number(1.0, "1", "pitch inertia", ge=0.5, le=2)
    Iz: Number = number(1.0, "1", "yaw inertia", ge=0.5, le=2)


Offset = Annotated[Number, Field(ge=-0.5, le=0.5)]


class Uncertainty(Section):
    """Differences between the truth and the design model.

    inertia_coupling: relative errors of the inertia coupling, the acceleration from products of two rates

    sinusoid: a sinusoidal error of each angular acceleration
    coefficients: factors on aerodynamic terms of the truth, by name
    mass: mass of the truth, divided by the mass in the aircraft file. The inertia is not changed, 1
    inertia: inertia of the truth, divided by the inertia in the aircraft file

    cg_m: shift of the true centre of gravity: forward, right, down, m
    actuators: actuators of the truth, compared with `actuators`
    """

    inertia_coupling: InertiaCoupling = entry(InertiaCoupling)
    sinusoid: SinusoidAxes = entry(SinusoidAxes)
    coefficients: Ratios = entry(dict, examples=[{"Cm_alpha": 1.05}])
    mass: Number = number(1.0, "1", ge=0.5, le=2)
    inertia: TrueInertia = entry(TrueInertia)
    cg_m: tuple[Offset, Offset, Offset] = number((0.0, 0.0, 0.0), "m", examples=[[0.05, 0, 0]])
    actuators: TrueActuators = entry(TrueActuators, examples=[{"bandwidth": 0.8}])


Scale = Annotated[Number, Field(ge=0.1, le=10)]


class InertiaScale(Section):
    """Inertia of the design model, divided by the inertia in the aircraft file."""

    Ix: Scale = number(1.0, "1", "roll inertia")
    Iy: Scale = number(1.0, "1", "pitch inertia")
    Iz: Scale = number(1.0, "1", "yaw inertia")
    Jxz: Ratio = number(1.0, "1", "product of inertia")


class DesignModel(Section):
    """Deliberate errors of the design model. The truth does not change.

    engine_terms: false: no slipstream terms (`dpt`) in Cl, Cm and Cn, as in the published study
    linearised: true: linearised about the trim at the start
    frozen_alpha: true: alpha has its trim value
    mass: mass, divided by that in the aircraft file; the inertia is scaled too, 1
    inertia: inertia of the design model
    coefficients: factors on aerodynamic terms, by name
    actuators: actuators for the diagnosis and the laws. Left out: as `actuators`
    sensors: sensors as the laws know them, in the forms of `sensors`. Left out: as `sensors`, in a sweep of
    `sensors` as the base's
    """

    engine_terms: Flag = True
    linearised: Flag = False
    frozen_alpha: Flag = False
    mass: Scale = number(1.0, "1")
    inertia: InertiaScale = entry(InertiaScale)
    coefficients: Ratios = entry(dict, examples=[{"Cm_alpha": 0.9}])
    actuators: Actuators | None = entry(None, examples=["servo"])
    sensors: Sensors | None = entry(None, examples=["tactical-grade"])


class Change(Section):
    """A change of law, diagnosis or sensors in flight. A key that is left out changes nothing."""

    at_s: Number = number(..., "s", "time of the change", gt=0, le=360_000, examples=[20])
    law: Law | None = entry(
        None,
        "new law, as in `control.law`",
        examples=["nominal"],
    )
    scheme: Scheme | None = entry(
        None, "new scheme, as in `fdi.scheme`. The diagnosis restarts", examples=["zhang2005"]
    )
    sensors: Sensors | None = entry(
        None, "new sensor errors. Diagnosis and law do not receive them", examples=["tactical-grade"]
    )
    declared_sensors: BoundedSensors | None = entry(
        None, "new declared sensor errors. The diagnosis restarts"
    )

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        said = (value for key, value in self if key != "at_s")
        if all(value is None for value in said):
            deny("says no change, allowed: law, scheme, sensors or declared_sensors")
        return self


class RmsLimits(Section):
    """Largest allowed root mean square (RMS) of the tracking error on each axis."""

    p: Number | None = number(None, "deg/s", "roll rate", ge=0, le=1000, examples=[1.5])
    q: Number | None = number(None, "deg/s", "pitch rate", ge=0, le=1000, examples=[1.5])
    r: Number | None = number(None, "deg/s", "yaw rate", ge=0, le=1000, examples=[1.5])


class Arrival(Section):
    """Largest allowed deviations from the commanded flight path at the end of the flight. Before the
    check, a first-order lag with a time constant of 10 s smooths each deviation."""

    altitude_m: Number | None = number(None, "m", "altitude", gt=0, le=10_000, examples=[10])
    airspeed_mps: Number | None = number(None, "m/s", "airspeed", gt=0, le=100, examples=[2])
    heading_deg: Number | None = number(None, "deg", "heading", gt=0, le=180, examples=[5])
    in_envelope: Flag | None = entry(None, "whether the flight must end inside the validated envelope")


def _one_or_list(given: Any) -> str:
    return "(list)" if isinstance(given, list | tuple) else "(one)"


Names = Annotated[tuple[Nameable, ...], Field(max_length=MOST_NAMES)]


class Expect(Section):
    """Conditions that the flight must meet. A condition that is left out is not checked.

    detected_within_s: largest time from the fault to the first alarm, s
    isolated_as: name that the diagnosis must give: a surface, an instrument such as `sensor p`, or
    `unanticipated`. A list has one name for each fault, in their order
    isolated_type: fault type that the diagnosis must name
    candidate_type: fault type that must be named or stay possible
    isolated_within_s: largest time from the fault to its name, s
    no_false_alarm: whether no alarm may come before the first fault
    no_departure: whether the aircraft must survive
    pre_fault_rms_deg_s: largest RMS tracking error before the fault, without a fault of the whole flight
    post_fault_rms_deg_s: largest RMS tracking error after the fault
    altitude_within_m: largest deviation from the commanded altitude, m
    airspeed_within_mps: largest deviation from the commanded airspeed, after a lag of 10 s, m/s
    airspeed_within_limits_mps: as `airspeed_within_mps`, with a command that the aircraft can hold after the
    fault, m/s
    heading_within_deg: largest deviation from the commanded heading, without 30 s after each change, deg
    stays_in_envelope: whether the flight must stay inside the validated envelope
    arrives: largest deviations from the flight path at the end, after a lag of 10 s. A lost aircraft does
    not arrive
    """

    detected_within_s: Number | None = number(None, "s", ge=0, le=360_000, examples=[0.5])
    isolated_as: (
        Annotated[
            Annotated[Nameable, Tag("(one)")] | Annotated[Names, Tag("(list)")], Discriminator(_one_or_list)
        ]
        | None
    ) = entry(None, examples=["elevator", ["elevator", "rudder"]])
    isolated_type: FaultType | None = None
    candidate_type: FaultType | None = None
    isolated_within_s: Number | None = number(None, "s", ge=0, le=360_000, examples=[2])
    no_false_alarm: Flag | None = None
    no_departure: Flag | None = None
    pre_fault_rms_deg_s: RmsLimits | None = None
    post_fault_rms_deg_s: RmsLimits | None = None
    altitude_within_m: Number | None = number(None, "m", gt=0, le=10_000, examples=[25])
    airspeed_within_mps: Number | None = number(None, "m/s", gt=0, le=100, examples=[3.5])
    airspeed_within_limits_mps: Number | None = number(None, "m/s", gt=0, le=100, examples=[2])
    heading_within_deg: Number | None = number(None, "deg", gt=0, le=180, examples=[6])
    stays_in_envelope: Flag | None = None
    arrives: Arrival | None = None


class Scenario(Section, title="beaver-ftc scenario"):
    """One flight: aircraft, manoeuvre, faults, diagnosis, control law and expectations.

    name: name of the result folder: letters, digits, - and _
    description: purpose of the flight
    aircraft: built-in name, jsbsim:NAME, or ./FOLDER beside this file
    duration_s: length of the flight, s
    rate_hz: frame rate of diagnosis and control, Hz
    substeps: number of JSBSim steps in each frame
    seed: seed of all random numbers of the flight
    initial: flight condition at the start, trimmed
    reference: commanded body rates
    autopilot: flight path that the outer loops follow; left out: only the body rates are controlled
    faults: faults of surfaces and sensors
    uncertainty: differences between the truth and the design model
    actuators: actuator dynamics
    sensors: measurement errors
    environment: wind, turbulence and gusts
    fdi: fault detection and isolation, i.e. the diagnosis
    control: control law and its gains
    changes: changes of law, diagnosis and sensors in flight
    design_model: deliberate errors of the design model
    expect: conditions that the flight must meet
    """

    name: str = entry(..., pattern=NAME_PATTERN, max_length=100, examples=["elevator-partial-loss"])
    description: str = entry("", max_length=2000, examples=["The elevator loses 40 % of its effectiveness."])
    aircraft: Annotated[str, AfterValidator(known_aircraft)] = entry(
        DEFAULT, max_length=200, examples=[DEFAULT]
    )
    duration_s: Number = number(DURATION_S, "s", gt=0, le=360_000)
    rate_hz: Number = number(RATE_HZ, "Hz", ge=20, le=1000)
    substeps: Whole = entry(1, ge=1, le=50)
    seed: Whole = entry(1, ge=0, le=2**63 - 1)
    initial: Annotated[SerializeAsAny[Initial], PlainValidator(given_initial)] = entry(
        default_initial, json_schema_extra=initial_schema
    )
    reference: Reference = entry(left_out(Reference))
    autopilot: Autopilot | None = None
    faults: tuple[Fault, ...] = entry((), max_length=MOST_FAULTS)
    uncertainty: Uncertainty = entry(left_out(Uncertainty))
    actuators: Actuators = entry(Actuators)
    sensors: Sensors = entry(left_out(Sensors), examples=["tactical-grade"])
    environment: Environment = entry(left_out(Environment))
    fdi: FdiConfig = entry(left_out(FdiConfig))
    control: ControlConfig = entry(left_out(ControlConfig))
    changes: tuple[Change, ...] = entry((), max_length=1000)
    design_model: DesignModel = entry(left_out(DesignModel))
    expect: Expect = entry(left_out(Expect))

    _airframe: Aircraft | None = PrivateAttr(default=None)

    @property
    def airframe(self) -> Aircraft:
        """The aircraft, as data."""
        return self._airframe or find_aircraft(self.aircraft)

    @property
    def known_actuators(self) -> Actuators:
        """The actuators as the designer knows them: the nominal ones, unless the design model has its own."""
        return self.actuators if self.design_model.actuators is None else self.design_model.actuators

    @property
    def known_sensors(self) -> Sensors:
        """The sensors as the designer knows them, likewise."""
        return self.sensors if self.design_model.sensors is None else self.design_model.sensors

    @model_validator(mode="wrap")
    @classmethod
    def _of_its_aircraft(
        cls, given: Any, read: ModelWrapValidatorHandler[Self], info: ValidationInfo
    ) -> Self:
        """Check names against the scenario's own aircraft; one there is not is reported by its key."""
        reference = given.get("aircraft") if isinstance(given, dict) else None
        reference = reference if isinstance(reference, str) else None
        try:
            aircraft = aircraft_called(reference, folder_of(info))
        except UnknownAircraft:
            aircraft = load_aircraft()
            reference = None
        with checked_against(aircraft, reference):
            scenario = read(given)
        if isinstance(given, dict):
            scenario._airframe = aircraft
        return scenario

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        flown = dict(self.autopilot or {})
        said = conflicts({**dict(self), "autopilot": flown, "expect": self.expect.model_dump()})
        refuse([*said, *changes_refused(self, self.airframe), *leaders_missed(self, self.airframe)])
        return self

    def with_(self, changes: Mapping[str, Any]) -> Self:
        """A copy of the scenario with new values.

        - `changes`: a mapping from dotted key to new value, e.g. `{"faults[0].magnitude": 0.2}`.

        Raises BadInput with the key, the mistake and the allowed values.
        """
        if not isinstance(changes, Mapping):
            raise BadInput(f"{changes!r:.60} is no change, allowed: a mapping of dotted keys to values")
        data = self.model_dump(mode="json", by_alias=True, exclude_unset=True)
        for key, value in changes.items():
            try:
                data = with_values(data, {parse_key(key): plain(value)})
            except UnusableKeyError as error:
                raise BadInput(f"{key}: {str(error).replace('the base', 'the scenario')}") from None
        with checked_against(self.airframe, self.aircraft):
            with suppress(ValidationError):
                return self.model_validate(data | self.sections_beside(changes), context={"folder": Path()})
            return validate(type(self), Document(data), "", Path(), conflicts)

    def sections_beside(self, keys: Iterable[str]) -> dict[str, Section]:
        """The sections that are set and that changes at these dotted keys leave alone: as they are, so that
        what was worked out of them is known of them still. None where the aircraft changes, which has other
        names."""
        changed = {parse_key(key)[0] for key in keys}
        if "aircraft" in changed:
            return {}
        return {
            name: section
            for name, section in self
            if isinstance(section, Section) and name in self.model_fields_set - changed
        }

    def warnings(self) -> tuple[str, ...]:
        """Warnings about values that are allowed but unusual. Each warning is one text,
        `key.path: warning`.
        """
        from beaver_ftc.scenario.warnings import warnings_of

        return warnings_of(self)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a scenario file, for editors; descriptions and units of every key are in it."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()}


UNNAMED = "unnamed"

ScenarioLike = Scenario | str | PathLike[str] | Mapping[str, Any]


def load(scenario: ScenarioLike) -> Scenario:
    """Load a scenario from a built-in name, a file's path or a mapping.

    - `scenario`: a name from `scenarios()`, the path of a YAML file, a mapping with the keys of a scenario
      file, or a `Scenario`, which is returned unchanged. A mapping needs no `name`. If a mapping names CSV
      files, they are read from the working directory.

    Raises BadInput with one line for each mistake.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, Mapping):
        return validate_scenario(Document({"name": UNNAMED, **plain(scenario)}), folder=Path())
    if isinstance(scenario, str | PathLike):
        return load_scenario(Path(scenario) if isinstance(scenario, PathLike) else scenario)
    raise BadInput(f"{scenario!r:.60} is no scenario, allowed: a built-in name, a path or a mapping")


def load_scenario(path_or_name: str | Path) -> Scenario:
    """The scenario in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    path = resolve(path_or_name)
    return load_text(read_file(path, str(path_or_name)), source=str(path), folder=path.parent)


def load_text(text: str, source: str = "<text>", folder: Path | None = None) -> Scenario:
    """The scenario in a text; `source` begins its error lines, `folder` is where its CSV files are."""
    document = parse_document(text, source)
    if is_of_a_sweep(document.data):
        says = f"this is a sweep file, allowed: a scenario; `beaver-ftc sweep {source}` flies it"
        raise ScenarioError(source, [Problem(document.line(("base",)), ("base",), says)])
    return validate_scenario(document, source, folder)


def is_of_a_sweep(data: dict[str, Any]) -> bool:
    """Whether a file's keys are those of a sweep: a base, and what becomes of it."""
    return "base" in data and not {"runs", "vary", "set", "expect"}.isdisjoint(data)


def validate_scenario(document: Document, source: str = "", folder: Path | None = None) -> Scenario:
    """The scenario in a document; without a source its error lines begin with the key."""
    return validate(Scenario, document, source, folder, conflicts)


def stages(scenario: Scenario) -> Iterator[tuple[Change, Scenario]]:
    """(change, the scenario as it is from then on) for each change, in order.

    Options belong to the law or scheme that the scenario begins with: another one has its defaults.
    """
    now = scenario
    for change in scenario.changes:
        now = _as_changed(now, change, scenario)
        yield change, now


def _as_changed(now: Scenario, change: Change, given: Scenario) -> Scenario:
    changes: dict[str, Any] = {}
    if change.law is not None:
        options = given.control.options if change.law == given.control.law else {}
        changes["control"] = now.control.model_copy(update={"law": change.law, "options": options})
    fdi = now.fdi
    if change.scheme is not None:
        options = given.fdi.options if change.scheme == given.fdi.scheme else {}
        fdi = fdi.with_scheme(change.scheme, options)
    if change.declared_sensors is not None:
        bounds = fdi.bounds.model_copy(update={"sensors": change.declared_sensors})
        fdi = fdi.model_copy(update={"bounds": bounds})
    if change.sensors is not None:
        changes["sensors"] = change.sensors  # of which nobody is told: a law knows those it has known
        known = now.design_model.model_copy(update={"sensors": now.known_sensors})
        changes["design_model"] = known
    return now.model_copy(update={**changes, "fdi": fdi})
