"""What is found out about an aircraft before it is sampled: on plants whose answers are known."""

from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant.adapter import FlightState
from beaver_ftc.plant.trim import TrimPoint
from beaver_ftc_aircraft.derive import outline

TRIM = FlightState(45.0, 1000.0, surfaces_rad={"aileron": 0.0, "elevator": -0.05})
TRAVEL = {name: SimpleNamespace(min_rad=-0.4, max_rad=0.4) for name in ("aileron", "elevator")}


class Bench:
    """A plant that answers with functions of the state it was last put into, and counts its runs."""

    n_engines = 1

    def __init__(self, answers, travel=TRAVEL):
        self.answers, self.runs, self.put, self.held = answers, 0, [], 0
        self.aircraft = SimpleNamespace(
            travel=travel, envelope=SimpleNamespace(airspeed_mps=(30.0, 60.0)),
            file=SimpleNamespace(start=SimpleNamespace(altitude_m=1500.0)),
            engine=SimpleNamespace(settings={}, start="steady"),
        )  # fmt: skip

    def start(self, state):
        self.state = state
        self.put.append(state)

    def hold(self, state):
        self.state = state
        self.held += 1

    def run(self):
        self.runs += 1

    def has(self, name):
        return name in self.answers

    def read(self, name):
        return self.answers[name](self)


def turning(aileron, elevator):
    """A bench whose accelerations are these functions of the deflections, all about p, or all about r."""
    effect = {"aileron": aileron, "elevator": elevator}

    def along(axis):
        return lambda bench: sum(of(bench.state.surfaces_rad[name])[axis] for name, of in effect.items())

    return Bench({f"accelerations/{axis}dot-rad_sec2": along(i) for i, axis in enumerate("pqr")})


@pytest.mark.parametrize(
    ("aileron", "elevator", "says"),
    [
        (lambda u: (-9 * u, 0, u), lambda u: (0, -8 * u, 0), []),
        (lambda u: (0, 0, 0), lambda u: (0, -8 * u, 0), ["aileron: it turns nothing in trim: its faults "]),
        (lambda u: (0, 0, 5 * abs(u)), lambda u: (0, u + 0.5 * u**2, 0),
         ["aileron: its moment is not proportional to its deflection, 100% off a straight line",
          "elevator: its moment is not proportional to its deflection, 10% off a straight line"]),
        (lambda u: (5 * u, 0, 0.1 * abs(u)), lambda u: (0, u + 0.099 * u**2, 0), []),  # 1.98 %, and elsewhere
        (lambda u: (5 * u, 0, 0), lambda u: (0, u + 0.101 * u**2, 0), ["elevator: its moment is not prop"]),
    ],
)  # fmt: skip
def test_surfaces_that_are_not_affine_are_noted(aileron, elevator, says):
    """Of b u + c u^2 over +-0.4 the line leaves 0.16 c of 0.8 b."""
    bench = turning(aileron, elevator)
    notes = outline.not_affine(bench, TRIM)
    assert [note[: len(of)] for note, of in zip(notes, says, strict=True)] == says
    assert [bench.put[0], bench.put[-1]] == [TRIM, TRIM]
    assert bench.held == 2 * 9


def test_each_surface_is_moved_from_stop_to_stop_the_other_in_trim(monkeypatch):
    bench = turning(lambda u: (u, 0, 0), lambda u: (0, u, 0))
    seen, held = [], bench.hold
    monkeypatch.setattr(bench, "hold", lambda state: (held(state), seen.append(dict(state.surfaces_rad))))
    outline.not_affine(bench, TRIM)
    assert [of["aileron"] for of in seen[:9]] == pytest.approx([0.1 * k for k in range(-4, 5)])
    assert {of["elevator"] for of in seen[:9]} == {-0.05}
    assert {of["aileron"] for of in seen[9:]} == {0.0}


def test_what_does_not_come_to_rest_moves_by_itself(monkeypatch):
    """A share of 5 % of where it is and 0.05 more: of 1.0 it may move 0.0525 in the later half."""
    moves = {
        "still": lambda bench: 2.0,
        "early": lambda bench: 1.0 if bench.runs < 150 else 0.0,
        "little": lambda bench: 1.0 + 0.05 * (bench.runs % 2),
        "more": lambda bench: -1.0 - 0.06 * (bench.runs % 2),
        "about zero": lambda bench: 0.004 * (bench.runs % 2),
        "late": lambda bench: float(bench.runs > 299),
    }
    bench = Bench(moves)
    monkeypatch.setattr(outline, "Plant", lambda rate, aircraft: bench)
    found = outline.moved_by_itself("aircraft", TRIM, tuple(moves))
    assert found == ["more", "about zero", "late"]
    assert (bench.runs, bench.held, bench.put) == (300, 30, [TRIM])
    assert outline.moved_by_itself("aircraft", TRIM, ()) == []


