"""How states are drawn, read and sorted; the numbers of few of them, and what they must obey."""

from dataclasses import replace

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
