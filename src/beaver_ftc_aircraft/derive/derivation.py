"""From an aircraft's name to a folder that flies: a JSBSim model that takes faults, and `aircraft.yaml`."""

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import degrees, isnan, radians
from pathlib import Path
from time import perf_counter

import numpy as np
import yaml

from beaver_ftc.aircraft import (
    AIRCRAFT_FILE,
    DERIVED_FORMAT,
    FROM_JSBSIM,
    MAX_MONOMIALS,
    MAX_SIGNALS,
    MAX_TERMS_OF_ONE,
    THRUST_TERM,
    builtin_names,
    derived_folder,
    first_line_of,
    load,
    read_aircraft,
)
from beaver_ftc.design import design_record
from beaver_ftc.diagnosis.monitors import THRUST_SIGNAL
from beaver_ftc.documents import BadInput, SimulationFailed, put_folder
from beaver_ftc.plant import (
    AT_IDLE,
    GEAR,
    SIGNAL_PROPERTIES,
    Plant,
    TrimPoint,
    check_model_has_no_side_effects,
    copy_of,
    instrument_model,
    is_known_to_jsbsim,
    lacking_in_trial,
    left_out_of_copy,
    probe_model,
    seen_by_aerodynamics,
    source_of_jsbsim,
    translated,
    where_files_lie,
)
from beaver_ftc.plant import trim_plant as trim_at
from beaver_ftc.studies.engine import Forks
from beaver_ftc_aircraft.derive import outline
from beaver_ftc_aircraft.derive.derived import NAME as PAGE
from beaver_ftc_aircraft.derive.derived import Derived, page_of
from beaver_ftc_aircraft.derive.fit import (
    MOST_TERMS,
    engine_signals,
    errors_of,
    fitted,
    map_of,
    nearness,
    set_engines_apart,
    signals_of_use,
)
from beaver_ftc_aircraft.derive.sample import (
    AGES_OF_WORST,
    ALTITUDE_M,
    EVERY_AGE,
    FRESH,
    SIDESLIP_RAD,
    USUAL,
    Envelope,
    Moves,
    Region,
    Samples,
    fly_about_all,
    sample_all,
)
from beaver_ftc_aircraft.derive.surfaces import (
    DIFFERENT,
    Difference,
    Surfaces,
    differences,
    find_surfaces,
)
from beaver_ftc_aircraft.derive.thrust import LEAST_ARM_M, effectors_of, thrust_of

SAMPLES, CHECKED = 6000, 8000
CHECKED_OF_REGIONS = 18000
SPAN_OF_ALPHA_RAD = 0.10
LOWEST_M, SPANS_ABOVE_GROUND = 100.0, 2.0  # of what is sampled
BEYOND_M = 100.0  # sampled beyond the altitudes of the envelope: a flight at its end moves up and down
FEWEST_TERMS = 6
Tell = Callable[[str], None]
_ALLOWED = "jsbsim:NAME, a built-in name, a JSBSim model FILE.xml, or a folder with an aircraft.yaml"


@dataclass(frozen=True)
class Source:
    """An aircraft to derive. name: of the folder to be written. model: JSBSim's. folder: of an aircraft file
    whose moments are to be found again, else None: the model is instrumented. target: where the result goes
    unless somebody says otherwise, None if somebody must."""

    name: str
    model: Path
    folder: Path | None = None
    target: Path | None = None

    @property
    def says(self) -> str:
        """What to call it."""
        return f"{FROM_JSBSIM}{self.name}" if self.target else self.name


@dataclass(frozen=True)
class Pair:
    """A model and its copy. own: the model, with nothing that fails. surfaces: of both. along: what the
    commands of surfaces move beside them in the model, and not in the copy."""

    own: Path
    copy: Path
    surfaces: Surfaces
    along: frozenset[str]