def test_what_its_own_control_does_beside_is_noted(monkeypatch):
    """The rudder's deflection is the mean of two, the second of the other sign."""
    others = ("fcs/flap", "fcs/slat", "fcs/tab")
    turned = {"left": 0.0031, "elevator": 0.0029, "upper": -0.02, "lower": 0.01}  # rad: 0.003 is too much
    read = {
        "aileron": [("left", 1.0)],
        "elevator": [("elevator", 1.0)],
        "rudder": [("upper", 1.0), ("lower", -1.0)],
    }
    monkeypatch.setattr(outline, "others_of", lambda source, ours: others if ours == ("ours",) else ())
    monkeypatch.setattr(outline, "moved_by", lambda model, of, names: [names[2]] if of == "aileron" else [])

    def settled(model, given, names):
        assert given in ({}, {f"ic/{axis}-rad_sec": 0.1 for axis in "pqr"})
        return [0.2 + turned[name] * bool(given) for name in names]

    monkeypatch.setattr(outline, "settled", settled)
    surfaces = SimpleNamespace(read=read, names=("ours",))
    ends = "at 5.7 deg/s, command or not: the copy flies without"
    assert outline.own_control(Path("a.xml"), Path("b.xml"), surfaces) == (
        [
            f"aileron: its own flight control moves it 0.2 deg {ends}",
            f"rudder: its own flight control moves it -0.9 deg {ends}",
            "aileron: its command moves fcs/tab too: in the copy it does not",
        ],
        {"fcs/tab"},
    )


def test_other_surfaces_are_those_of_flight_control_that_nobody_commands_with(monkeypatch):
    names = [
        "fcs/flap-pos-deg",
        "fcs/flap-cmd-norm",
        "fcs/throttle-pos",
        "gear/gear-pos",
        "fcs/slat",
        "fcs/x",
    ]
    monkeypatch.setattr(outline, "others_of", lambda source, ours: names if ours == ["of/it"] else ())
    plant = Bench({"fcs/flap-pos-deg": lambda bench: 12.34567, "fcs/slat": lambda bench: 0.0})
    assert outline.further_surfaces(Path("a.xml"), plant, ["of/it"]) == {
        "fcs/flap-pos-deg": 12.3457,
        "fcs/slat": 0.0,
    }


WEIGHT = outline.LB_PER_SLUG * 70.0


def thrust(before, after, engines=2):
    """A bench whose engines give this share of the weight together, and that once held for a while."""

    def each(bench):
        return WEIGHT * (before if bench.held == 0 else after) / engines

    bench = Bench({f"propulsion/engine[{i}]/thrust-lbs": each for i in range(engines)})
    bench.answers["inertia/mass-slugs"] = lambda bench: 70.0
    bench.n_engines = engines
    return bench


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [(0.2, 0.2, 0.2), (0.2, 0.2109, 0.2), (0.2, 0.2111, None), (0.2, 0.189, None), (0.0, 0.00099, 0.0),
     (0.0, 0.00101, None), (-0.1, -0.1059, -0.1), (nan, 0.1, None), (inf, inf, None)],
)  # fmt: skip
def test_thrust_is_steady_if_it_stays_while_time_passes(before, after, share, monkeypatch):
    """To a twentieth of itself and a thousandth of the weight."""
    monkeypatch.setattr(outline, "FlightState", lambda *place, aircraft, **of: (place, of))
    bench = thrust(before, after)
    assert outline._steady_thrust(bench) == (None if share is None else pytest.approx(share))
    assert bench.put == [((45.0, 1500.0), {"alpha_rad": 0.05, "theta_rad": 0.05, "throttle": 0.7})]
    assert (bench.held, bench.runs) == (30, 300)  # 3 s


def test_thrust_of_what_jsbsim_cannot_fly_is_none(monkeypatch):
    def fails(state):
        raise SimulationFailed("no")

    monkeypatch.setattr(outline, "FlightState", lambda *place, **of: place)
    bench = thrust(0.2, 0.2)
    bench.start = fails
    assert outline._steady_thrust(bench) is None


STARTS = [
    ({"steady": 0.02}, "steady", 0), ({"steady": 0.01, "run_up": 0.011}, "run_up", 0),
    ({"steady": None, "run_up": 0.0, "off": 0.0}, "run_up", 1), ({"steady": 0.0}, "steady", 1),
    ({}, "run_up", 1), ({"off": 0.3}, "off", 0),
]  # fmt: skip


@pytest.mark.parametrize(("shares", "start", "notes"), STARTS)
def test_engines_are_started_as_they_come_to_run(shares, start, notes, monkeypatch):
    data = {"engine": {}}

    def plant_of(data, folder, substeps=1):
        return SimpleNamespace(n_engines=1, how=data["engine"].get("start"))

    monkeypatch.setattr(outline, "plant_of", plant_of)
    monkeypatch.setattr(outline, "_steady_thrust", lambda plant: shares.get(plant.how))
    monkeypatch.setattr(outline, "why_no_power", lambda plant_of: f"because of {plant_of(1).how}")
    said = outline.choose_start(data, Path())
    assert (data["engine"]["start"], len(said)) == (start, notes)
    assert said == [f"its engines do not carry it, because of {start}: it is flown gliding"] * notes
    monkeypatch.setattr(outline, "plant_of", lambda data, folder: SimpleNamespace(n_engines=0))
    assert outline.choose_start(data, Path()) == ["it has no engine: trim is a glide"]


