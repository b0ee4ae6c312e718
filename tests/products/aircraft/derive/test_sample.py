"""How states are drawn, read and sorted; the numbers of few of them, and what they must obey."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim as trimmed
from beaver_ftc.studies.engine import forks
from beaver_ftc_aircraft.derive import sample as sampling
from beaver_ftc_aircraft.derive.sample import Draw, Envelope, Samples
from kept import in_short

from .known import TRAINER, aircraft, states

ENVELOPE = Envelope((38.0, 60.0), (-0.05, 0.2), 0.12)
PROPERTIES = {"thrust": "propulsion/thrust-n", "pressure": "aero/qbar-psf"}


@pytest.fixture(scope="module")
def plant():
    return Plant(100, aircraft=read(TRAINER))


@pytest.fixture(scope="module")
def trim(plant):
    return trimmed(50.0, 1000.0, plant=plant)


def draw(plant, trim, seed=5):
    return Draw(seed, plant.aircraft, ENVELOPE, trim)


def held(samples):
    fields = {name: of for name, of in vars(samples).items() if name != "signals"}
    return {name: in_short(of) for name, of in {**fields, **samples.signals}.items()} | {"n": len(samples)}


def test_three_draws_in_ten_are_at_an_end_of_the_range(plant, trim):
    one = draw(plant, trim)
    numbers = [one.between(2.0, 5.0) for _ in range(4000)]
    assert numbers.count(2.0) / 4000 == pytest.approx(0.15, abs=0.02)
    assert numbers.count(5.0) / 4000 == pytest.approx(0.15, abs=0.02)
    inside = [number for number in numbers if 2.0 < number < 5.0]
    assert np.quantile(inside, [0.25, 0.5, 0.75]) == pytest.approx([2.75, 3.5, 4.25], abs=0.1)
    assert {one.around(1.0, 0.0), one.share(3.0, (2.0, 9.0), 0.0)} == {1.0, 3.0}
    about = [one.around(2.0, 0.5) for _ in range(100)]
    assert (min(about), max(about)) == (1.5, 2.5)
    shared = [one.share(3.0, (2.0, 9.0), 0.5) for _ in range(100)]
    assert (min(shared), max(shared)) == (2.5, 6.0)


def test_states_are_within_their_box(plant, trim, changed):
    """Half way to the ends of the envelope, and as far to either side of trim; bank and climb everywhere."""
    one, seen = draw(plant, trim), []
    for _ in range(200):
        started = one.start(0.5, 0)
        there = one.state(started, one.place(one.ends(0.5, 0.35)))
        seen.append(there.as_dict() | {"started_mps": started.airspeed_mps})
    low, high = ({name: of([state[name] for state in seen]) for name in seen[0]} for of in (min, max))
    V, alpha, beta = trim.airspeed_mps, trim.alpha_rad, trim.beta_rad
    ends = {
        "airspeed_mps": ((V + 38.0) / 2, (V + 60.0) / 2), "started_mps": ((V + 38.0) / 2, (V + 60.0) / 2),
        "altitude_m": (700.0, 1300.0), "alpha_rad": ((alpha - 0.05) / 2, (alpha + 0.2) / 2),
        "beta_rad": (beta - 0.06, beta + 0.06), "p_rad_s": (-0.3, 0.3), "q_rad_s": (-0.175, 0.175),
        "r_rad_s": (-0.175, 0.175), "phi_rad": (trim.phi_rad - 1.0, trim.phi_rad + 1.0),
        "aileron_rad": (-0.14, 0.14), "elevator_rad": (-0.1575, 0.1225), "rudder_rad": (-0.147, 0.147),
    }  # fmt: skip
    assert {name: (low[name], high[name]) for name in ends} == {n: pytest.approx(e) for n, e in ends.items()}
    climb = [state["theta_rad"] - state["alpha_rad"] - (trim.theta_rad - alpha) for state in seen]
    assert (min(climb), max(climb)) == pytest.approx((-0.3, 0.3))
    thrust = trim.settings["thrust_n"]
    reach = [0.5 * 0.35 * 3000.0, thrust / 2]  # no less than nothing
    assert (low["thrust_n"], high["thrust_n"]) == pytest.approx((thrust - min(reach), thrust + reach[0]))
    deep = replace(trim, altitude_m=100.0)
    assert (
        min(Draw(1, plant.aircraft, ENVELOPE, deep).start(1.0, turn).altitude_m for turn in range(20)) >= 0.0
    )
    assert not changed({name: in_short([state[name] for state in seen]) for name in seen[0]})


def test_a_region_begins_at_the_ends_of_its_altitudes_and_is_nearly_as_wide_in_every_box(plant, trim):
    """Of a region rates and sideslip reach the root of the box's share, airspeed all of its range."""
    of_region = replace(ENVELOPE, of_region=True, altitude_m=(400.0, 2600.0))
    one = Draw(5, plant.aircraft, of_region, trim)
    assert [one.start(0.25, turn).altitude_m for turn in (0, 1)] == [400.0, 2600.0]
    assert 400.0 <= one.start(0.25, 2).altitude_m <= 2600.0
    ends, alone = one.ends(0.25, 1.0), draw(plant, trim).ends(0.25, 1.0)
    assert ends["airspeed_mps"] == (38.0, 60.0)
    assert ends["beta_rad"] == pytest.approx((trim.beta_rad - 0.06, trim.beta_rad + 0.06))
    assert [ends[f"{axis}_rad_s"][1] for axis in "pqr"] == pytest.approx([0.3, 0.175, 0.175])
    assert [alone[f"{axis}_rad_s"][1] for axis in "pqr"] == pytest.approx([0.15, 0.0875, 0.0875])
    assert alone["alpha_rad"] == ends["alpha_rad"]


