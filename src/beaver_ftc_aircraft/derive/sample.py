"""States of an aircraft over its envelope, and the angular accelerations JSBSim has there.

The states fill boxes about the trim, one inside the other. The aircraft is started at some settings of its
engines, tanks and altitudes; at each of these time stands still, and the state goes from place to place. They
hold nothing of what changes by itself: beside them are states as the aircraft comes through them in flight,
from trim, its surfaces moved a little by sines: engines turn, the air lags, fuel burns. States where a
model is worst are looked for, from the worst of random ones on.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from beaver_ftc.aircraft import AXES, FLOW_SIGNALS, M_PER_FT, Aircraft
from beaver_ftc.plant import PA_PER_PSF, FlightState, Plant, translated
from beaver_ftc.studies.engine import Forks

REACHES = (0.25, 0.5, 0.75, 1.0)  # of the boxes, as shares of the envelope's half widths
SHARES = (0.15, 0.35, 0.65, 1.0)  # of the surfaces' travel
AGES_S = (120.0, 900.0, 7200.0)  # of a flight: fuel burns, and inertia with it
FRESH = (0,)
SIDESLIP_RAD = 0.15  # the usual half width
RATES_RAD_S = (0.60, 0.35, 0.35)  # half widths
EVERY_AGE = (0, 0, 1, 0, 0, 2)
AGES_OF_WORST = (0, 1, 0, 2)
STARTS, STARTS_OF_WORST = 48, 96
# Of the angular accelerations, from one look at a state to the next: since each changes them by less than a
# tenth of what the one before did, what is left is less than the error of their rounding in the file.
STILL_RAD_S2 = 1e-6
AT_AN_END = 0.3  # share of the draws that are at an end of their range: corners are where errors are large
ALTITUDE_M = 1500.0  # half width of what is derived, about the trim's
_BANK_RAD, _CLIMB_RAD, _ALTITUDE_M, _THROTTLE = 1.0, 0.3, 600.0, 0.35  # half widths beside the envelope's
_APART, _APART_RAD_S = 0.6, 0.8  # of engines that are effectors: their levers, and how they swing in flight
_MOST_BURNT = 0.9  # of the fuel
FRAMES, EVERY = 800, 4
_ATTITUDE = ("phi_rad", "climb_rad")  # which no moment knows of
_CLIMB_FROM, _CLIMBS = 12, 2  # states; steps from the worst of them
_BEFORE_S = 30.0  # in which engines come to run
_SHARE_OF_TRAVEL = 0.06
_FREQUENCIES_HZ = (0.2, 0.5, 1.1)
_SI = np.array([1.0, 1.0, M_PER_FT, PA_PER_PSF])  # of what is read of the flow
_SPEEDS = (1.0, 1.0, 0.95, 1.05, 1.0, 1.0)  # as shares of the trim's


@dataclass(frozen=True)
class Envelope:
    """Where states are drawn: between these ends, and so far to either side in sideslip. altitude_m: alike
    in all
    boxes; left out, about the trim's. of_region: airspeed and engine settings are alike in all boxes too;
    rates and
    sideslip then come closer to the whole, since what they add to the error is little."""

    airspeed_mps: tuple[float, float]
    alpha_rad: tuple[float, float]
    beta_rad: float
    altitude_m: tuple[float, float] | None = None
    of_region: bool = False


@dataclass(frozen=True)
class Moves:
    """How far surfaces are moved: shares of their travel, rising to 1; of these but the last, how much
    those that stand in use. apart: how far engines' levers are from one another, if they have any."""

    shares: tuple[float, ...] = SHARES
    stand_ins: float = 1.0
    apart: float = _APART

    def seldom(self, aircraft: Aircraft) -> np.ndarray:
        """Of each surface, how much of a share that is not the last, (surfaces,)."""
        return np.array([self.stand_ins if s in aircraft.stand_ins else 1.0 for s in aircraft.surfaces])


USUAL = Moves()


@dataclass(frozen=True)
class Region:
    """Part of what an aircraft flies, about a steady flight of its own."""

    envelope: Envelope
    trim: FlightState


@dataclass(frozen=True)
class Samples:
    """x (n, 3) rad/s, y (n, 4): alpha, beta, V, qdyn; signals: of each name (n,); u (n, surfaces) rad,
    rate (n, 3) rad/s2; box, level, age (n,): of the state, the surfaces and the flight, by their index."""

    x: np.ndarray
    y: np.ndarray
    signals: Mapping[str, np.ndarray]
    u: np.ndarray
    rate: np.ndarray
    box: np.ndarray
    level: np.ndarray
    age: np.ndarray

    def at(self, wanted: np.ndarray) -> "Samples":
        """Those that are wanted, (n,)."""
        return _each(lambda arrays: arrays[0][wanted], [self])

    def __len__(self) -> int:
        return len(self.x)