def source_of(reference: str) -> Source:
    """What a reference means. Raises BadInput for what is no aircraft, or would act on the machine."""
    if reference.startswith(FROM_JSBSIM):
        name = reference.removeprefix(FROM_JSBSIM)
        target = derived_folder(name)
        return Source(name, source_of_jsbsim(name), target=target)
    if reference in builtin_names():
        aircraft = load(reference)
        return Source(reference, aircraft.jsbsim, aircraft.folder)
    path = Path(reference)
    if (path / AIRCRAFT_FILE).is_file():
        aircraft = read_aircraft(path.resolve())
        return Source(aircraft.name, aircraft.jsbsim, aircraft.folder)
    if path.is_dir() and (path / f"{path.resolve().name}.xml").is_file():
        path = path / f"{path.resolve().name}.xml"
    if path.suffix == ".xml" and path.is_file():
        check_model_has_no_side_effects(path, copied=True)
        return Source(path.stem, path.resolve())
    raise BadInput(f"{reference[:80]!r} cannot be derived, allowed: {_ALLOWED}")


def try_out(source: Source) -> tuple[str, ...]:
    """Load and start the model in a process of its own: some models end the process that loads them.

    Returns the properties that its files read and nothing gives; most are FlightGear's. Raises
    SimulationFailed, with what JSBSim says, for a model that cannot be flown with these at 0 either.
    """
    with tempfile.TemporaryDirectory(prefix="beaver-ftc-") as here:
        try:
            return tuple(lacking_in_trial(copy_of(source.model, Path(here) / source.name)))
        except SimulationFailed as error:
            raise SimulationFailed(f"{source.says}: {error}") from None


def _own(source: Source, folder: Path) -> tuple[Path, tuple[str, ...]]:
    """A copy in which nothing fails, and what nothing gives it: 0 there."""
    absent = [name for name in try_out(source) if not is_known_to_jsbsim(name)]
    while True:
        known = tuple(absent)
        own = instrument_model(source.model, folder / f"{len(known)}" / source.name, {}, known)
        probe_model(own, absent)  # what the words of engines are taken from, an engine may not have
        if len(absent) == len(known):
            return own, known


def derive(
    reference: str, out: Path | None = None, envelope: Path | None = None, tell: Tell = lambda line: None,
    regions: Sequence[Envelope] = (), moves: Moves = USUAL,
    engines: bool = False,
) -> Derived:  # fmt: skip
    """Derive the file of an aircraft; `out`: the folder to put its folder into, if not the cache;
    `envelope`: a YAML file that says where to sample; `regions`: parts of it, each about a steady flight of
    its own, where the terms shall hold best near neutral surfaces; `moves`: how far these go;
    `engines`: each is an effector.

    Raises BadInput, naming what is in the way, if its failures cannot be put in or it cannot be trimmed, and
    SimulationFailed if JSBSim cannot fly it.
    """
    started_s, wanted, source = perf_counter(), outline.read_envelope(envelope), source_of(reference)
    target = _target(source, out)
    notes, files = list[str](), dict[str, str]()
    with tempfile.TemporaryDirectory(prefix="beaver-ftc-") as scratch:
        folder = Path(scratch) / "new" / source.name
        if source.folder is None:
            files = where_files_lie(source.model)
            notes += [f"{what} is left out of the copy" for what in left_out_of_copy(source.model)]
            gathered = copy_of(source.model, Path(scratch) / "read" / source.name, layout=True)
            source = replace(source, model=gathered)
        with translated(source.model):
            (data, plant, trim), pair = _prepared(source, folder, wanted, notes, tell, engines)
            notes += outline.not_affine(plant, trim)
            further = outline.further_surfaces(source.model, plant, pair.surfaces.names) if pair else {}
            if moving := outline.moved_by_itself(plant.aircraft, trim, tuple(further)):
                raise BadInput(
                    f"{source.says}: {', '.join(moving)} moves by itself in steady flight, and its "
                    "aerodynamics depend on it, allowed: surfaces that move by command"
                )
            off = _compared(source, pair, data["envelope"]["airspeed_mps"], notes, tell) if pair else None
            if source.folder is None:
                _set_envelope(data, trim, wanted)
            if wanted.altitude_m is not None or data["envelope"].get("altitude_m") is None:
                data["envelope"]["altitude_m"] = _altitudes_about(trim, plant.aircraft.geometry.span_m)
            usual_rad = outline.WIDE_SIDESLIP_RAD if source.folder else SIDESLIP_RAD
            sideslip_rad = radians(wanted.sideslip_deg) if wanted.sideslip_deg else usual_rad
            about = _regions(data, plant, trim, sideslip_rad, regions)
            made = _derived(data, plant, trim, about, moves, folder, tell)
        aircraft = outline.aircraft_of(data, target)
        as_filed = read_aircraft(source.folder) if source.folder else None
        took_s = perf_counter() - started_s
        found = Derived(aircraft, trim, *made, tuple(notes), as_filed, further, took_s, files, off)
        twice = json.loads(json.dumps(data))  # what is there twice is written twice, not as an alias
        text = yaml.safe_dump(twice, sort_keys=False, default_flow_style=None, width=120)
        (folder / AIRCRAFT_FILE).write_text(first_line_of() + text, encoding="utf-8")
        (folder / PAGE).write_text(page_of(found), encoding="utf-8")
        put_folder(folder, target, compare_all_but=PAGE)  # the page has the time it took
    return found