def test_samples_of_every_box_share_and_age(plant, trim, changed):
    found = sampling.sample(plant, ENVELOPE, trim, 60, 3, PROPERTIES, starts=12)
    assert Counter(found.box.tolist()) == dict.fromkeys(range(4), 15)
    assert Counter(found.level.tolist()) == {0: 24, 1: 12, 2: 12, 3: 12}  # five of each start
    assert Counter(found.age.tolist()) == {0: 40, 1: 20}  # of twelve starts the first three turns of four
    assert not changed(held(found))
    fewer = sampling.sample(plant, ENVELOPE, trim, 3, 3, PROPERTIES, (0, 2), starts=8)
    assert (len(fewer), fewer.age.tolist()) == (8, [0, 0, 0, 0, 2, 2, 2, 2])
    assert plant.read("velocities/vt-fps") * 0.3048 == pytest.approx(trim.airspeed_mps)


@pytest.mark.parametrize("searched", [True, False])
@pytest.mark.parametrize("name", ["trainer", "beaver"])
def test_samples_are_the_same_to_the_bit_whichever_process_looks_at_the_states(name, searched, monkeypatch):
    """In this process, in others one after the other, and in three at once; of a region, and not."""
    monkeypatch.setattr(sampling, "FRAMES", 21)
    found, errors = [], (lambda samples: abs(samples.rate)) if searched else None
    for at_once in (0, 1, 3):
        monkeypatch.setattr(forks, "can_fork", lambda forked=at_once > 0: forked)
        monkeypatch.setattr(forks, "cores", lambda cores=at_once: cores)
        plant = Plant(100, aircraft=read(TRAINER) if name == "trainer" else None)
        level = trimmed(50.0, 1000.0, plant=plant)
        where, properties = replace(ENVELOPE, of_region=not searched), {"pressure": "aero/qbar-psf"}
        samples = sampling.sample(plant, where, level, 60, 3, properties, starts=10, errors=errors)
        regions = [sampling.Region(where, at) for at in (level, replace(level, airspeed_mps=48.0))]
        flown = sampling.fly_about_all(plant, regions, 3, properties)
        assert flown.y[[0, 36], 2] == pytest.approx([level.airspeed_mps, 48.0], rel=1e-6)  # in their order
        plant.run()
        after = plant.read("accelerations/qdot-rad_sec2")
        found.append((*vars(samples).values(), *vars(flown).values(), after))
    with np.printoptions(threshold=np.inf, floatmode="unique"):
        assert len({repr(of) for of in found}) == 1


def test_the_largest_error_is_looked_for_at_corners_and_in_the_middle(plant, trim, monkeypatch):
    """Of errors that a corner, or a corner and the middle, makes largest, all is found; chance finds less."""
    monkeypatch.setattr(sampling, "STARTS_OF_WORST", 4)

    def errors(samples):
        (alpha, beta, V, _), (p, q, r), elevator = samples.y.T, samples.x.T, samples.u[:, 1]
        corner = (2.0 + p) * (2.0 + q) * (2.0 - r) * (1.0 + alpha) * (1.0 - elevator) * V
        return np.column_stack([corner, (1.0 - abs(beta - trim.beta_rad)) * (2.0 - q), 0.0 * V])

    def worst(found):
        widest = errors(found)[(found.box == 3) & (found.level == 3)]
        return widest.max(axis=0) / [2.6 * 2.35 * 2.35 * 1.2 * 1.45 * 60.0, 2.35, 1.0]

    region = [sampling.Region(ENVELOPE, trim)]
    climbed = sampling.sample_all(plant, region, 60, 3, PROPERTIES, errors=errors)
    assert worst(climbed) == pytest.approx([1.0, 1.0, 0.0])
    assert worst(sampling.sample(plant, ENVELOPE, trim, 1200, 3, PROPERTIES))[0] < 0.8