Ends = tuple[float, float]
Place = dict[str, float]
Row = list[float]


def _about(middle: float, half: float) -> Ends:
    return middle - half, middle + half


def _towards(middle: float, ends: Ends, reach: float) -> Ends:
    """Two ends drawn towards the middle, to that share of the way."""
    low, high = (middle + reach * (end - middle) for end in ends)
    return low, high


Errors = Callable[[Samples], np.ndarray]


class Draw:
    """Random states of an aircraft about its trim, often at the ends of their ranges."""

    def __init__(
        self, seed: int, aircraft: Aircraft, envelope: Envelope, trim: FlightState, moves: Moves = USUAL
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.seldom = dict(zip(aircraft.surfaces, moves.seldom(aircraft).tolist(), strict=True))
        self.aircraft, self.envelope, self.trim = aircraft, envelope, trim

    def between(self, low: float, high: float) -> float:
        """One number between two ends."""
        at = self.rng.random()
        if at < AT_AN_END:
            return low if at < 0.5 * AT_AN_END else high
        return float(low + (high - low) * self.rng.random())

    def around(self, middle: float, half: float) -> float:
        """One number about a middle."""
        return self.between(*_about(middle, half))

    def share(self, middle: float, ends: Ends, reach: float) -> float:
        """One number between two ends drawn towards the middle, to that share of the way."""
        return self.between(*_towards(middle, ends, reach))

    def wide(self, reach: float) -> float:
        """The reach in what is alike in all boxes of a region."""
        return 1.0 if self.envelope.of_region else reach

    def broad(self, reach: float) -> float:
        """The reach in what is nearly alike in the boxes of a region."""
        return reach**0.5 if self.envelope.of_region else reach

    def start(self, reach: float, turn: int) -> FlightState:
        """Where the engines come to run, and the aircraft there; turn: how often they have in this box. The
        first
        two turns are at the ends of the altitudes, if these are given, so that every box reaches them."""
        trim, settings = self.trim, {}
        for name, setting in self.aircraft.engine.settings.items():
            (low, high), middle = setting.range, trim.settings[name]
            half = high - low if self.envelope.of_region else _THROTTLE * (high - low)
            ends = max(low, middle - half), min(high, middle + half)
            settings[name] = self.share(middle, ends, self.wide(reach))
        airspeed_mps = self.share(trim.airspeed_mps, self.envelope.airspeed_mps, self.wide(reach))
        ends = self.envelope.altitude_m or _about(trim.altitude_m, reach * _ALTITUDE_M)
        altitude_m = max(self.between(*ends), 0.0)
        if self.envelope.altitude_m and turn < len(ends):
            altitude_m = ends[turn]
        return replace(trim, airspeed_mps=airspeed_mps, altitude_m=altitude_m, settings=settings)

    def ends(self, reach: float, share: float) -> dict[str, Ends]:
        """Between what a state may be placed; reach: of its box; share: of the surfaces' travel."""
        trim, envelope, broad = self.trim, self.envelope, self.broad(reach)
        names = [f"{axis}_rad_s" for axis in AXES]
        used = {n: share * (self.seldom[n] if share < 1.0 else 1.0) for n in self.aircraft.surfaces}
        return {
            "alpha_rad": _towards(trim.alpha_rad, envelope.alpha_rad, reach),
            **{n: _about(0.0, broad * half) for n, half in zip(names, RATES_RAD_S, strict=True)},
            **{n: (used[n] * t.min_rad, used[n] * t.max_rad) for n, t in self.aircraft.travel.items()},
            "airspeed_mps": _towards(trim.airspeed_mps, envelope.airspeed_mps, self.wide(reach)),
            "beta_rad": _about(trim.beta_rad, broad * envelope.beta_rad),
            "phi_rad": _about(trim.phi_rad, _BANK_RAD),
            "climb_rad": _about(0.0, _CLIMB_RAD),
        }

    def place(self, ends: Mapping[str, Ends]) -> Place:
        """Somewhere between these."""
        return {name: self.between(low, high) for name, (low, high) in ends.items()}

    def state(self, started: FlightState, place: Place) -> FlightState:
        """The aircraft there, with the engines as started."""
        theta_rad = self.trim.theta_rad - self.trim.alpha_rad
        return FlightState(
            place["airspeed_mps"], started.altitude_m, alpha_rad=place["alpha_rad"],
            beta_rad=place["beta_rad"], phi_rad=place["phi_rad"],
            theta_rad=theta_rad + place["alpha_rad"] + place["climb_rad"],
            p_rad_s=place["p_rad_s"], q_rad_s=place["q_rad_s"], r_rad_s=place["r_rad_s"],
            surfaces_rad={name: place[name] for name in self.aircraft.surfaces}, settings=started.settings,
        )  # fmt: skip


@dataclass(frozen=True)
class Start:
    """One start of the engines: box and age of the flight, by their index; for how long fuel has burnt, s;
    the levers of engines that are effectors; where the aircraft starts. Then the places at which time
    stands still, each with the share of the travel that it is of; and, of each share, the ends between
    which the largest error is searched for, and the places from which the search begins."""

    box: int
    age: int
    burnt_s: float
    levers: Mapping[str, float]
    state: FlightState
    places: Sequence[tuple[Place, int]]
    searches: Sequence[tuple[Mapping[str, Ends], Sequence[Place]]]


def drawn_start(draw: Draw, k: int, n: int, ages: Sequence[int], moves: Moves, search: bool) -> Start:
    """The k-th start, with so many places; search: whether the largest error is searched for."""
    box, of_box = k % len(REACHES), k // len(REACHES)
    turn, of = divmod(of_box, len(ages))
    age, reach = ages[of], REACHES[box]
    oldest_s = _BEFORE_S + AGES_S[age]
    burnt_s = draw.between(oldest_s if turn % 2 else AGES_S[age - 1] if age else 0.0, oldest_s)
    state = draw.start(reach, of_box)
    levers = {lever: draw.around(0.0, reach * moves.apart) for lever in _levers(draw.aircraft)}
    ends = [draw.ends(reach, share) for share in moves.shares]
    levels = [i % len(ends) for i in range(n)]
    places = [(draw.place(ends[level]), level) for level in levels]
    first = [[draw.place(of) for _ in range(_CLIMB_FROM)] for of in ends] if search else []
    return Start(box, age, burnt_s, levers, state, places, list(zip(ends, first, strict=False)))


class _Standing:
    """An aircraft for which time stands still, put from place to place; what it is there is kept as rows."""

    def __init__(self, plant: Plant, draw: Draw, reader: "Reader", tanks: "Tanks") -> None:
        self.plant, self.draw, self.reader, self.tanks = plant, draw, reader, tanks
        self.rows: list[Row] = []

    def begin(self, start: Start) -> None:
        """Start the engines there."""
        self.tanks.fill(self.plant, start.burnt_s)
        for lever, difference in start.levers.items():
            self.plant.write(lever, difference)
        self.plant.start(start.state)
        self.start, self.rows = start, []

    def look(self, errors: Errors | None) -> np.ndarray:
        """The rows of the drawn places, and of those where errors are large."""
        for place, level in self.start.places:
            self.put(place, level)
        if errors is not None:
            _search(self, errors)
        return np.array(self.rows)

    def pass_over(self) -> None:
        """Go on as if the places had been looked at."""
        for place, _ in self.start.places:
            self.plant.pass_over(self.draw.state(self.start.state, place))

    def put(self, place: Place, level: int) -> None:
        """Look at one place, with the surfaces within a share of their travel."""
        self.plant.hold(self.draw.state(self.start.state, place), STILL_RAD_S2)
        self.rows.append(self.reader.row(self.start.box, level, self.start.age))


def sample(
    plant: Plant, envelope: Envelope, trim: FlightState, n: int, seed: int, properties: Mapping[str, str],
    ages: tuple[int, ...] = EVERY_AGE, starts: int = STARTS, moves: Moves = USUAL,
    errors: Errors | None = None,
) -> Samples:  # fmt: skip
    """So many random states; properties: of each signal to be read there; ages: of the flights; starts: how
    often the engines are started again; errors: of samples, (m, 3) rad/s2: if given, states where these are
    large are looked for as well.

    Several processes look at the states. The samples depend neither on their number nor on their order:

    - Each start is of a newly loaded model, as that of a flight. JSBSim keeps something from state to state,
      such as the flow's rates and the states of the flight control; and an engine that has stopped at one
      start would not run at the next.
    - Of a region, all starts are of one model, and another process looks at the states of a start: who
      samples by regions wrote the model, and nothing in it but the initial conditions goes on from state to
      state.
    """
    draw, tanks = Draw(seed, plant.aircraft, envelope, trim, moves), Tanks(plant, trim)
    search, of_each = errors is not None, max(1, n // starts)
    drawn = [drawn_start(draw, k, of_each, ages, moves, search) for k in range(starts)]
    reader = Reader(plant, properties)
    with Forks() as forks:
        if envelope.of_region and not search:
            standing = _Standing(plant, draw, reader, tanks)
            for start in drawn:
                standing.begin(start)
                forks.submit(partial(standing.look, None), standing.pass_over)
        else:
            for start in drawn:
                forks.submit(partial(_look_at_start, plant, draw, properties, tanks, errors, start))
        rows = np.concatenate(forks.results())
    tanks.fill(plant, 0.0)
    _together(plant)
    plant.start(trim)
    return finite(reader.samples(rows))


def _look_at_start(
    plant: Plant, draw: Draw, properties: Mapping[str, str], tanks: "Tanks", errors: Errors | None,
    start: Start,
) -> np.ndarray:  # fmt: skip
    """The rows of a start, of a newly loaded plant like this one."""
    with translated(plant.aircraft.jsbsim):  # here, because JSBSim's errors do not pass between processes
        own = Plant(plant.rate_hz, plant.substeps, plant.aircraft)
        standing = _Standing(own, draw, Reader(own, properties), tanks)
        standing.begin(start)
        return standing.look(errors)


Asked = Sequence[tuple[Place, int]]  # places to look at, each with its share of the travel


def _search(standing: _Standing, errors: Errors) -> None:
    """From the worst of some places, of each share and on each axis, go where the error is larger.

    All go at once, since errors of many states take hardly longer than those of few. No place is looked at
    twice: searches come to the same corners, and many of the places that one tries are where it is.
    """
    seen: dict[tuple[float, ...], np.ndarray] = {}

    def look(asked: Asked) -> np.ndarray:
        keys = [(level, *place.values()) for place, level in asked]
        fresh = {key: of for key, of in zip(keys, asked, strict=True) if key not in seen}
        for place, level in fresh.values():
            standing.put(place, level)
        if fresh:
            found = np.nan_to_num(errors(standing.reader.samples(standing.rows[-len(fresh) :])))
            seen.update(zip(fresh, found, strict=True))
        return np.array([seen[key] for key in keys])

    climbs = [
        _climb(ends, first, level, axis)
        for level, (ends, first) in enumerate(standing.start.searches)
        for axis in range(len(AXES))
    ]
    waiting = [(climb, next(climb)) for climb in climbs]
    while waiting:
        found = look([of for _, asked in waiting for of in asked])
        parts = np.split(found, np.cumsum([len(asked) for _, asked in waiting])[:-1])
        further = [(climb, _answered(climb, part)) for (climb, _), part in zip(waiting, parts, strict=True)]
        waiting = [(climb, asked) for climb, asked in further if asked]


Climb = Generator[Asked, np.ndarray, None]


def _answered(climb: Climb, found: np.ndarray) -> Asked:
    """Where a search looks next; nowhere at its end."""
    try:
        return climb.send(found)
    except StopIteration:
        return ()


def _climb(ends: Mapping[str, Ends], drawn: Sequence[Place], level: int, axis: int) -> Climb:
    """Ask for the errors of places, (m, 3), each time where they may be larger on an axis.

    Each quantity is put to its ends and its middle, the others as they are; then all together are put where
    each alone was worst. Corners of so many quantities are too many for random states to be near all of them.
    """
    found = (yield [(place, level) for place in drawn])[:, axis]
    place, error = drawn[int(found.argmax())], found.max()
    moved = [name for name in ends if name not in _ATTITUDE]
    for _ in range(_CLIMBS):
        tried = [(name, at) for name in moved for at in (ends[name][0], sum(ends[name]) / 2, ends[name][1])]
        there = (yield [(place | {name: at}, level) for name, at in tried])[:, axis]
        order = np.argsort(there)  # the worst last: of each name, it is the one that stays
        together = place | {tried[k][0]: tried[k][1] for k in order if there[k] > error}
        alone = place | dict([tried[order[-1]]])
        of_both = (yield [(together, level), (alone, level)])[:, axis]
        if of_both.max() <= error:
            break
        place, error = (together, alone)[of_both.argmax()], of_both.max()


def sample_all(
    plant: Plant, regions: Sequence[Region], n: int, seed: int, properties: Mapping[str, str],
    ages: tuple[int, ...] = EVERY_AGE, moves: Moves = USUAL, errors: Errors | None = None,
) -> Samples:  # fmt: skip
    """So many states of all regions together; boxes are numbered reach by reach; errors: as above."""
    few, many = (STARTS_OF_WORST if errors else STARTS) // len(regions), n // len(regions)
    parts = [
        sample(plant, of.envelope, of.trim, many, seed + 10 * k, properties, ages, few, moves, errors)
        for k, of in enumerate(regions)
    ]
    return joined([replace(of, box=len(parts) * of.box + k) for k, of in enumerate(parts)])


def joined(parts: Sequence[Samples]) -> Samples:
    """Samples one after the other."""
    return _each(np.concatenate, parts)


def _each(of: Callable[[list[np.ndarray]], np.ndarray], parts: Sequence[Samples]) -> Samples:
    """Samples each array of which is made of the same one of these parts."""
    names = [name for name in vars(parts[0]) if name != "signals"]
    arrays = {name: of([getattr(part, name) for part in parts]) for name in names}
    signals = {name: of([part.signals[name] for part in parts]) for name in parts[0].signals}
    return Samples(signals=signals, **arrays)


def _levers(aircraft: Aircraft) -> tuple[str, ...]:
    """What moves each engine that is an effector away from the common lever."""
    return tuple(of.throttle for of in aircraft.effectors.values())


def _together(plant: Plant) -> None:
    """All engines at the common lever."""
    for lever in _levers(plant.aircraft):
        plant.write(lever, 0.0)


def finite(samples: Samples) -> Samples:
    """Those whose accelerations are finite."""
    return samples.at(np.isfinite(samples.rate).all(axis=1))


class Reader:
    """What is read of an aircraft at one instant, as a row of numbers; and such rows as samples.

    properties: of each signal.
    """

    def __init__(self, plant: Plant, properties: Mapping[str, str]) -> None:
        blocks = (
            [f"velocities/{axis}-rad_sec" for axis in AXES],
            ["aero/alpha-rad", "aero/beta-rad", "velocities/vt-fps", "aero/qbar-psf"],
            [*properties.values()],
            [surface.effective for surface in plant.aircraft.surface.values()],
            [f"accelerations/{axis}dot-rad_sec2" for axis in AXES],
        )
        self._plant, self._signals = plant, tuple(properties)
        self._names = tuple(name for block in blocks for name in block)
        self._ends = np.cumsum([len(block) for block in blocks])

    def row(self, box: int = 0, level: int = 0, age: int = 0) -> Row:
        """What is read now; box, level, age: as of `Samples`."""
        return [*self._plant.read_all(self._names), box, level, age]

    def samples(self, rows: Sequence[Row] | np.ndarray) -> Samples:
        """All rows in one, also those whose accelerations are not finite."""
        blocks = np.split(np.array(rows), self._ends, axis=1)
        x, y, signals, u, rate, indices = (block.copy() for block in blocks)
        y *= _SI
        box, level, age = indices.T.astype(int, order="C")
        return Samples(x, y, dict(zip(self._signals, signals.T, strict=True)), u, rate, box, level, age)


class Tanks:
    """The tanks of an aircraft in trim, and what flight at full power burns of them."""

    def __init__(self, plant: Plant, trim: FlightState) -> None:
        self.full_lbs = plant.tanks_lbs
        power = {name: setting.range[1] for name, setting in plant.aircraft.engine.settings.items()}
        plant.start(replace(trim, settings=power))
        flows = [f"propulsion/engine[{i}]/fuel-flow-rate-pps" for i in range(plant.n_engines)]
        flow_pps, total = sum(plant.read(f) for f in flows if plant.has(f)), sum(self.full_lbs.values())
        self.per_s = flow_pps / total if total > 0.0 and np.isfinite(flow_pps) else 0.0

    def fill(self, plant: Plant, age_s: float) -> None:
        """Those of a plant like this one, as they are after so many seconds at full power."""
        left = 1.0 - min(self.per_s * age_s, _MOST_BURNT)
        for name, full in self.full_lbs.items():
            plant.write(name, left * full)


def quantities(samples: Samples, aircraft: Aircraft) -> dict[str, np.ndarray]:
    """What terms multiply, by name: alpha, beta, ph, qh, rh, the samples' signals, and the surfaces."""
    (alpha, beta, V, _), (p, q, r) = samples.y.T, samples.x.T
    half_span_time = aircraft.geometry.span_m / (2.0 * V)
    flow = alpha, beta, p * half_span_time, q * aircraft.geometry.chord_m / V, r * half_span_time
    by_surface = dict(zip(aircraft.surfaces, samples.u.T, strict=True))
    return dict(zip(FLOW_SIGNALS, flow, strict=True)) | dict(samples.signals) | by_surface


def fly_about(plant: Plant, trim: FlightState, seed: int, properties: Mapping[str, str]) -> Samples:
    """Some short flights from trim; `box` and `level` are not sorted yet."""
    rng, rows, reader = np.random.default_rng(seed), list[Row](), Reader(plant, properties)
    aircraft, t_s = plant.aircraft, plant.dt_s * np.arange(FRAMES)
    commanded = *(of.command for of in aircraft.surface.values()), *_levers(aircraft)
    for state in _starts(trim):
        plant.start(state)
        phases = rng.uniform(0.0, 2.0 * np.pi, (aircraft.n, len(_FREQUENCIES_HZ)))
        for k, commands in enumerate(_commands(aircraft, trim, phases, t_s).tolist()):
            if k % EVERY == 0:
                rows.append(reader.row())
            plant.write_all(commanded, commands)
            plant.run()
        _together(plant)
    plant.start(trim)
    return finite(reader.samples(rows))


def fly_about_all(
    plant: Plant, regions: Sequence[Region], seed: int, properties: Mapping[str, str]
) -> Samples:
    """The same from the trim of each region; of several, other processes fly: see `sample`."""
    with Forks(len(regions) > 1) as forks:
        for trim in (of.trim for of in regions):
            forks.submit(partial(fly_about, plant, trim, seed, properties), partial(_pass_over, plant, trim))
        return joined(forks.results())


def _pass_over(plant: Plant, trim: FlightState) -> None:
    """Go on as if the flights had been flown."""
    for state in (*_starts(trim), trim):
        plant.start(state)


def _starts(trim: FlightState) -> list[FlightState]:
    return [replace(trim, airspeed_mps=share * trim.airspeed_mps) for share in _SPEEDS]


def _commands(aircraft: Aircraft, trim: FlightState, phases: np.ndarray, t_s: np.ndarray) -> np.ndarray:
    """Of each frame those of the surfaces, rad, and of the engines' levers, (frames, surfaces + engines)."""
    waves = np.sin(2.0 * np.pi * np.array(_FREQUENCIES_HZ) * t_s[:, None, None] + phases).sum(axis=2)
    low, high = np.array([(of.min_rad, of.max_rad) for of in aircraft.travel.values()]).T
    middle = np.array([trim.surfaces_rad[name] for name in aircraft.surfaces])
    surfaces = np.clip(middle + _SHARE_OF_TRAVEL * np.minimum(-low, high) * waves, low, high)
    sides = np.array([np.sign(of.right_m) for of in aircraft.effectors.values()])
    return np.hstack([surfaces, _APART * REACHES[0] * (sides * np.sin(_APART_RAD_S * t_s)[:, None])])


def sorted_in(samples: Samples, ends: Sequence[np.ndarray], aircraft: Aircraft, moves: Moves) -> Samples:
    """Samples with the innermost box each is in, and its share of the travel; those in no box are left out.

    ends: of each box (2, 7 + declared), in the order of `places`.
    """
    where = places(samples, aircraft)
    inside = np.array([((where >= low) & (where <= high)).all(axis=1) for low, high in ends])
    travel = np.array([(t.min_rad, t.max_rad) for t in aircraft.travel.values()])
    travel *= moves.seldom(aircraft)[:, None]
    travel[travel == 0.0] = np.inf  # of a surface that goes to one side only
    used = np.maximum(samples.u / travel[:, 1], samples.u / travel[:, 0]).max(axis=1)
    level = np.searchsorted(np.array(moves.shares[:-1]), used)
    return replace(samples, box=inside.argmax(axis=0), level=level).at(np.flatnonzero(inside.any(axis=0)))


def places(samples: Samples, aircraft: Aircraft) -> np.ndarray:
    """Rates, alpha, beta, airspeed, density, declared signals: (n, 7 + declared)."""
    y = samples.y
    declared = [samples.signals[name] for name in aircraft.signals]
    return np.column_stack([samples.x, y[:, :3], 2.0 * y[:, 3] / y[:, 2] ** 2, *declared])