def _prepared(
    source: Source,
    folder: Path,
    wanted: outline.EnvelopeFile,
    notes: list[str],
    tell: Tell,
    engines: bool = False,
) -> tuple[outline.Level, Pair | None]:
    """An aircraft in level flight, and if it was instrumented, the model and the copy; engines: these as
    effectors."""
    if source.folder is not None:
        if engines:
            raise BadInput(f"{source.says}: has a file, allowed: `effectors` in it, or a JSBSim model alone")
        tell("trim")
        return outline.level_as_filed(source.folder, folder, wanted), None
    tell("instrument")
    own, absent = _own(source, folder.parent.parent / "own")
    if absent:
        notes.append(f"JSBSim alone gives it no {', '.join(absent)}: 0 in the copy")
    named = {str(surface): names for surface, names in wanted.surfaces.items()}
    surfaces = find_surfaces(source.model, own, named)
    notes += surfaces.notes
    said, along = outline.own_control(source.model, own, surfaces)
    notes += said
    travel, views = surfaces.travel, surfaces.views
    model = instrument_model(source.model, folder, travel, absent, apart=engines, views=views)
    outlines = [outline.outline(source.name, model, travel, lift) for lift in outline.LIFT_COEFFICIENTS]
    for data in outlines:
        if wanted.altitude_m is not None:
            data["start"]["altitude_m"] = wanted.altitude_m
        if wanted.airspeed_mps is not None:
            data["envelope"]["airspeed_mps"] = list(wanted.airspeed_mps)
    tell("trim")
    tried, said = outlines[: 1 if wanted.airspeed_mps else None], list[str]()
    level = outline.level_flight(tried, folder, said)
    sinks = level[2].gamma_rad <= -outline.LEVEL_RAD and level[1].n_engines
    if sinks and GEAR in seen_by_aerodynamics(source.model):
        shutil.rmtree(folder)
        instrument_model(source.model, folder, travel, absent, gear_up=True, apart=engines, views=views)
        own = instrument_model(source.model, own.parent / "gear-up" / source.name, {}, absent, gear_up=True)
        said = ["its landing gear is retracted in the copy: with it, its power does not hold it level"]
        level = outline.level_flight(tried, folder, said)
    notes += said
    pair = Pair(own, model, surfaces, frozenset(along))
    return _with_engines(source, level, folder) if engines else level, pair


