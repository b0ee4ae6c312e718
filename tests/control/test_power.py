"""Engine power on pitch: when it takes over, what it may do, and that it helps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from beaver_ftc.aircraft import load
from beaver_ftc.control import power
from beaver_ftc.design import fdc
from beaver_ftc.design.fdc import value
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.plant.trim import trim
from beaver_ftc.scenario.diagnosis import EnginePower
from beaver_ftc.studies.matrix.fault_matrix import REFERENCE, trimmed_deg
from beaver_ftc.studies.mismatch.linear import in_fdc
from flying import flown, scenario
from law_records import ELEVATOR, FLAP, RUDDER
from samples import samples

DT = 0.01
TRAVEL = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
Y = np.array([0.146, 0.0, 45.0, 0.5 * 1.0225 * 45.0**2, 0.515])
SPEEDS = (38.0, 45.0, 52.0)


def control_record(**keys):
    """An oracle's control record, all well, as a flight begins with it."""
    given = scenario(control={"law": "oracle", "power": keys})
    return configure_design(given, TRAVEL)[0]["control"]


def lose_pitch(control):
    control["surfaces"]["output"]["effectiveness"][[ELEVATOR, FLAP]] = 0.0


def is_lost(control):
    parts = control["layout"], control["surfaces"], control["allocation"]["output"]["saturated"]
    return power.pitch_is_lost(*parts, control["axes"]["shortfall"])


def steer(control, x, y, known, t):
    """A frame of the law; known: there is an alarm."""
    watched = known or control["config"]["informed"]
    power.steer_by_power(control["power"], control["reference"], x, y, watched, is_lost(control), t)


def test_a_propeller_that_turns_the_other_way_leaves_the_rudder_as_much(monkeypatch):
    limit, term = control_record()["power"]["config"]["highest_dpt"], load().terms["Cn_dpt3"]
    monkeypatch.setitem(vars(term), "value", -term.value)
    assert control_record(patience_s=0.02)["power"]["config"]["highest_dpt"] == limit > 1.0


class TestWithin:
    @settings(max_examples=samples(40), deadline=None)
    @given(st.lists(st.tuples(st.floats(20, 90), st.floats(-1, 1), st.floats(0, 4)), min_size=3, max_size=12))
    def test_limits_and_rate_whatever_is_measured(self, told):
        control = control_record(patience_s=0.01)
        lose_pitch(control)
        history, y = [20.0], Y.copy()
        for V, q, dpt in told:
            y[2], y[3], y[4] = V, 0.5 * 1.02 * V * V, dpt
            for _ in range(60):
                steer(control, np.array([0.0, q, 0.0]), y, 1, 0.0)
                history.append(float(control["power"]["output"]["command"][0]))
        assert min(history) >= 10.0
        assert max(history) <= 36.5
        assert np.abs(np.diff(history)).max() <= 5.0 * DT + 1e-12

    def test_it_leaves_the_rudder_half_its_travel(self):
        """Pressure asked for without end: slipstream by FDC's own chart, its yaw by the table."""
        control, y = control_record(patience_s=0.01, attitude_memory_s=600), Y.copy()
        lose_pitch(control)
        density, V = 1.0225, 34.0
        y[2], y[3] = V, 0.5 * density * V * V
        for _ in range(3000):
            pressure = float(control["power"]["output"]["command"][0])
            kw = 0.7355 * (
                -326.5
                + 0.00412 * (pressure + 7.4) * (1800 + 2010)
                + (408 - 0.0965 * 1800) * (1 - density / 1.225)
            )
            y[4] = 0.08696 + 191.18 * 2 * kw / (density * V**3)
            steer(control, np.array([0.0, 0.5, 0.0]), y, 1, 0.0)
        rudder = -value("Cn_dpt3") * y[4] ** 3 / -value("Cn_dr")
        assert 25.0 < pressure < 36.0
        assert rudder == pytest.approx(0.5 * TRAVEL[1, RUDDER], rel=0.01)


