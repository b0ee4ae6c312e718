"""What engines that are not alike yaw by when all levers are: by hand, to the right positive."""

from types import SimpleNamespace

import numpy as np
import pytest
from kernels import fill, new_fdi

from beaver_ftc.aircraft import YAW
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.monitors import engine_monitor
from beaver_ftc.diagnosis.schemes import adaptive_estimators

ENGINES = {"one": (0.2, -5.0), "two": (0.5, 1.5), "three": (0.3, 4.0)}  # share of the thrust; right_m


def aircraft(signals, knows_engines=True):
    error_map = None if knows_engines is None else SimpleNamespace(knows_engines=knows_engines)
    effectors = {name: SimpleNamespace(share=share, right_m=at) for name, (share, at) in ENGINES.items()}
    geometry = SimpleNamespace(span_m=12.0, chord_m=2.0)
    file = SimpleNamespace(model_error_map=error_map)
    return SimpleNamespace(file=file, effectors=effectors, geometry=geometry, signals=signals)


@pytest.mark.parametrize(
    ("signals", "thrust", "turning"),
    [(("dpt", "engines_n", "thrust"), 6, 5), (("thrust", "slip", "engines_n"), 4, 6)],
)
def test_a_monitor_of_engines_reads_their_signals_where_the_aircraft_has_them(signals, thrust, turning):
    """y has alpha, beta, airspeed and dynamic pressure first."""
    config = np.zeros(1, engine_monitor.ENGINE_MONITOR_RECORD)[0]["config"]
    engine_monitor.configure_engine_monitor(config, aircraft(signals))
    assert config.tolist() == pytest.approx((3, thrust, turning, -0.95 / 12.0, 0.05 / 12.0))


@pytest.mark.parametrize(
    ("signals", "knows_engines"),
    [(("thrust", "engines_n"), None), (("thrust", "engines_n"), False), (("thrust", "engines_m"), True),
     (("engines_n",), True)],
)  # fmt: skip
def test_where_the_symmetry_of_engines_is_not_measured_nothing_is_monitored(signals, knows_engines):
    config = np.zeros(1, engine_monitor.ENGINE_MONITOR_RECORD)[0]["config"]
    engine_monitor.configure_engine_monitor(config, aircraft(signals, knows_engines))
    assert not any(config.tolist())


@pytest.mark.parametrize(
    ("excess", "thrust", "levers", "engines", "failed"),
    [
        (0.0129, 0.4, (0, 0, 9.0), 2, 0), (0.0131, 0.4, (0, 0, 9.0), 2, 1), (-0.0131, 0.4, (0, 0, 0), 2, 1),
        (0.0129, -0.4, (0, 0, 0), 2, 0), (0.0131, -0.4, (0, 0, 0), 2, 1), (0.0131, 0.4, (0, 0.1, 0), 2, 0),
        (0.0131, 0.4, (-0.1, 0, 0), 2, 0), (0.0131, 0.4, (0, 0, 0), 0, 0),
    ],
)  # fmt: skip
def test_engines_under_one_lever_that_yaw_beyond_the_bound_have_failed_and_stay_so(
    excess, thrust, levers, engines, failed
):
    """|Cn + 0.1 CT| > 0.005 + 0.02 |CT|, which is 0.013 here."""
    monitor = fill(
        np.zeros(1, engine_monitor.ENGINE_MONITOR_RECORD).view(np.recarray)[0],
        n_engines=engines, i_T=3, i_n=1,
        yaw_per_thrust=-0.1, slack=0.02,
    )  # fmt: skip
    engine_monitor.disable_if_apart(monitor, np.array(levers))
    y = np.array([7.0, -0.1 * thrust + excess, 7.0, thrust])
    assert engine_monitor.detect_engine_failure(monitor, 0.005, y) == failed
    assert engine_monitor.detect_engine_failure(monitor, 0.005, 0.0 * y) == failed
    fdi = new_fdi()
    fdi["engine_monitor"], fdi["bound"]["error_map"]["Cn_now"] = monitor, 0.005
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    axis = adaptive_estimators.find_alarm_axis(fdi, y, 7.5)
    verdict = fdi["verdict"]["isolated_estimator"], fdi["verdict"]["isolated_at_s"]
    assert (axis, *verdict) == ((YAW, UNANTICIPATED, 7.5) if failed else (-1, NOT_ISOLATED, 0.0))
    fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"] = 1, NOT_ISOLATED
    assert adaptive_estimators.find_alarm_axis(fdi, y, 7.5) == -1