def test_old_aircraft_are_as_old_as_flights_come_to_be(plant, trim, monkeypatch):
    """Of every other turn the fuel is what is left at the end of the age; of the others, of its flights."""
    burnt_s = []
    monkeypatch.setattr(forks, "can_fork", lambda: False)
    monkeypatch.setattr(sampling.Tanks, "fill", lambda tanks, plant, age_s: burnt_s.append(age_s))
    sampling.sample(plant, ENVELOPE, trim, 1, 3, PROPERTIES, (0, 1, 2), starts=24)
    turns = np.array(burnt_s[:-1]).reshape(2, 3, 4)
    assert (turns[1] == [[150.0], [930.0], [7230.0]]).all()
    youngest, oldest = np.array([[0.0], [120.0], [900.0]]), turns[1]
    assert ((turns[0] >= youngest) & (turns[0] <= oldest)).all()
    assert burnt_s[-1] == 0.0


def test_flights_about_trim(plant, trim, changed, monkeypatch):
    monkeypatch.setattr(sampling, "FRAMES", 21)
    found = sampling.fly_about(plant, trim, 3, PROPERTIES)
    assert len(found) == 6 * 6
    speeds = found.y[::6, 2] / trim.airspeed_mps
    assert speeds == pytest.approx([1.0, 1.0, 0.95, 1.05, 1.0, 1.0], rel=1e-6)
    reach = [0.4 * 0.06 * 3, 0.35 * 0.06 * 3, 0.42 * 0.06 * 3]
    there = np.array([trim.surfaces_rad[name] for name in plant.aircraft.surfaces])
    assert (np.abs(found.u - there) <= np.array(reach) + 1e-12).all()
    assert not changed(held(found))


def test_a_row_is_what_the_aircraft_does(plant, trim):
    plant.start(replace(trim, p_rad_s=0.1, q_rad_s=-0.2, beta_rad=0.03))
    reader = sampling.Reader(plant, PROPERTIES)
    found = reader.samples([reader.row(3, 2, 1), reader.row()])
    assert found.x[0] == pytest.approx([0.1, -0.2, 0.0])
    alpha, beta, V, qdyn = found.y[0]
    assert (alpha, beta, V) == pytest.approx((trim.alpha_rad, 0.03, trim.airspeed_mps))
    density_kg_m3 = plant.read("atmosphere/rho-slugs_ft3") * 515.378818
    assert qdyn == pytest.approx(0.5 * density_kg_m3 * V**2)
    assert found.signals["thrust"][0] == pytest.approx(trim.settings["thrust_n"])
    assert found.signals["pressure"][0] * 47.880259 == pytest.approx(qdyn)
    assert found.u[0] == pytest.approx([trim.surfaces_rad[name] for name in plant.aircraft.surfaces])
    assert found.rate[0] == pytest.approx([plant.read(f"accelerations/{a}dot-rad_sec2") for a in "pqr"])
    assert [of.tolist() for of in (found.box, found.level, found.age)] == [[3, 0], [2, 0], [1, 0]]


def test_what_is_not_finite_is_left_out(plant):
    def row(k, rate):
        return [k, 0, 0, 0, 0, k, 0, k, 0, 0, k, *rate, 1, 2, 0]

    rows = [row(1.0, [0, 0, 0]), row(2.0, [0, np.nan, 0]), row(3.0, [np.inf, 0, 0]), row(4.0, [1, 2, 3])]
    found = sampling.finite(sampling.Reader(plant, {"mach": "velocities/mach"}).samples(rows))
    assert found.x[:, 0].tolist() == found.u[:, 2].tolist() == [1.0, 4.0]
    assert found.y[:, 2].tolist() == [0.3048, 4 * 0.3048]
    assert found.signals["mach"].tolist() == [1.0, 4.0]
    assert found.rate.tolist() == [[0, 0, 0], [1, 2, 3]]
    assert [of.tolist() for of in (found.box, found.level, found.age)] == [[1, 1], [2, 2], [0, 0]]