def trimmed(gamma_rad):
    return TrimPoint(45.0, 1500.0, gamma_rad=gamma_rad, residual=(0.0,) * 6, envelope_valid=True)


@pytest.mark.parametrize(
    ("start", "engines", "throttle"), [("steady", 1, 0.41), ("off", 1, 0.525), ("run_up", 0, 0.525)]
)
def test_level_flight_is_found_by_halving(start, engines, throttle, monkeypatch):
    """It climbs at more than 0.41 of the throttle: after nine halvings known to 0.95 / 2^10."""
    asked = []

    def trim(airspeed_mps, altitude_m, plant, throttle):
        asked.append((airspeed_mps, altitude_m, throttle))
        return trimmed(0.1 * (throttle - 0.41))

    monkeypatch.setattr(outline, "trim", trim)
    bench = Bench({})
    bench.n_engines, bench.aircraft.engine.start = engines, start
    data = {
        "envelope": {"airspeed_mps": (40.0, 60.0)}, "start": {"altitude_m": 1200.0},
        "engine": {"settings": {"throttle": {}}},
    }  # fmt: skip
    point = outline.level_trim(bench, data)
    found = data["engine"]["settings"]["throttle"]["default"]
    assert {place[:2] for place in asked} == {(50.0, 1200.0)}
    assert found == asked[-1][2] == round(found, 4) == pytest.approx(throttle, abs=0.95 / 2**9)
    assert point.gamma_rad == 0.1 * (found - 0.41)
    assert len(asked) == (10 if throttle == 0.41 else 1)
    if throttle == 0.41:
        assert asked[0][2] == 0.525
        assert abs(asked[-2][2] - asked[-3][2]) == pytest.approx(0.95 / 2**9)


@pytest.mark.parametrize(
    ("gammas", "engines", "notes"),
    [((0.009,), 1, ["chosen 0"]), ((0.01,), 1, ["chosen 0", "in trim it climbs at 0.6 deg"]),
     ((None, -0.05), 1, ["chosen 1", "in trim it sinks at 2.9 deg"]), ((-0.05,), 0, ["chosen 0"])],
)  # fmt: skip
def test_the_first_speed_that_trims_is_taken(gammas, engines, notes, monkeypatch):
    def level_trim(plant, data):
        if gammas[data["name"]] is None:
            raise BadInput("no trim")
        return trimmed(gammas[data["name"]])

    monkeypatch.setattr(outline, "level_trim", level_trim)
    monkeypatch.setattr(outline, "choose_start", lambda data, folder: [f"chosen {data['name']}"])
    monkeypatch.setattr(outline, "plant_of", lambda data, folder: SimpleNamespace(n_engines=engines))
    said = ["before"]
    data, plant, point = outline.level_flight([{"name": i} for i in range(len(gammas))], Path(), said)
    assert (data["name"], plant.n_engines, point.gamma_rad) == (len(gammas) - 1, engines, gammas[-1])
    assert [line.partition(":")[0] for line in said] == ["before", *notes]


@pytest.mark.parametrize(
    ("engines", "finite", "says"),
    [
        (0, False, r"^one: not one$"),
        (1, True, r"^one: not one$"),
        (2, False, r"^one: a propeller, allowed: engines"),
    ],
)
def test_that_no_speed_trims_is_said_with_the_reason_of_the_first(engines, finite, says, monkeypatch):
    def level_trim(plant, data):
        raise (BadInput if data["name"] == "one" else SimulationFailed)(f"not {data['name']}")

    monkeypatch.setattr(outline, "level_trim", level_trim)
    monkeypatch.setattr(outline, "choose_start", lambda data, folder: ["chosen"])
    monkeypatch.setattr(outline, "plant_of", lambda data, folder: SimpleNamespace(n_engines=engines))
    monkeypatch.setattr(outline, "run_engines", lambda plant, lever: SimpleNamespace(finite=finite))
    monkeypatch.setattr(outline, "why_no_power", lambda plant_of: "a propeller")
    notes = []
    with pytest.raises(BadInput, match=says):
        outline.level_flight([{"name": "one"}, {"name": "two"}], Path(), notes)
    assert notes == []


def test_terms_have_the_names_of_an_aircrafts_own_file():
    beaver = load()
    mine = {"name": "Cm_elevator", "value": 1.0, "of": {}, "surface": "elevator"}
    other = {"name": "Cm_new", "value": 2.0, "of": {"alpha": 5}}
    squared = {"name": "Cm_alpha2_", "value": 3.0, "of": {"alpha": 2}}
    found = outline.named_as(beaver, {"Cm": [mine, other, squared], "Cl": [{**other, "name": "Cl_new"}]})
    assert [term["name"] for term in found["Cm"]] == ["Cm_de", "Cm_new", "Cm_alpha2"]
    assert [term["name"] for term in found["Cl"]] == ["Cl_new"]
    assert outline.usual_start(beaver) == {"airspeed_mps": 45.0, "altitude_m": 1828.8}
