"""The fit in steps: coefficients from accelerations, columns that are taken, errors in boxes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_aircraft.derive import fit
from beaver_ftc_aircraft.derive.sample import REACHES, Moves
from telling import numbers

from .known import aircraft, moving, states


@pytest.fixture(scope="module")
def trainer():
    return aircraft("mach", "engines_m")


@pytest.fixture(scope="module")
def samples(trainer):
    return states(trainer)


def test_coefficients_follow_from_the_accelerations_and_errors_from_the_coefficients(trainer, samples):
    """The error of the aircraft on its own accelerations is none; 0.001 more of a coefficient shows."""
    assert fit.errors_of(trainer, samples) == pytest.approx(np.zeros((400, 3)), abs=1e-12)
    beside = np.array([0.001, -0.002, 0.003])
    other = moving(trainer, samples, beside)
    change = [fit.moment_coefficients(of, trainer.mass, trainer) for of in (samples, other)]
    assert change[1] - change[0] == pytest.approx(np.tile(beside, (400, 1)), abs=1e-12)
    assert fit.errors_of(trainer, other) == pytest.approx(np.abs(other.rate - samples.rate), abs=1e-12)
    one = fit._accelerations(samples, trainer)
    size = samples.y[:, 3].mean() * 15.1
    assert one == pytest.approx([size * 10.4 / 1310.0, size * 1.48 / 1890.0, size * 10.4 / 2870.0])


def test_what_a_term_may_multiply(changed):
    def said(of, surface):
        return " ".join([*([surface] if surface else []), *(f"{name}^{power}" for name, power in of.items())])

    found = fit.candidates(("mach", "alpha_rate", "engines_m"), ("elevator", "rudder"))
    assert len({said(*each) for each in found}) == len(found)
    assert not changed([said(*each) for each in found])


def test_regressors_are_the_products(trainer, samples):
    products = [({}, None), ({"alpha": 2, "mach": 1}, None), ({"beta": 1}, "rudder"), ({"qh": 3}, None)]
    A = fit.regressors(samples, trainer, products)
    (alpha, beta, V, _), q = samples.y.T, samples.x[:, 1]
    columns = [np.ones(400), alpha**2 * samples.signals["mach"], beta * samples.u[:, 2], (q * 1.48 / V) ** 3]
    assert pytest.approx(np.column_stack(columns)) == A


def columns(seed, n=300, wide=16):
    """Columns of which neighbours are much alike."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, wide))
    A[:, 1::2] = A[:, ::2] + 0.6 * A[:, 1::2]
    return A, rng


@pytest.mark.parametrize("seed", range(4))
def test_the_pursuit_as_before(seed, changed):
    """Coefficients that halve: some explain too little beside noise."""
    A, rng = columns(seed)
    values = 0.5 ** rng.permutation(16)
    b = A @ values + 0.02 * rng.normal(size=300) + 0.3
    products = fit.Products(fit.Columns(A), b)
    pursued = products.pursued(range(16))
    few = fit.pursue(fit.Columns(A), b, 3)
    taken, found = fit.pursue(fit.Columns(A), b)
    least = float(np.linalg.lstsq(A[:, taken], b, rcond=None)[1][0])
    assert products.unexplained(taken) == pytest.approx(least, rel=1e-6)
    assert found == pytest.approx(np.linalg.lstsq(A[:, taken], b, rcond=None)[0])
    assert len(few[0]) == 3
    assert not changed({
        "pursued": pursued, "exchanged": products.exchanged(pursued, range(16)), "taken": taken,
        "values": found, "few": few, "left": [products.unexplained(pursued[:k]) for k in range(4)],
        "of use": products.of_use([*pursued, *(k for k in range(16) if k not in pursued)], least * 1.3),
        "total": [products.total, products.square], "scale": fit.Columns(A).scale,
    })  # fmt: skip


