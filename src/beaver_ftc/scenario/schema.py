"""The scenario file as frozen, typed, strict sections, and how it is read; ranges are the contract's.

`load` takes a file, a built-in name or a mapping: every mistake at once, one line each.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    ModelWrapValidatorHandler,
    PlainValidator,
    PrivateAttr,
    SerializeAsAny,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from beaver_ftc.aircraft import DEFAULT, Aircraft, UnknownAircraft
from beaver_ftc.aircraft import load as load_aircraft
from beaver_ftc.documents.document import (
    Document,
    Number,
    Problem,
    Section,
    Whole,
    deny,
    entry,
    number,
    plain,
    refuse,
)
from beaver_ftc.documents.dotted import UnusableKeyError, parse_key, with_values
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import parse_document, validate
from beaver_ftc.scenario.actuators import Actuators
from beaver_ftc.scenario.air import Environment
from beaver_ftc.scenario.airframe import (
    Initial,
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
from beaver_ftc.scenario.autopilot import Autopilot
from beaver_ftc.scenario.builtin import read_file, resolve
from beaver_ftc.scenario.contradictions import DURATION_S, RATE_HZ, conflicts
from beaver_ftc.scenario.diagnosis import (
    BoundedSensors,
    ControlConfig,
    FdiConfig,
    Law,
    Scheme,
    leaders_missed,
)
from beaver_ftc.scenario.expect import Expect
from beaver_ftc.scenario.faults import (
    MOST_FAULTS,
    Fault,
)
from beaver_ftc.scenario.model_errors import DesignModel, Uncertainty
from beaver_ftc.scenario.pairs import changes_refused
from beaver_ftc.scenario.sensors import Sensors
from beaver_ftc.scenario.signals import Reference

NAME_PATTERN = r"^[A-Za-z0-9_-]+$"


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