def test_terms_multiply_dimensionless_rates():
    """p b/2V, q c/V, r b/2V."""
    trainer = aircraft("mach", "engines_m")
    samples = states(trainer, n=5)
    found, V = sampling.quantities(samples, trainer), samples.y[:, 2]
    expected = {
        "alpha": samples.y[:, 0], "beta": samples.y[:, 1], "ph": samples.x[:, 0] * 10.4 / 2 / V,
        "qh": samples.x[:, 1] * 1.48 / V, "rh": samples.x[:, 2] * 10.4 / 2 / V, **samples.signals,
        "aileron": samples.u[:, 0], "elevator": samples.u[:, 1], "rudder": samples.u[:, 2],
    }  # fmt: skip
    assert found == {name: pytest.approx(of) for name, of in expected.items()}
    where = sampling.places(samples, trainer)
    density = samples.y[:, 3] / (0.5 * V**2)
    assert where == pytest.approx(
        np.column_stack([samples.x, samples.y[:, :3], density, *samples.signals.values()])
    )


def test_a_state_is_in_the_innermost_box_that_has_it_and_in_its_share_of_the_travel():
    """Ends belong to a box and to a share; travel is counted to the side the surface is moved to."""
    trainer, shares = aircraft(), (0.15, 0.35, 0.65, 1.0)
    n = 7
    x = np.zeros((n, 3))
    x[:, 1] = [0.0, 0.1, -0.1, 0.11, -0.2, 0.2, 0.21]
    y = np.tile([0.0, 0.0, 50.0, 1250.0], (n, 1))
    u = np.zeros((n, 3))
    u[:5, 0] = [0.06, -0.0601, 0.1399, 0.2601, -0.26]  # of 0.4
    u[5, 1], u[0, 2] = 0.35, -0.02  # the elevator goes to -0.45 and 0.35
    numbers = np.zeros(n, int)
    samples = Samples(x, y, {}, u, np.arange(3 * n).reshape(n, 3), numbers, numbers, numbers)
    wide = np.array([-1.0, 0.2, 1.0, 1.0, 1.0, 60.0, 2.0])
    ends = [np.array([[-1, -0.1, -1, -1, -1, 40, 0], [1, 0.1, 1, 1, 1, 60, 2]]), np.array([-wide, wide])]
    ends[1][0, 0], ends[1][1, 0] = -1.0, 1.0
    found = sampling.sorted_in(samples, ends, trainer, sampling.Moves(shares))
    assert found.rate[:, 0].tolist() == [0, 3, 6, 9, 12, 15], "the last is in no box"
    assert found.box.tolist() == [0, 0, 0, 1, 1, 1]
    assert found.level.tolist() == [0, 1, 1, 3, 2, 3]


def test_every_box_reaches_the_ends_of_the_altitudes():
    plant = Plant(100)
    where = replace(ENVELOPE, altitude_m=(250.0, 2750.0))
    draw = Draw(5, plant.aircraft, where, trimmed(45.0, 1500.0, plant))
    for reach in (0.25, 1.0):
        altitudes = [draw.start(reach, turn).altitude_m for turn in range(40)]
        assert altitudes[:2] == [250.0, 2750.0]
        assert min(altitudes) == 250.0
        assert max(altitudes) == 2750.0
        assert np.ptp(altitudes[2:]) > 1500.0


def few(box, seed):
    """Samples in these boxes, all of whose numbers tell."""
    of = states(aircraft("mach", "engines_m"), n=len(box), seed=seed)
    return replace(of, box=np.array(box))


@pytest.mark.parametrize(("searched", "starts"), [(False, 16), (True, 32)])
def test_states_of_all_regions_are_together_their_boxes_in_turns(searched, starts, monkeypatch):
    """Starts and states are shared out, each region has a seed of its own; boxes go reach by reach."""
    asked, parts = [], [few([0, 1, 3], 1), few([2, 0], 2), few([3], 3)]

    def sample(plant, envelope, trim, n, seed, properties, ages, starts, moves, errors):
        asked.append((plant, envelope, trim, n, seed, properties, ages, starts, moves, errors))
        return parts[len(asked) - 1]

    monkeypatch.setattr(sampling, "sample", sample)
    regions = [sampling.Region(f"envelope {k}", f"trim {k}") for k in range(3)]
    moves, errors = sampling.Moves((0.5, 1.0)), len if searched else None
    found = sampling.sample_all("plant", regions, 100, 7, "properties", (0, 2), moves, errors)
    assert asked == [
        ("plant", f"envelope {k}", f"trim {k}", 33, 7 + 10 * k, "properties", (0, 2), starts, moves, errors)
        for k in range(3)
    ]
    assert found.box.tolist() == [0, 3, 9, 7, 1, 11]
    for name in ("x", "y", "u", "rate", "level", "age"):
        assert getattr(found, name).tolist() == [row for of in parts for row in getattr(of, name).tolist()]
    for name in ("mach", "engines_m"):
        assert found.signals[name].tolist() == [at for of in parts for at in of.signals[name].tolist()]