def test_columns_are_solved_by_normal_equations_also_if_one_is_there_twice():
    A = np.array([[3.0, 3.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 2.0]])
    products = fit.Products(fit.Columns(A), np.array([6.0, 8.0, 1.0]))
    twice = products.solved([0, 1])
    assert twice.sum() == pytest.approx(10.0)
    assert twice == pytest.approx([5.0, 5.0], rel=0.01), (
        "a ridge of 1e-13 lets a machine's last digits through"
    )
    assert products.solved([2]) == pytest.approx([1.0])
    assert products.unexplained([0, 1]) == pytest.approx(1.0)
    assert products.unexplained([2]) == pytest.approx(100.0)
    assert products.unexplained([0, 2]) == pytest.approx(0.0, abs=1e-9)
    assert products.total == pytest.approx(26.0)  # about the mean of 5
    assert fit.Products(fit.Columns(A), np.full(3, 2.0)).total == 1.0


@pytest.mark.parametrize(("share", "terms"), [(1.3e-10, 2), (0.8e-10, 1)])
def test_what_is_as_little_as_the_turning_earth_is_left(share, terms):
    """1e-10 of the variance."""
    one, other = np.repeat([1.0, -1.0], 50), np.tile([1.0, -1.0], 50)
    taken, values = fit.pursue(fit.Columns(np.column_stack([one, other])), one + np.sqrt(share) * other)
    assert len(taken) == terms
    assert values[0] == pytest.approx(1.0)