class TestTheDesign:
    """The loop about the trim, on FDC's equations by complex steps: another road than the one flown."""

    LONGITUDINAL = (0, 1, 4, 7)  # V, alpha, q, theta

    def plant(self, V):
        point = trim(V, 1828.8)
        arguments = in_fdc(point)
        A = fdc.linearise(*arguments)[0]
        ahead, behind = (
            fdc.derivatives(*arguments[:2], fdc.Engine(1800.0, 20.0 + step)) for step in (0.01, -0.01)
        )
        rows = list(self.LONGITUDINAL)
        return A[np.ix_(rows, rows)], ((ahead - behind) / 0.02)[rows]

    def loop(self, V, gain=1.0, delay_s=0.0):
        """System matrix of aircraft, airspeed's lag, its slow mean, attitude missed, and a delay (Pade)."""
        A, B = self.plant(V)
        config = EnginePower()
        n = 8 if delay_s else 7
        F, K = np.zeros((n, n)), np.zeros(n)
        F[:4, :4] = A
        F[4, [0, 4]] = np.array([1, -1]) / config.smoothing_s
        F[5, [4, 5]] = np.array([1, -1]) / config.washout_s
        F[6, 2], F[6, 6] = 1.0, -1.0 / config.attitude_memory_s
        K[4], K[5] = -config.speed_gain_inhg_per_mps, config.speed_gain_inhg_per_mps
        K[6] = np.rad2deg(config.attitude_gain_inhg_per_deg)
        K *= gain
        if delay_s:  # u delayed: x' = -2/T x + 4/T u, u_d = x - u
            F[7] = 4.0 / delay_s * K
            F[7, 7] -= 2.0 / delay_s
            F[:4] += np.outer(B, np.eye(n)[7] - K)
        else:
            F[:4] += np.outer(B, K)
        return F

    @pytest.mark.parametrize("V", [34.0, *SPEEDS, 55.0])
    @pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
    def test_it_stays_stable_at_half_and_twice_the_gain_and_with_half_a_second_of_delay(self, V, gain):
        assert np.linalg.eigvals(self.loop(V, gain)).real.max() < 0.0
        assert np.linalg.eigvals(self.loop(V, gain, delay_s=0.5)).real.max() < 0.0

    def test_the_kernel_is_that_law(self):
        """The response to a disturbed trim, the linear aircraft under the compiled law, and by expm."""
        A, B = self.plant(45.0)
        step = expm(np.block([[A, B[:, None]], [np.zeros((1, 5))]]) * DT)
        F = self.loop(45.0)
        control = control_record(patience_s=0.01, rate_inhg_s=100)
        lose_pitch(control)
        for k in range(5):
            steer(control, np.zeros(3), Y, 1, k * DT)
        exact = expm(F * DT)
        x, z = np.array([2.0, 0.0, 0.0, 0.02]), np.array([2.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0])
        y = Y.copy()
        for _ in range(3000):
            y[2] = 45.0 + x[0]
            steer(control, np.array([0.0, x[2], 0.0]), y, 1, 0.0)
            x = step[:4, :4] @ x + step[:4, 4] * (float(control["power"]["output"]["command"][0]) - 20.0)
            z = exact @ z
            assert (np.abs(x - z[:4]) < [0.03, 3e-4, 3e-4, 1e-3]).all()


def lost(V, off_deg=0.0, flap_deg=0.0, law="oracle-published", enabled=True, **keys):
    """(flight, log) with the elevator stuck off trim and the flap stuck."""
    faults = [
        {
            "actuator": "elevator", "type": "stuck", "at_s": 12.0,
            "position_deg": trimmed_deg(V, "elevator") + off_deg,
        },
        {"actuator": "flap", "type": "stuck", "at_s": 12.0, "position_deg": flap_deg},
    ]  # fmt: skip
    return flown(
        **{
            "duration_s": 80.0,
            "initial": {"airspeed_mps": V},
            "reference": REFERENCE,
            "faults": faults,
            "fdi": {"fault_class": "all"},
            "control": {"law": law, "power": {"enabled": enabled}},
            **keys,
        }
    )


def swing_deg(log):
    late = log["t_s"] > 30.0
    return float(np.ptp(np.rad2deg(log["theta_rad"][late])))


@pytest.mark.parametrize(
    ("V", "law"),
    [(38.0, "oracle-published"), (45.0, "fault-tolerant-published"), (52.0, "fault-tolerant-published")],
)
class TestBothLost:
    def test_near_trim_the_phugoid_goes(self, V, law):
        (_, without), (flight, log) = (lost(V, law=law, enabled=on) for on in (False, True))
        assert swing_deg(log) < 0.5 * swing_deg(without)
        late = log["t_s"] > 30.0
        assert np.rad2deg(np.sqrt(np.mean(log["q_rad_s"][late] ** 2))) < 0.35
        assert np.abs(np.rad2deg(log["phi_rad"])).max() < 15.0
        assert log["envelope_valid"].all()
        assert flight.engine_power is not None

    @pytest.mark.parametrize("off_deg", [-2.0, -1.0, 1.0, 2.0])
    def test_off_trim_all_stays_finite_and_does_not_swing_more(self, V, law, off_deg):
        (_, without), (flight, log) = (lost(V, off_deg, law=law, enabled=on) for on in (False, True))
        assert flight.departure is None
        assert np.isfinite(log.rows[:, : log.columns.index("p_measured_rad_s")]).all()
        assert swing_deg(log) < max(swing_deg(without), 2.5)
        assert np.abs(np.rad2deg(log["q_rad_s"])).max() < 8.0


@pytest.mark.parametrize(
    ("V", "off_deg", "flap_deg"),
    [(38.0, 0.0, 20.0), (52.0, -8.0, 0.0)],
)
def test_an_aircraft_lost_without_power_is_kept_with_it(V, off_deg, flap_deg):
    (without, _), (flight, _) = (lost(V, off_deg, flap_deg, enabled=on) for on in (False, True))
    assert without.departure is not None
    assert flight.departure is None


class TestOtherwise:
    @pytest.mark.parametrize("law", ["oracle-published", "fault-tolerant-published"])
    def test_the_engine_stays_as_it_is_while_elevator_or_flap_act(self, law):
        for faults in ([], [{"actuator": "elevator", "type": "stuck", "at_s": 5.0, "position_deg": 0.6}]):
            flight, log = flown(
                duration_s=15.0, faults=faults, fdi={"fault_class": "all"}, control={"law": law}
            )
            assert (log["manifold_pressure_inhg"] == 20.0).all()
            assert flight.engine_power is None
