"""One time base for all columns of a log: on columns made by hand, each in SI; contradictions refused."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import samples as of
from beaver_ftc_logs.loading import load_flights_for_fit
from beaver_ftc_logs.recording import Column, LoggedFailure, RecordedFlight
from given import given
from products.logs import small
from products.logs.test_signals import T_S, turning, yawed

GIVEN = given(__file__)

WING = small.vehicle()


def column(t_s, values, note=""):
    return Column(np.asarray(t_s, dtype=float), np.asarray(values, dtype=float), note)


def stamps(step, n=60):
    return np.arange(n) * step


def recording(n=60, step=0.1, **changes):
    t_s = stamps(step, n)
    values = {"p_rad_s": 0.1, "q_rad_s": 0.2, "r_rad_s": 0.3, "roll": 0.4, "pitch": 0.6}
    columns = {name: column(t_s, size * np.cos(t_s)) for name, size in values.items()}
    return RecordedFlight("log", columns | changes, (LoggedFailure(3.0, "rudder"),), ("said of the log",))


def test_a_log_on_one_time_base():
    """Each surface's share of the commands, labels held, what was said of used columns once."""
    t_s = stamps(0.1)
    given = recording(
        pitch=column(stamps(0.2, 30) + 0.05, np.arange(30.0), "a row is left out"),
        roll=column(t_s, np.arange(60.0), "a row is left out"),
        left_effectiveness=column([1.0, 3.0], [1.0, 0.5]),
        other=column(t_s, t_s, "of no use"),
    )
    found = of.resample(given, WING)
    pitch = np.concatenate([[np.nan], np.repeat(np.arange(30.0), 2)[:59]])
    np.testing.assert_array_equal(found.commands[:, 0], 0.5 * np.arange(60.0) + 0.5 * pitch)
    np.testing.assert_array_equal(found.commands[:, 1], 0.5 * np.arange(60.0) - 0.5 * pitch)
    np.testing.assert_allclose(found.rates, np.outer(np.cos(t_s), [0.1, 0.2, 0.3]))
    assert np.isnan(found.labels[:, 0]).all()
    label = np.where(t_s < 0.99, np.nan, np.where(t_s < 2.99, 1.0, 0.5))
    np.testing.assert_array_equal(found.labels[:, 1], label)
    assert (found.name, found.dt_s, found.signals.shape) == ("log", pytest.approx(0.1), (60, 0))
    assert found.held_age_s == {"pitch": pytest.approx((30 * 0.05 + 29 * 0.15) / 59)}
    assert found.notes == ("said of the log", "a row is left out")
    assert (found.logged_failures, found.log_stamps_s is given.columns["p_rad_s"].t_s) == (
        given.logged_failures,
        True,
    )
    silent = recording(height=column(stamps(0.2, 30), np.full(30, np.nan)), speed=column(t_s, t_s))
    energy = {"altitude": "height", "airspeed": "speed"}
    assert np.isnan(of.resample(silent, small.vehicle(energy=energy)).energy_height_rate_mps).all()
    tail = of.resample(recording(airspeed_m_s=column(t_s, t_s)), small.vehicle(small.TAIL))
    np.testing.assert_array_equal(tail.signals, t_s[:, None])