@pytest.mark.parametrize(("gain", "terms"), [(0.0032, 2), (0.0028, 1)])
def test_a_term_is_taken_for_what_it_explains_of_what_is_left(gain, terms):
    """Orthogonal columns beside a rest that none explains: another needs 3 per mille of what is left."""
    one, other, rest = (np.repeat(np.tile([1.0, -1.0], 2**k), 32 // 2**k) for k in range(3))
    b = one + 0.1 * (np.sqrt(gain) * other + np.sqrt(1.0 - gain) * rest)
    products = fit.Products(fit.Columns(np.column_stack([one, other])), b)
    assert products.pursued([0, 1]) == [0, 1][:terms]
    assert products.pursued([1]) == []
    assert fit.pursue(fit.Columns(np.zeros((64, 2))), b)[0] == []


@pytest.mark.parametrize(("share", "kept_"), [(0.0011, [0, 1]), (0.0009, [0])])
def test_a_term_stays_if_without_it_a_thousandth_more_is_left(share, kept_):
    one, other, rest = (np.repeat(np.tile([1.0, -1.0], 2**k), 32 // 2**k) for k in range(3))
    products = fit.Products(fit.Columns(np.column_stack([one, other])), one + np.sqrt(share) * other + rest)
    assert products.of_use([0, 1], products.unexplained([0, 1])) == kept_
    assert products.of_use([1], products.unexplained([1])) == [1], "not the last one"


def test_a_column_is_exchanged_for_one_that_leaves_less():
    one, other = np.repeat([1.0, -1.0], 50), np.tile([1.0, -1.0], 50)
    both, rng = one + 0.3 * other, np.random.default_rng(0)
    products = fit.Products(
        fit.Columns(np.column_stack([one, other, both])), both + 0.01 * rng.normal(size=100)
    )
    assert products.exchanged([0], [0, 1, 2]) == [2]
    assert products.exchanged([2, 1], [0, 1, 2]) == [2, 1]
    assert products.exchanged([0], [0]) == [0]


def test_terms_are_fitted_with_the_engines_moment_as_it_is(trainer, samples, changed):
    """The engines' moment is a signal that comes in with 1; the fit finds what else it does."""
    beside = np.zeros((400, 3))
    beside[:, 1] = 1.25 * samples.signals["engines_m"] + 0.02 * samples.signals["mach"]
    made = moving(trainer, samples, beside)
    terms = fit.fitted(made, trainer)
    found = {term["name"]: term["value"] for term in terms["Cm"]}
    assert found["Cm_engines_m"] == pytest.approx(1.25, abs=1e-6)
    assert found["Cm_mach"] == pytest.approx(0.02, abs=1e-6)
    assert found["Cm_0"] == pytest.approx(0.045, abs=1e-6)
    assert not changed(terms)
    plain = fit.fitted(moving(trainer, samples, [0, 1, 0] * samples.signals["engines_m"][:, None]), trainer)
    assert {term["name"]: term["value"] for term in plain["Cm"]}["Cm_engines_m"] == pytest.approx(1.0)
    few = fit.fitted(made, trainer, 2)
    assert {name: len(of) for name, of in few.items()} == {"Cl": 2, "Cm": 3, "Cn": 2}


def test_an_engines_moment_that_moves_in_flight_is_a_signal(trainer, samples):
    one = fit._accelerations(samples, trainer)
    ramp = np.linspace(-0.5, 0.5, 400)
    signals = {"engines_l": 1.1e-3 / one[0] * ramp, "engines_n": 0.9e-3 / one[2] * ramp, "mach": ramp}
    flown = replace(samples, signals=signals)
    assert fit.engine_signals(flown, flown, trainer) == ["engines_l"]
    held = replace(samples, signals=dict.fromkeys(signals, np.zeros(400)))
    assert fit.engine_signals(held, flown, trainer) == ["engines_l", "engines_n"], "one is nothing: all"


def test_signals_that_nothing_wants_are_left_out(trainer, samples):
    """Mach does much, engines_m little, rates of the flow nothing; one is constant."""
    rng = np.random.default_rng(3)
    mach, engines = samples.signals["mach"], samples.signals["engines_m"]
    signals = {"alpha_rate": rng.normal(size=400), "mach": mach, "engines_m": engines, "still": np.ones(400)}
    signals["rounding"] = 1.0 + 0.9e-9 * rng.random(400)
    beside = np.column_stack([0.01 * mach**2, 0.003 * engines, 0.0 * mach])
    noise = 2e-4 * rng.normal(size=(400, 3))
    made = replace(moving(trainer, samples, beside + noise), signals=signals)
    assert fit.signals_of_use(made, trainer, 6) == ["mach", "engines_m"]
    assert fit.signals_of_use(made, trainer, 1) == ["mach"]
    assert fit.signals_of_use(made, trainer, 0) == []
    assert fit.signals_of_use(made, trainer, 1, ["still"]) == ["still"]
    assert fit.signals_of_use(made, trainer, 6, ["alpha_rate"]) == ["alpha_rate", "mach", "engines_m"]


def test_the_largest_error_within_each_age_box_and_share(samples):
    """Of whoever is as old or younger, as far in or further, moved as much or less."""
    errors = np.abs(np.random.default_rng(2).normal(size=(400, 3)))
    table = fit.largest(errors, samples)
    assert table.shape == (3, 4, 4, 3)
    for age, box, level, axis in np.ndindex(table.shape):
        inside = [
            errors[k, axis]
            for k in range(400)
            if samples.age[k] <= age and samples.box[k] <= box and samples.level[k] <= level
        ]
        assert table[age, box, level, axis] == max(inside)
    nobody = samples.at(samples.age == 2)
    assert not fit.largest(errors[samples.age == 2], nobody)[:2].any()


def test_the_error_map(trainer, samples, changed):
    first = moving(trainer, samples, [0.001, 0.002, 0.003])
    second = moving(trainer, states(trainer, seed=2), [0.002, 0.001, 0.0])
    flown = states(trainer, n=50, seed=3)
    flown.y[:10, 2] = 90.0  # in no box
    flown = moving(trainer, flown, [0.003, 0.0, 0.004])
    told, worst = fit.map_of(trainer, (first, second), flown)
    assert len(told["boxes"]) == len(REACHES)
    errors = [fit.errors_of(trainer, of)[of.age == 0].max(axis=0) for of in (first, second)]
    assert worst[:2] == pytest.approx(np.array(errors))
    outermost = [told["boxes"][-1][f"error_{axis}_rad_s2"][0][-1] for axis in "pqr"]
    assert outermost == pytest.approx(1.3 * worst.max(axis=0) + 1e-7, rel=1e-4)
    assert not changed({"map": told, "worst": worst})


def test_a_moment_of_engines_that_no_held_state_shows_bounds_no_box():
    """A turboprop's torque is 0 while time stands still; in flight a box that ended there held nobody."""
    propeller = aircraft("engines_l", "mach")

    def shown(engines_l, n, seed):
        of = states(propeller, n=n, seed=seed, signals=("engines_l", "mach"))
        of.signals["engines_l"][:] = engines_l
        return moving(propeller, of, [0.0, 0.002 if engines_l else 0.0, 0.0])

    held, flown = shown(0.0, 400, 1), shown(-0.002, 30, 3)
    told, (_, of_flown) = fit.map_of(propeller, (held,), flown)
    for box in told["boxes"]:
        assert box["signals"]["engines_l"] == [-1.0, 1.0]
        assert 0.1 <= box["signals"]["mach"][0] < box["signals"]["mach"][1] <= 0.5
    assert of_flown[1] > 0.01, "flown states are in the boxes, and count"
    seen = fit.map_of(propeller, (held, shown(-0.001, 5, 2)), flown)[0]
    assert seen["boxes"][-1]["signals"]["engines_l"] == [-0.001, 0.0]


@pytest.mark.parametrize(
    ("value", "down", "up"),
    [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (123456.0, 123450.0, 123460.0), (-0.123456, -0.12346, -0.12345),
     (0.00123456, 0.0012345, 0.0012346)],
)  # fmt: skip
def test_ends_are_rounded_outwards_to_five_digits(value, down, up):
    assert fit._rounded(value, np.floor) == pytest.approx(down, rel=1e-12)
    assert fit._rounded(value, np.ceil) == pytest.approx(up, rel=1e-12)


@pytest.mark.parametrize(
    ("of", "surface", "name"),
    [({}, None, "Cl_0"), ({"alpha": 2, "mach": 1}, None, "Cl_alpha2_mach"), ({}, "rudder", "Cl_rudder"),
     ({"beta": 1}, "rudder", "Cl_rudder_beta")],
)  # fmt: skip
def test_a_term_as_a_file_has_it(of, surface, name):
    expected = {"name": name, "value": 0.12345679, "of": of} | ({"surface": surface} if surface else {})
    assert fit._term("Cl", of, surface, 0.123456789123) == expected


REGIONS, SHARES = 2, (0.3, 0.7, 1.0)


def in_regions(of, n, seed, beside):
    """States of two regions, in boxes 0 to 7, that take turns; three shares of the travel."""
    rng = np.random.default_rng(seed)
    found = states(of, n, seed)
    box, level = rng.integers(0, 8, n), rng.integers(0, 3, n)
    x = found.x * rng.uniform(0.1, 1.0, (n, 1)) + 0.3 * (box % 2)[:, None]
    return moving(of, replace(found, x=x, box=box, level=level), beside * rng.uniform(0.1, 1.0, (n, 3)))


def test_each_region_has_boxes_of_its_own_that_hold_its_states_and_their_errors(trainer):
    """Every end and error of the map against the states themselves: the most of those of the same region, in
    the box or one inside, as old or younger, moved as much or less, and 1.3 times that is declared."""
    first = in_regions(trainer, 90, 4, np.array([0.001, 0.002, 0.003]))
    second = in_regions(trainer, 70, 5, np.array([0.002, 0.001, 0.004]))
    flown = replace(in_regions(trainer, 8, 6, np.zeros(3)), age=np.zeros(8, int))
    flown.y[:, 2] = 99.0  # in no box
    told, worst = fit.map_of(trainer, (first, second), flown, REGIONS, Moves(SHARES, 0.5))
    boxes = told.pop("boxes")
    assert told == {"travel_share": [0.3, 0.7, 1.0], "stand_ins": 0.5, "until_s": [120.0, 900.0, 7200.0]}
    sets = [
        (of, np.abs(of.rate - fit_of.rate))
        for of in (first, second)
        for fit_of in [moving(trainer, of, np.zeros(3))]
    ]
    assert len(boxes) == 8
    for b, box in enumerate(boxes):
        own = [(of.box <= b) & (of.box % 2 == b % 2) for of, _ in sets]
        seen = np.concatenate([
            np.column_stack([
                of.x, of.y[:, :3], 2.0 * of.y[:, 3] / of.y[:, 2] ** 2, *of.signals.values(),
            ])[k]
            for (of, _), k in zip(sets, own, strict=True)
        ])  # fmt: skip
        names = "p_rad_s", "q_rad_s", "r_rad_s", "alpha_rad", "beta_rad", "airspeed_mps", "density_kg_m3"
        ends = [*(box[name] for name in names), *(box["signals"][name] for name in ("mach", "engines_m"))]
        low, high = np.array(ends).T
        assert (low <= seen.min(axis=0)).all()
        assert (high >= seen.max(axis=0)).all()
        assert low == pytest.approx(seen.min(axis=0), rel=1e-4)
        assert high == pytest.approx(seen.max(axis=0), rel=1e-4)
        for axis, name in enumerate("pqr"):
            for age, level in np.ndindex(3, 3):
                most = max(
                    errors[k & (of.age <= age) & (of.level <= level), axis].max(initial=0.0)
                    for (of, errors), k in zip(sets, own, strict=True)
                )
                declared = box[f"error_{name}_rad_s2"][age][level]
                assert declared == pytest.approx(1.3 * most + 1e-7, rel=1e-4, abs=1e-11)
    for (of, errors), told_of in zip(sets, worst, strict=False):
        assert told_of == pytest.approx(errors[of.age == 0].max(axis=0))
    assert worst[2] == pytest.approx(np.zeros(3))


def test_states_near_neutral_count_most_as_one_over_box_and_share_squared():
    """Of two regions, boxes 0 and 1 are the innermost of one and of the other."""
    of = SimpleNamespace(box=np.array([0, 1, 2, 5, 7]), level=np.array([2, 0, 1, 0, 2]))
    found = fit.nearness(of, 2, Moves((0.1, 0.4, 1.0)))
    assert found == pytest.approx([1 / 0.25, 1 / (0.25 * 0.01), 1 / (0.5 * 0.16), 1 / (0.75 * 0.01), 1.0])


def test_what_counts_next_to_nothing_moves_no_term(trainer):
    """Half of the states are of another aircraft, with a weight of a millionth."""
    samples, weight = states(trainer, n=160), np.where(np.arange(160) % 2, 1.0, 1e-6)
    other = np.where(weight[:, None] == 1.0, 0.0, [0.01, -0.02, 0.03] * samples.y[:, :1])
    terms = fit.fitted(moving(trainer, samples, other), trainer, most=8, weight=weight)
    for coefficient in ("Cl", "Cn"):
        known = [t.value for t in trainer.moments if t.coefficient == coefficient and t.value]
        found = [term["value"] for term in terms[coefficient] if abs(term["value"]) > 1e-4]
        assert sorted(found) == pytest.approx(sorted(known), abs=1e-5)


@pytest.mark.parametrize(("off", "known"), [(0.9e-6, True), (1.1e-6, False)])
def test_how_unlike_mirrored_engines_pull_is_declared_box_by_box(off, known, monkeypatch):
    """1.3 times the most in a box or one inside, and 1e-7 more, of the yawing moment that thrust does not
    explain; where that is a millionth, the engines are not mirrored, and nothing is declared."""
    monkeypatch.setattr(fit, "yaw_per_thrust", lambda aircraft: {"jet": -0.03}[aircraft])
    thrust = numbers(5, seed=3)
    apart_by = np.array([2e-7, -3e-7, -off, 1e-7, 4e-7])
    alike = SimpleNamespace(
        signals={"thrust": thrust, "engines_n": apart_by - 0.03 * thrust}, box=np.array([1, 0, 3, 2, 2])
    )
    boxes = [{"p_rad_s": k} for k in range(4)]
    fit.set_engines_apart(boxes, "jet", alike)
    assert [box["p_rad_s"] for box in boxes] == [0, 1, 2, 3]
    found = [box.get("engines_apart") for box in boxes]
    if known:
        assert found == pytest.approx([1.3 * of + 1e-7 for of in (3e-7, 3e-7, 4e-7, off)], rel=1e-3)
    else:
        assert found == [None] * 4
