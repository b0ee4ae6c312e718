"""Turns a scenario into the frame record that the compiled loop works on."""

from functools import lru_cache
from math import ceil, exp, pi, radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.control.accommodation import assessment_dtype, true_faults_dtype
from beaver_ftc.control.allocation import leaders_of
from beaver_ftc.control.outer.state import AUTOPILOT, COLUMNS
from beaver_ftc.control.state import configure, control_dtype
from beaver_ftc.control.supervisor import SUPERVISOR
from beaver_ftc.design.variants import design_of, mass_of
from beaver_ftc.diagnosis.belief import belief_dtype
from beaver_ftc.diagnosis.bounds.declared import admit, admit_engine, gyros_vary, poles_for_noise
from beaver_ftc.diagnosis.bounds.worst_case import fill_error_map
from beaver_ftc.diagnosis.isolation import PARAMETER_SET
from beaver_ftc.diagnosis.scheme import diagnosis_dtype
from beaver_ftc.diagnosis.state import (
    EITHER,
    INTERVAL,
    LOSS,
    NOT_ISOLATED,
    PITCH,
    POSITION,
    PUBLISHED,
    STATISTICS,
    WORST_CASE,
    verdict_dtype,
)
from beaver_ftc.diagnosis.types.pairs import IN_PITCH, IN_ROLL_AND_YAW
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop import memory
from beaver_ftc.loop.accounts import accounts_dtype
from beaver_ftc.loop.instrument_records import (
    assemble_instruments,
    assemble_watch,
    breaks_instruments,
    comes_to_be_watched,
    seed_instruments,
    truth_read,
)
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.instruments import INSTRUMENTS
from beaver_ftc.plant.native import RUNNING
from beaver_ftc.plant.sensing import MEASURED, truth_dtype
from beaver_ftc.scenario.actuators import Actuators
from beaver_ftc.scenario.control import ControlConfig
from beaver_ftc.scenario.diagnosis import MAX_POLES, FdiConfig
from beaver_ftc.scenario.keys import texts_of
from beaver_ftc.scenario.schema import Scenario

BLOCK_S = 0.2  # to be examined at once where gyros are noisy: short beside the slowest half-cycle, 3.1 s
RUNAWAY_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default
EARTH_RATE_RAD_S = 2.0 * pi / 86164.0905  # one turn per sidereal day [WGS84]
_AUTHORITIES = {"either": EITHER, "worst-case": WORST_CASE, "statistical": STATISTICS}
_THRESHOLDS = {"interval": INTERVAL, "published": PUBLISHED}

# What the log has columns for: estimators, the watch, the engine, statistical tests.
LOGGED = np.dtype([("estimators", "i8"), ("watch", "i8"), ("power", "i8"), ("tests", "i8")], align=True)