def _compared(
    source: Source, pair: Pair, airspeed_mps: tuple[float, float], notes: list[str], tell: Tell
) -> Difference:
    """Where the copy turns most otherwise than the model.

    Raises BadInput, with the cause, where it would be another aircraft; a cause that is known is noted.
    """
    tell("compare")
    found, noted = differences(pair.own, pair.copy, pair.surfaces, airspeed_mps), set[tuple[str, ...]]()
    for off in found:
        if isnan(off.share):
            raise BadInput(
                f"{source.says}: its {off.axis} is no finite number in some runs of JSBSim, allowed: a model "
                "that JSBSim can run"
            )
        if off.share > DIFFERENT:
            if not off.because or set(off.because) - pair.along:
                raise BadInput(
                    f"{source.says}: its copy would fly otherwise, off by {off}, allowed: aerodynamics that "
                    "see its surfaces alone; `surfaces` in the file of --envelope may name more of them"
                )
            if off.because not in noted:
                notes.append(f"its copy is off by {off}; `surfaces` in the file of --envelope may include it")
            noted.add(off.because)
    return max(found, key=lambda off: off.share)


def _with_engines(source: Source, level: outline.Level, folder: Path) -> outline.Level:
    """The same with its engines as effectors. Raises BadInput where they do not turn it."""
    data, plant, trim = level
    thrust = thrust_of(plant, trim)
    found = effectors_of(plant, trim) if thrust and max(map(max, thrust["force_n"])) > 0.0 else {}
    if not any(abs(of["right_m"]) > LEAST_ARM_M for of in found.values()):
        raise BadInput(f"{source.says}: its engines do not yaw it, allowed: engines beside one another")
    data["engine"] |= {"thrust": thrust}
    data["effectors"] = found
    data["damage"] = {f"{name}-at-idle": {"property": AT_IDLE.format(i=i)} for i, name in enumerate(found)}
    return data, outline.plant_of(data, folder), trim


def _regions(
    data: outline.Data, plant: Plant, trim: TrimPoint, sideslip_rad: float, wanted: Sequence[Envelope]
) -> list[Region]:
    """Where to sample: the whole envelope about the trim, or parts of it, each about a trim of its own."""
    low, high = map(radians, data["envelope"]["alpha_deg"])
    of = data["envelope"]
    lowest, highest = of["altitude_m"]
    altitudes = max(lowest - BEYOND_M, 0.0), highest + BEYOND_M
    whole = Envelope(tuple(of["airspeed_mps"]), (low, high), sideslip_rad, altitudes)
    if not wanted:
        return [Region(whole, trim)]
    middles = [0.5 * sum(of.airspeed_mps) for of in wanted]
    trims = [trim_at(middle, trim.altitude_m, plant, **trim.settings) for middle in middles]
    return [Region(of, point) for of, point in zip(wanted, trims, strict=True)]