TRAVEL = {
    "flap": SimpleNamespace(min_rad=-0.1, max_rad=0.5),
    "fin": SimpleNamespace(min_rad=-0.6, max_rad=0.3),
    "brake": SimpleNamespace(min_rad=0.0, max_rad=0.7),
}
ENGINES = {
    "left": SimpleNamespace(right_m=-2.0, throttle="of/left"),
    "middle": SimpleNamespace(right_m=0.0, throttle="of/middle"),
    "right": SimpleNamespace(right_m=0.7, throttle="of/right"),
}


def test_in_flights_about_trim_surfaces_swing_about_theirs_and_engines_from_side_to_side():
    """By 6 % of the shorter side of their travel, no further than it goes; levers by 0.15 at 0.8 rad/s."""
    jet = SimpleNamespace(travel=TRAVEL, surfaces=tuple(TRAVEL), effectors=ENGINES, n=3)
    trim = SimpleNamespace(surfaces_rad={"flap": -0.0998, "fin": 0.04, "brake": 0.2})
    t_s, phases = np.array([0.0, 0.4, 1.7, 2.9]), np.arange(9.0).reshape(3, 3) / 1.7
    found = sampling._commands(jet, trim, phases, t_s)
    for k, t in enumerate(t_s):
        waves = [sum(np.sin(2 * np.pi * f * t + at) for f, at in zip((0.2, 0.5, 1.1), of, strict=True))
                 for of in phases]  # fmt: skip
        flap, fin = max(-0.0998 + 0.06 * 0.1 * waves[0], -0.1), 0.04 + 0.06 * 0.3 * waves[1]
        swing = 0.6 * 0.25 * np.sin(0.8 * t)
        assert found[k] == pytest.approx([flap, fin, 0.2, -swing, 0.0, swing])
    assert -0.1 in found[:, 0], "one of them is at its stop"


def test_a_surface_that_stands_in_moves_through_its_shares_sooner():
    """It is used by a tenth where others are by all, and at the last share beyond that."""
    jet = SimpleNamespace(travel=TRAVEL, surfaces=tuple(TRAVEL), stand_ins=("fin",), signals=(), n=3)
    u = np.array([[0.1, 0, 0], [-0.05, 0, 0], [0, 0.011, 0], [0, -0.011, 0], [0, -0.5, 0], [0, 0, 0.13]])
    n = len(u)
    samples = Samples(np.zeros((n, 3)), np.ones((n, 4)), {}, u, np.zeros((n, 3)), *np.zeros((3, n), int))
    everywhere = [np.array([[-9.0] * 7, [9.0] * 7])]
    moves = sampling.Moves((0.2, 0.6, 1.0), 0.1)
    assert moves.seldom(jet).tolist() == [1.0, 0.1, 1.0]
    assert sampling.sorted_in(samples, everywhere, jet, moves).level.tolist() == [0, 1, 1, 0, 2, 0]


def test_engines_are_started_apart_by_a_share_of_the_box_and_are_together_in_the_end(monkeypatch):
    written, started = [], []
    fuel = SimpleNamespace(fill=lambda plant, age_s: started.append(("burnt", age_s)))
    plant = SimpleNamespace(
        aircraft=SimpleNamespace(effectors=ENGINES),
        write=lambda name, value: written.append((name, value)), start=started.append,
    )  # fmt: skip
    draw = SimpleNamespace(
        aircraft=plant.aircraft, between=lambda low, high: (low, high),
        around=lambda middle, half: (middle, half), start=lambda reach, turn: ("begin", reach, turn),
        ends=lambda reach, share: {}, place=dict,
    )  # fmt: skip
    standing = sampling._Standing(plant, draw, "reader", fuel)
    moves = sampling.Moves(apart=0.4)
    standing.begin(sampling.drawn_start(draw, 4 * 2 + 2, 1, (0, 0, 1), moves, search=False))
    assert written == [(f"of/{side}", (0.0, pytest.approx(0.3))) for side in ENGINES]
    assert started == [("burnt", (120.0, 930.0)), ("begin", 0.75, 2)]
    assert (standing.start.box, standing.start.age, standing.rows) == (2, 1, [])
    written.clear()
    sampling._together(plant)
    assert written == [(f"of/{side}", 0.0) for side in ENGINES]