MILLION = np.full(60, 1e6)
REFUSED = {
    "missing": ({"roll": None}, "no column roll, allowed: a log that has it; it has p_rad_s, q_rad_s, r_rad"),
    "nothing": ({"roll": column(stamps(0.1), np.full(60, np.nan))}, "column roll holds no number, allowed"),
    "too large": ({"roll": column(stamps(0.1), -1.01 * MILLION)}, r"holds 1.01e\+06, allowed: up to 1e\+06"),
    "degrees": (
        {"q_rad_s": column(stamps(0.1), -1.001e-6 * 60 * MILLION)},
        "column q_rad_s reaches 60.06, allowed: rates in rad/s, up to 60",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_column_that_cannot_be_used_is_told(name):
    changes, says = REFUSED[name]
    columns = {name: one for name, one in {**recording().columns, **changes}.items() if one is not None}
    with pytest.raises(BadInput, match=says):
        of.resample(RecordedFlight("log", columns), WING)


def test_two_flights_of_one_name_are_refused(tmp_path):
    from products.logs import synthetic

    vehicle = small.vehicle(commands=["roll_command"], surfaces={"right": {"roll_command": 1.0}}, labels={})
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        synthetic.write_csv(tmp_path / folder / "one.csv", synthetic.fly(8.0))
    paths = [tmp_path / folder / "one.csv" for folder in "ab"]
    assert [one.name for one in load_flights_for_fit(paths[:1], vehicle)] == ["one"]
    with pytest.raises(BadInput, match="two flights are named one: one result would replace the other"):
        load_flights_for_fit(paths, vehicle)


DEG, CDEG = np.pi / 180.0, np.pi / 18000.0
IN_SI = {  # column: what its number is multiplied by, and what is added
    "gx": (DEG * 0.1, -DEG * 2.0), "gy": (CDEG, 0.0), "gz": (1.0, 0.0), "pwm": (0.0025, -3.75),
    "share": (0.01, 0.0), "alt": (0.3048, 0.0), "tas": (1852.0 / 3600.0, 0.0), "phi": (DEG, 0.0),
    "theta": (1e-3, 0.0), "psi": (CDEG, 0.0),
    "acc": (-9.80665, 9.80665 * 0.3), "wind": (0.44704, 0.0), "alpha": (-DEG, 0.0), "extra": (2.0, 7.0),
    "left_left": (1.0, 0.0), "other": (1.0, 0.0), "out": (1.0, 0.0),
}  # fmt: skip
EVERYWHERE = GIVEN["everywhere"]  # fmt: skip


def test_every_column_that_a_vehicle_names_is_in_si_but_labels_and_outputs():
    """These are converted where they are read. What it does not name is as it was, notes and stamps too."""
    vehicle, numbers = small.vehicle(EVERYWHERE | {"name": "all"}), np.array([3.0, -5.0, np.nan])
    given = {name: column([1.0, 2.0, 4.0], numbers, f"of {name}") for name in IN_SI}
    found = of.convert_to_si(RecordedFlight("log", given, (LoggedFailure(1.0, "fin"),), ("noted",)), vehicle)
    assert list(found.columns) == list(IN_SI)
    assert (found.name, found.logged_failures, found.notes) == (
        "log",
        (LoggedFailure(1.0, "fin"),),
        ("noted",),
    )
    for name, (factor, offset) in IN_SI.items():
        one = found.columns[name]
        np.testing.assert_allclose(one.values, factor * numbers + offset, rtol=1e-12, err_msg=name)
        assert (one.t_s is given[name].t_s, one.note) == (True, f"of {name}")
    assert set(vehicle.column_names()) == set(IN_SI) - {"other"}


PHI, THETA, (P, Q, R) = turning()
PSI, ROLLING, DEG_S = yawed(), {"attitude": {"roll": "phi"}}, 180.0 / np.pi
IN_G = np.where(T_S < 50.0, -1.0, 20.0)
SWAPPED = {"q_rad_s": np.sin(2.1 * T_S), "spare": Q}
OTHER_SIGN = "one of them has the other sign, `scale: -1` fits"


def turned(**changes):
    """The recording of a body that turns, with all its angles; changes: columns of other numbers."""
    values = {"p_rad_s": P, "q_rad_s": Q, "r_rad_s": R, "phi": PHI, "theta": THETA, "psi": PSI}
    values |= {"acc": -9.8 + 0.1 * np.sin(T_S), "roll": 0.3 * np.sin(T_S), "pitch": 0.2 * np.cos(1.3 * T_S)}
    return RecordedFlight("log", {name: column(T_S, one) for name, one in (values | changes).items()})


@pytest.mark.parametrize(("changes", "keys", "says"), [
    ({}, {}, None),
    ({"p_rad_s": DEG_S * P}, {}, "p_rad_s is in deg/s, a factor of 0.01745 fits"),
    ({"p_rad_s": Q, "q_rad_s": P}, {}, "q_rad_s is the roll rate"),
    ({"q_rad_s": DEG_S * Q}, {}, "q_rad_s is in deg/s, a factor of 0.01745 fits"),
    ({"q_rad_s": Q / DEG_S}, {}, "a factor of 57.3 on q_rad_s fits, or of 0.01745 on theta"),
    ({"q_rad_s": -Q}, {}, f"the change of theta is -1 times the integral of q_rad_s: {OTHER_SIGN}"),
    ({"r_rad_s": DEG_S * R}, {}, "times the integral of r_rad_s: a factor of 0.02"),
    ({"phi": DEG_S * PHI}, ROLLING, "phi is in deg, a factor of 0.01745 fits"),
    ({"theta": DEG_S * THETA}, {}, "it is in deg, a factor of 0.01745 fits"),
    ({"psi": DEG_S * PSI}, {}, "psi is in deg, a factor of 0.01745 fits"),
    ({"psi": -PSI}, {}, f"the change of psi is -1 times the integral of r_rad_s: {OTHER_SIGN}"),
    ({"psi": -PSI}, ROLLING, None),
    ({"psi": -PSI, "phi": DEG_S * PHI}, {}, "phi is in deg, a factor of 0.01745 fits"),
    ({"acc": IN_G}, {}, "acc: its median magnitude is 1 m/s2, 1 g is 9.807: it is in g, a factor of "
     "9.807 fits"),
    ({"acc": IN_G * 1e3}, {}, "it is in mg"),
    ({"acc": IN_G * 0.01}, {}, "no unit fits: is 1 g in it?"), ({"acc": IN_G * -9.7}, {}, None),
    ({"acc": IN_G, "psi": -PSI}, {}, "the change of psi is"), ({"acc": IN_G}, {"acceleration": None}, None),
    ({"r_rad_s": np.minimum(R, 0.1), "psi": -PSI}, {}, None),  # a clipped rate: no angle is compared
    (SWAPPED, {}, None),
    (SWAPPED, {"flow": {"beta_rad": "spare"}}, "but spare (1.00): spare is the pitch rate"),
    (SWAPPED, {"commands": ["roll", "pitch", "spare"]}, "but spare (1.00): spare is the pitch rate"),
])  # fmt: skip
def test_rates_angles_and_gravity_that_contradict_one_another_are_refused(changes, keys, says):
    attitude = {"roll": "phi", "pitch": "theta", "yaw": "psi"}
    vehicle = small.vehicle(**{"attitude": attitude, "acceleration": "acc", **keys})
    if says is None:
        assert of.resample(turned(**changes), vehicle).name == "log"
        return
    with pytest.raises(
        BadInput, match=r"^log: .*, allowed: what the vehicle file says, or its `unit` mended$"
    ) as refused:
        of.resample(turned(**changes), vehicle)
    assert says in str(refused.value)
