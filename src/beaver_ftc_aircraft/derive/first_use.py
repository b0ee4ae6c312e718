"""An aircraft that a scenario names for the first time: derived, or its file compared with its JSBSim model.

The comparison is of the angular accelerations, after the core has admitted the aircraft. The user's cache
keeps the differences under the digest of the folder's files: they are computed again only after a file has
changed.
"""

import contextlib
import json
import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import version
from math import degrees

import numpy as np

from beaver_ftc.aircraft import AIRCRAFT_FILE as FILE
from beaver_ftc.aircraft import AXES, FROM_JSBSIM, Aircraft, is_derived
from beaver_ftc.design import inertia_coefficients
from beaver_ftc.documents import BeaverFtcError, cache_base, read_json
from beaver_ftc.plant import Plant, digest_of_aircraft, translated
from beaver_ftc.plant import trim_plant as trim
from beaver_ftc.scenario import Bounds
from beaver_ftc.studies.engine import write_whole
from beaver_ftc_aircraft.derive.derivation import derive, source_of
from beaver_ftc_aircraft.derive.fit import errors_of
from beaver_ftc_aircraft.derive.outline import usual_start
from beaver_ftc_aircraft.derive.sample import FRESH, SIDESLIP_RAD, Envelope, Moves, Samples, sample, sorted_in

STATES, STARTS, SEED = 800, 8, 11


def derive_if_needed(reference: str) -> None:
    """Derive `jsbsim:NAME` if the cache has it not, or as an earlier version made it. Raises as `derive`."""
    if not is_derived(reference.removeprefix(FROM_JSBSIM)):
        source_of(reference)  # raises for what is no aircraft, before anything is promised
        _say(f"{reference}: deriving its design model, once; some seconds")
        derive(reference)


@lru_cache(maxsize=32)
def compare_once(aircraft: Aircraft) -> None:
    """Say, once a process, where the file and the model of an aircraft differ."""
    for line in kept_or_compared(aircraft):
        _say(f"{aircraft.folder.name}/{FILE}: warning: {line}")


def _say(line: str) -> None:
    print(f"beaver-ftc: {line}", file=sys.stderr, flush=True)


def kept_or_compared(aircraft: Aircraft) -> list[str]:
    """A line for each axis on which the model exceeds what the file declares, found now or earlier."""
    base = cache_base()
    if base is None:
        return compared(aircraft)
    file = base / "compared" / f"{digest_of_aircraft(aircraft.folder)}-{version('jsbsim')}.json"
    try:
        return list(read_json(file))
    except (OSError, ValueError):
        lines = compared(aircraft)
    with contextlib.suppress(OSError):  # nowhere to keep it, or another process was first
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(lines).encode())
    return lines


def compared(aircraft: Aircraft) -> list[str]:
    """A line for each axis on which the model exceeds what the file declares; or why none is compared."""
    plant = Plant(100, aircraft=aircraft)
    try:
        with translated(aircraft.jsbsim):
            samples = _samples(aircraft, plant)
    except BeaverFtcError as error:
        return [f"it is not compared with {aircraft.file.jsbsim}: {error}"]
    return list(_lines(aircraft, samples))


def _samples(aircraft: Aircraft, plant: Plant) -> Samples:
    """States over the envelope, in their boxes if the file has a map."""
    point = trim(plant=plant, **usual_start(aircraft))
    of = aircraft.envelope
    envelope = Envelope(of.airspeed_mps, aircraft.alpha_rad, SIDESLIP_RAD, of.altitude_m)
    properties = {name: signal.property for name, signal in aircraft.signals.items()}
    samples = sample(plant, envelope, point, STATES, SEED, properties, FRESH, STARTS)
    error_map = aircraft.file.model_error_map
    if error_map is None:
        return samples
    ends = [np.array(box.ends(aircraft.signals)).T for box in error_map.boxes]
    return sorted_in(samples, ends, aircraft, Moves(error_map.travel_share, error_map.stand_ins))


def _declared(aircraft: Aircraft, samples: Samples) -> np.ndarray:
    """The error the file declares at each state, and what every scenario does beside it, (n, 3) rad/s2."""
    bounds, (p, q, r), i = Bounds(), np.abs(samples.x.T), inertia_coefficients(aircraft.mass)
    coupling = np.column_stack([abs(i.Pqr) * q * r, abs(i.Qpr) * p * r, abs(i.Rpq) * p * q])
    published = [getattr(bounds.constant_rad_s2, axis) for axis in AXES]
    published += coupling * [getattr(bounds.inertia_coupling, axis) for axis in AXES]
    error_map = aircraft.file.model_error_map
    if error_map is None:
        return published + np.array(aircraft.model_error_rad_s2)
    fresh = [[getattr(box, f"error_{axis}_rad_s2")[0] for axis in AXES] for box in error_map.boxes]
    return published + np.array(fresh)[samples.box, :, samples.level]


def _lines(aircraft: Aircraft, samples: Samples) -> Iterator[str]:
    errors, declared = errors_of(aircraft, samples), _declared(aircraft, samples)
    for axis, name in enumerate(AXES):
        beyond = errors[:, axis] - declared[:, axis]
        if len(beyond) and beyond.max() > 0.0:
            worst = int(beyond.argmax())
            alpha, beta, V = samples.y[worst, :3]
            at = f"{V:.3g} m/s, angle of attack {degrees(alpha):.1f}, sideslip {degrees(beta):.1f} deg"
            yield (
                f"{name}: the terms are {errors[worst, axis]:.2g} rad/s2 off {aircraft.file.jsbsim} at {at}; "
                f"{declared[worst, axis]:.2g} is declared, so alarms without a fault are possible; "
                "`beaver-ftc derive` measures what to declare"
            )