@lru_cache
def frame_dtype(n: int) -> np.dtype:
    """All that a flight of an aircraft with n surfaces remembers between frames."""
    fields = [
        ("k", "i8"), ("row", "i8"), ("dt", "f8"), ("t", "f8"),  # frame, row of the log, s, s
        ("running", RUNNING),
        ("since", "i8"), ("logged", LOGGED),  # the frame with which this diagnosis has begun
        ("truth", truth_dtype(n)), ("instruments", INSTRUMENTS), ("measured", MEASURED),
        ("belief", belief_dtype(n)), ("fdi", diagnosis_dtype(n)), ("verdict", verdict_dtype(n)),
        ("assessment", assessment_dtype(n)), ("faults", true_faults_dtype(n)),
        ("supervisor", SUPERVISOR), ("control", control_dtype(n)),
        ("autopilot", AUTOPILOT),
        ("held", "i8"), ("held_rad", "f8", (n,)),  # whether another than the law commands, and what
        ("accounts", accounts_dtype(n)), ("departed", "i8"),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


def idle(fdi: FdiConfig) -> list[tuple[str, ...]]:
    """Large fields that are not read before they are written: delay lines are filled by the first sample."""
    parts = {"block": bool(fdi.statistical), "views": bool(fdi.statistical) and fdi.fault_class == "all"}
    unused = [("fdi", "statistical", part) for part, used in parts.items() if not used]
    return [("instruments", "line"), *unused]


Member = tuple[str, int, int]  # of a fault class: name, kind and surface of its estimator


def members_of(fault_class: str, aircraft: Aircraft) -> tuple[Member, ...]:
    """The isolation estimators of a fault class, in the bank's order.

    published: a loss of the surface that leads each axis. all: a loss and a position of every surface.
    """
    index = {name: s for s, name in enumerate(aircraft.surfaces)}
    losses = tuple((name, LOSS, index[name]) for name in aircraft.primary)
    if fault_class == "published":
        return losses
    others = tuple((name, LOSS, s) for name, s in index.items() if name not in aircraft.primary)
    return (*losses, *others, *((f"{name}_position", POSITION, s) for name, s in index.items()))


def estimator_names(fault_class: str, aircraft: Aircraft) -> tuple[str, ...]:
    """Names of the isolation estimators of a fault class, in the bank's order."""
    return tuple(name for name, _, _ in members_of(fault_class, aircraft))


def _assemble_diagnosis(
    fdi: np.void, config: FdiConfig, dt: float, reach: np.ndarray, aircraft: Aircraft
) -> None:
    shared, isolation = fdi["config"], fdi["isolation"]
    shared["enabled"], shared["dt"] = config.is_ours, dt
    shared["authority"], shared["every_type"] = _AUTHORITIES[config.authority], config.fault_class == "all"
    shared["abrupt"] = config.fault_profile == "abrupt"
    isolation["thresholds"] = _THRESHOLDS[config.thresholds]
    isolation["forgetting"] = exp(-dt / config.forgetting_time_s)
    fdi["fdae"]["pole"] = config.detection_pole_per_s
    fdi["fdae"]["decay"] = exp(-config.detection_pole_per_s * dt)
    isolation["decay"] = exp(-config.isolation_pole_per_s * dt)
    _assemble_bound(fdi["bound"], config, aircraft)
    fdi["verdict"]["detected_at_s"] = fdi["verdict"]["isolated_at_s"] = -1.0
    fdi["verdict"]["isolated"] = NOT_ISOLATED
    members = members_of(config.fault_class, aircraft)
    isolation["n"] = len(members)
    _assemble_layout(fdi["layout"], members, aircraft)
    for fie, (_, kind, surface) in zip(isolation["estimator"], members, strict=False):
        fie["kind"], fie["surface"] = kind, surface
        fie["low"], fie["high"] = PARAMETER_SET[kind] if kind == LOSS else reach[:, surface]


def _assemble_bound(bound: np.void, config: FdiConfig, aircraft: Aircraft) -> None:
    """The declared bound, and what the aircraft's terms leave: where it is mapped, or everywhere the same."""
    bound["inertia"], bound["earth_rate"] = config.bounds.inertia_coupling.as_tuple(), EARTH_RATE_RAD_S
    bound["constant"] = config.bounds.constant_rad_s2.as_tuple()
    fill_error_map(bound["error_map"], aircraft, whole=config.fault_class == "all")
    if aircraft.file.model_error_map is None:
        bound["constant"] += aircraft.model_error_rad_s2


def _assemble_types(frame: np.void, scenario: Scenario, dt: float, travel: np.ndarray) -> None:
    config, fdi, actuators = scenario.fdi, frame["fdi"], frame["belief"]["actuators"]
    types = fdi["types"]
    going_by = types["config"]
    going_by["length"] = block = ceil(BLOCK_S / dt) if gyros_vary(config.bounds.sensors) else 1
    going_by["whole"], going_by["span_s"] = scenario.substeps == 1 and block == 1, block * dt
    going_by["patience"] = ceil(pi / config.slowest_oscillation_rad_s / (block * dt))
    verdict = fdi["verdict"]
    verdict["type"] = verdict["lead"] = verdict["lead_kind"] = verdict["type_at_s"] = -1
    types["pair"]["first"], types["pair"]["enabled"] = -1, config.pairs
    if config.pairs:
        _assemble_pairs(fdi, scenario.airframe)
    fdi["config"]["instants"] = going_by["instants"] = scenario.substeps
    going_by["returns"], going_by["dt"] = actuators["real"], dt
    going_by["abrupt"] = config.fault_profile == "abrupt"
    surfaces, instant_s = scenario.airframe.surfaces, dt / scenario.substeps
    for s, (name, place, low, high) in enumerate(zip(surfaces, types["surface"], *travel, strict=True)):
        place["travel_low"], place["travel_high"] = low, high
        place["reach_low"], place["reach_high"] = min(low, 0.0), max(high, 0.0)
        place["in_question"] = not config.pairs or fdi["layout"]["group"][s] == IN_PITCH
        place["measure"], place["type"] = -1, -1
        place["approach"], place["step"] = actuators["approach"][s], actuators["step"][s]
        rate_deg_s = getattr(scenario.actuators, name).rate_limit_deg_s
        place["least_runaway_rate"] = 0.5 * (radians(rate_deg_s) or RUNAWAY_RATE_RAD_S)
        place["slowest_step"] = min(radians(config.slowest_rate_deg_s) * instant_s, place["step"])


def _assemble_pairs(fdi: np.void, aircraft: Aircraft) -> None:
    """Each plane is asked for itself: pitch by its two surfaces, roll and yaw by theirs."""
    if sorted(fdi["layout"]["group"]) != [IN_PITCH, IN_PITCH, IN_ROLL_AND_YAW, IN_ROLL_AND_YAW]:
        raise BadInput(
            f"fdi.pairs: {aircraft.name} has not two surfaces in pitch, two in roll and yaw, allowed: false"
        )
    for fie in fdi["isolation"]["estimator"][: fdi["isolation"]["n"]]:
        fie["unasked"] = (1, 0, 1) if fdi["layout"]["group"][fie["surface"]] == IN_PITCH else (0, 1, 0)


def _assemble_layout(layout: np.void, members: tuple[Member, ...], aircraft: Aircraft) -> None:
    """Axes, groups and estimators of the surfaces."""
    index = {name: s for s, name in enumerate(aircraft.surfaces)}
    layout["main"] = leaders_of(aircraft)
    layout["dominant_axis"] = aircraft.dominant_axis
    layout["group"] = [IN_PITCH if axis == PITCH else IN_ROLL_AND_YAW for axis in aircraft.dominant_axis]
    layout["partner"] = layout["loss_of"] = layout["position_of"] = -1
    for names in aircraft.groups.values():
        for name, other in zip(names, names[::-1], strict=True):
            layout["partner"][index[name]] = index[other] if other != name else -1
    for e, (_, kind, surface) in enumerate(members):
        layout["loss_of" if kind == LOSS else "position_of"][surface] = e


def _assemble_sharpening(fdi: np.void, config: FdiConfig, dt: float) -> None:
    sharpen = config.sharpen
    isolation = fdi["isolation"]
    isolation["memory"], isolation["shared"] = sharpen.memory, sharpen.shared_effectiveness
    isolation["membership"] = sharpen.set_membership
    bank = (
        *config.pole_bank_per_s,
        *poles_for_noise(config.bounds.sensors, max(config.bounds.constant_rad_s2.as_tuple())),
    )
    poles = (config.detection_pole_per_s, *(bank if sharpen.pole_bank else ()))[:MAX_POLES]
    fdi["bank"]["n"] = len(poles)
    fdi["bank"]["decay"][: len(poles)] = [exp(-pole * dt) for pole in poles]


def _assemble_network(network: np.void, config: ControlConfig) -> None:
    network["gain"] = config.network_gain_per_s2
    network["leak_per_s"] = config.network_leak_per_s
    network["weight_limit"] = config.network_weight_limit_rad_s2


def _assemble_actuators(
    actuators: np.void, given: Actuators, dt: float, travel: np.ndarray, surfaces: tuple[str, ...]
) -> None:
    """dt: s, a JSBSim frame; travel (2, n) rad."""
    actuators["real"] = not given.is_ideal
    actuators["low"], actuators["high"] = travel
    for s, surface in enumerate(surfaces):
        dynamics = getattr(given, surface)
        bandwidth, rate = dynamics.bandwidth_rad_s, radians(dynamics.rate_limit_deg_s)
        actuators["approach"][s] = 1.0 - exp(-bandwidth * dt) if bandwidth else 1.0
        actuators["step"][s] = rate * dt if rate else np.inf


def _assemble_admitted(frame: np.void, scenario: Scenario) -> None:
    """The errors that `fdi.bounds` declares beside the published ones."""
    admitted = frame["fdi"]["bound"]["admitted"]
    mass = mass_of(scenario.design_model, scenario.airframe)
    admit(admitted, scenario.fdi.bounds, scenario.airframe, frame["belief"]["design"], mass)
    admit_engine(admitted, scenario)
    own_errors = admitted["any"] and scenario.fdi.fault_class == "all"
    frame["fdi"]["bound"]["own_errors"] = frame["fdi"]["types"]["config"]["own_errors"] = own_errors
    if scenario.fdi.pairs and frame["fdi"]["types"]["config"]["length"] > 1:
        raise BadInput(
            f"{scenario.name}: fdi.pairs is not available with errors of the gyros that vary declared in "
            "fdi.bounds.sensors, allowed: a bias"
        )


_DESIGN = ("fdi", "control", "design_model", "actuators", "sensors")
_MOST_DESIGNS = 32
_designs: dict[tuple[object, ...], memory.Packed] = {}


def assemble(scenario: Scenario, trim: np.ndarray, travel: np.ndarray) -> np.ndarray:
    """The frame record, shape (1,), of a flight about to start.

    trim (4,) rad: the surfaces in trim; travel (2, 4) rad: lower and upper stops. The truth's nodes are
    attached by the loop. A copy of the record of its design, which is assembled once.
    """
    initial = tuple(scenario.initial.model_dump(exclude={"airspeed_mps"}).values())
    rates, failing = (scenario.rate_hz, scenario.substeps), breaks_instruments(scenario)
    key = scenario.airframe, texts_of(scenario, _DESIGN), rates, failing, initial, travel.tobytes()
    if key not in _designs:
        if len(_designs) >= _MOST_DESIGNS:
            _designs.clear()
        _designs[key] = memory.packed(_assemble_design(scenario, travel), idle(scenario.fdi))
    frames = memory.unpacked(_designs[key])
    frame = frames[0]
    frame["belief"]["u"] = frame["belief"]["commanded"] = trim
    frame["control"]["layout"]["trim"] = frame["control"]["allocation"]["command"] = trim
    seed_instruments(frame["instruments"], scenario.seed)
    return frames


def _assemble_design(scenario: Scenario, travel: np.ndarray) -> np.ndarray:
    """What does not depend on the trim, the seed and the truth."""
    airframe = scenario.airframe
    frames = memory.taken_empty((1,), frame_dtype(airframe.n))
    frame, dt = frames[0], 1.0 / scenario.rate_hz
    belief, truth = frame["belief"], frame["truth"]
    frame["dt"], belief["share"] = dt, 1.0 / scenario.substeps
    belief["design"] = design_of(scenario.design_model, airframe)[0]
    channels = truth_read(scenario)
    truth["n"], truth["declared"] = len(channels), len(airframe.signals)
    truth["factor"][: len(channels)] = [factor for _, _, factor in channels]
    frame["accounts"]["guarantee"]["certain_after_s"] = -1.0
    jsbsim_dt = dt / scenario.substeps
    assemble_instruments(frame, scenario, jsbsim_dt)
    assemble_watch(frame["fdi"]["watch"], scenario, jsbsim_dt)
    _assemble_actuators(belief["actuators"], scenario.actuators, jsbsim_dt, travel, airframe.surfaces)
    reach = np.array([np.minimum(travel[0], 0.0), np.maximum(travel[1], 0.0)])  # a share of it can be left
    _assemble_diagnosis(frame["fdi"], scenario.fdi, dt, reach, airframe)
    _assemble_types(frame, scenario, dt, travel)
    _assemble_admitted(frame, scenario)
    _assemble_sharpening(frame["fdi"], scenario.fdi, dt)
    _assemble_network(frame["fdi"]["fdae"]["network"], scenario.control)
    configure(frame["control"], scenario, travel)
    return frames


def y_places(frame: np.void) -> list[int]:
    """Where in the truth the measured signals beside the rates are: y without noise, (4 + declared,)."""
    first = ch.POS + 3 * frame["belief"]["u"].size
    return [ch.ALPHA, ch.BETA, ch.AIRSPEED, ch.QDYN, *range(first, first + int(frame["truth"]["declared"]))]


def lay_out(frame: np.void, scenario: Scenario, diagnoses_itself: bool) -> tuple[str, ...]:
    """Note in a flight's record what there are columns for; returns their names."""
    fdi, logged, profile = frame["fdi"], frame["logged"], bool(frame["autopilot"]["enabled"])
    tested = bool(fdi["statistical"]["tests"]["enabled"])
    logged["estimators"] = fdi["isolation"]["n"] if diagnoses_itself else 0
    logged["watch"] = comes_to_be_watched(scenario)
    logged["power"] = frame["control"]["power"]["enabled"] or profile
    logged["tests"] = fdi["statistical"]["tests"]["n_columns"] if tested else 0
    return ch.log_columns(
        estimator_names(scenario.fdi.fault_class, scenario.airframe) if diagnoses_itself else (),
        bool(logged["power"]),
        tested,
        scenario.airframe,
        profile=COLUMNS if profile else (),
        watch=bool(logged["watch"]),
    )