def _derived(
    data: outline.Data, plant: Plant, trim: TrimPoint, about: Sequence[Region], moves: Moves, folder: Path,
    tell: Tell,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Sample, fit and check, and find the thrust meanwhile; the data get their terms, errors and thrust.
    Returns the largest errors, (3,) rad/s2."""
    declared = {name: of["property"] for name, of in data["signals"].items()}
    known = {name: of for name, of in SIGNAL_PROPERTIES.items() if plant.has(of)}
    properties = declared or known
    tell("sample")
    flown = fly_about_all(plant, about, 3, properties)
    first = sample_all(plant, about, SAMPLES, 1, properties, FRESH, moves)
    if not declared:
        wanted = engine_signals(first, flown, plant.aircraft)
        wanted += [THRUST_SIGNAL] if plant.aircraft.effectors else []
        useful = signals_of_use(first, plant.aircraft, MAX_SIGNALS, wanted)
        data["signals"] = {name: {"property": properties[name]} for name in useful}
    tell("fit")
    weight = nearness(first, len(about), moves) if len(about) > 1 else None
    data["moments"] = outline.named_as(plant.aircraft, _moments(first, data, folder, weight))
    tell("check")
    with Forks() as forks:
        if unknown := THRUST_TERM not in plant.aircraft.terms:
            forks.submit(lambda: thrust_of(outline.plant_of(data, folder), trim))
        made = _check(data, plant, about, moves, folder, properties, (first, flown))
        if unknown:
            tell("engines")
            (thrust,) = forks.results()
            data["engine"] |= {"thrust": thrust} if thrust else {}
    return made


def _check(
    data: outline.Data, plant: Plant, about: Sequence[Region], moves: Moves, folder: Path,
    properties: Mapping[str, str], sampled: tuple[Samples, Samples],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Measure the errors of the terms, in the states of the fit and in flights, and in states not seen; the
    data get them. Returns the largest ones of the fit's states and of those not seen, (3,) rad/s2."""
    first, flown = sampled
    aircraft = outline.aircraft_of(data, folder)
    # Of several regions by random states alone: what a search finds in their corners no flight of the
    # benchmarks came to, and it takes from the diagnosis what boxes by region give.
    of_one = len(about) == 1
    checked, ages = (CHECKED, AGES_OF_WORST) if of_one else (CHECKED_OF_REGIONS, EVERY_AGE)
    errors = partial(errors_of, aircraft) if of_one else None
    other = sample_all(plant, about, checked, 2, properties, ages, moves, errors)
    data["model_error_map"], (of_fit, of_check, _) = map_of(
        aircraft, (first, other), flown, len(about), moves
    )
    if plant.aircraft.effectors:
        alike = sample_all(plant, about, SAMPLES, 3, properties, moves=replace(moves, apart=0.0))
        set_engines_apart(data["model_error_map"]["boxes"], plant.aircraft, alike)
    outermost = data["model_error_map"]["boxes"][-len(about) :]
    largest = {axis: max(box[f"error_{axis}_rad_s2"][0][-1] for box in outermost) for axis in "pqr"}
    data["model_error_rad_s2"] = largest
    return of_fit, of_check


def _moments(samples: Samples, data: outline.Data, folder: Path, weight: np.ndarray | None) -> outline.Data:
    """The terms: as many as the evaluator has room for."""
    bare = {name: value for name, value in data.items() if name != "model_error_map"}
    any_term = {"name": "Cl_any", "value": 1.0, "surface": next(iter(data["surfaces"]))}
    aircraft = outline.aircraft_of(bare | {"moments": {"Cl": [any_term]}}, folder)
    for most in range(MOST_TERMS if weight is None else MAX_TERMS_OF_ONE, FEWEST_TERMS - 1, -4):
        terms = fitted(samples, aircraft, most, weight)
        with suppress(ValueError):  # too many products
            design_record(outline.aircraft_of(bare | {"moments": terms}, folder))
            return terms
    raise BadInput(f"{aircraft.name}: its terms need more than {MAX_MONOMIALS} products of signals")


def _set_envelope(data: outline.Data, trim: TrimPoint, wanted: outline.EnvelopeFile) -> None:
    """Let the file's envelope be about trim, or what is wanted, and flights start there."""
    about = [degrees(trim.alpha_rad + way * SPAN_OF_ALPHA_RAD) for way in (-1, 1)]
    data["envelope"]["alpha_deg"] = wanted.alpha_deg or about
    for name, ends in data["envelope"].items():
        data["envelope"][name] = [float(f"{end:.4g}") for end in ends]
    data["start"]["airspeed_mps"] = float(f"{trim.airspeed_mps:.4g}")


def _altitudes_about(trim: TrimPoint, span_m: float) -> list[float]:
    """The altitudes of the envelope, m; none so low that the ground, at sea level, takes part in what is
    sampled."""
    lowest = max(trim.altitude_m - ALTITUDE_M, LOWEST_M, SPANS_ABOVE_GROUND * span_m) + BEYOND_M
    return [round(lowest, 1), round(max(trim.altitude_m + ALTITUDE_M, lowest + BEYOND_M), 1)]


def _target(source: Source, out: Path | None) -> Path:
    """Where the folder goes. Raises BadInput where something else is, or nobody said where."""
    target = out / source.name if out else source.target
    if target is None:
        raise BadInput(f"{source.name}: give --out DIR, the folder to write {source.name}/ into")
    file = target / AIRCRAFT_FILE
    derived = file.is_file() and file.read_text(encoding="utf-8").startswith(DERIVED_FORMAT)
    if target.exists() and not derived:
        raise BadInput(f"{target} is there already and was not derived, allowed: another folder")
    return target
