"""The sensor monitor's record, and its finding in words.

part            file that declares it      what is in it
config, air     here                       what a scenario declares: rates and switches; turbulence
output          here                       the conclusion
errors          residual_bounds.py         bounds on the errors of the readings
sample          redundancy.py              the samples before, and the prediction of this one
tests           redundancy.py              residuals of the redundancy tests, and the bounds on them
initial         initial_errors.py          errors that sensors have had from the start
dynamics        gyro_or_attitude.py        the error of the gyros by the dynamics of the rates
gyro, angle     gyro_or_attitude.py        of each gyro, and of each angle, what its tests have shown
course          flow_or_force.py           of accelerometers and flow sensors, since the alarm
t_start         here                       time of the first sample, s
substep         here                       number of this sample in its frame
"""

from typing import Any

import numpy as np

from beaver_ftc.compiled import record
from beaver_ftc.diagnosis.monitors.flow_or_force import COURSE_RECORD
from beaver_ftc.diagnosis.monitors.gyro_or_attitude import ANGLE_RECORD, DYNAMICS_RECORD, GYRO_RECORD
from beaver_ftc.diagnosis.monitors.initial_errors import INITIAL_RECORD
from beaver_ftc.diagnosis.monitors.numbering import N_POLES
from beaver_ftc.diagnosis.monitors.redundancy import SAMPLE_RECORD, TESTS_RECORD
from beaver_ftc.diagnosis.monitors.residual_bounds import ERRORS_RECORD
from beaver_ftc.plant.instruments import N_SENSORS, SENSORS
from beaver_ftc.scenario.sensors import sensor_words

UNANTICIPATED_DELAY_S = 1.0  # time from the alarm, after which a fault is unanticipated without an isolation

MONITOR_CONFIG_RECORD = record(
    enabled=int, substeps=int, has_engine=int, y_trim=N_SENSORS,  # y_trim: readings in trim
    h=float, decay=N_POLES, g=float,  # time between two samples, s; decay of each filter in it; gravity, m/s2
    rate_gain=float,  # share of its error that a replaced rate corrects in one sample
    noisy=int,  # whether the attitude is noisy: then a surface is isolated only once no gyro can be the cause
    n_frozen=(int, N_SENSORS),  # number of repeated samples (`n_same`) from which a reading counts as frozen
    D=(3, 3),  # 1/s: body rates decay with rate' = -D rate
)  # fmt: skip

# Declared turbulence. gust_max bounds the speed of a gust, gust_change its changes through each filter, both
# m/s. gust_change holds up to max_airspeed_mps and above low_m: lower, a gust changes faster. wind_max: bound
# on the vertical wind, m/s.
AIR_RECORD = record(
    gust_max=float, gust_change=N_POLES, max_airspeed_mps=float, low_m=float, wind_max=float,
)  # fmt: skip

MONITOR_OUTPUT_RECORD = record(
    alarmed=int, alarmed_at_s=float,
    keeps_surface=int,  # whether a surface was detected long before, with sound sensors, and stays detected
    alarm_test=int,  # test that has raised the alarm
    worst_test_index=int, top_ratio=float,  # test with the largest ratio of this frame, and that ratio
    suspect=(int, N_SENSORS), isolated_sensor=int, isolated_at_s=float, is_reading_unused=(int, N_SENSORS),
)  # fmt: skip

SENSOR_MONITOR_RECORD = record(
    config=MONITOR_CONFIG_RECORD, air=AIR_RECORD, output=MONITOR_OUTPUT_RECORD, errors=ERRORS_RECORD,
    sample=SAMPLE_RECORD, tests=TESTS_RECORD, initial=INITIAL_RECORD, dynamics=DYNAMICS_RECORD,
    gyro=(GYRO_RECORD, 3), angle=(ANGLE_RECORD, 3), course=COURSE_RECORD, t_start=float, substep=int,
)  # fmt: skip


def sensor_monitor_finding(monitor: np.void, t_s: float) -> dict[str, Any] | None:
    """The parts of the verdict at t_s after an alarm of the monitor; None without one. A sensor is isolated,
    or the fault is unanticipated, or the suspects are candidates."""
    o = monitor["output"]
    if not o["alarmed"]:
        return None
    finding: dict[str, Any] = {
        "isolated": None, "isolation_type": None, "estimate": None, "candidates": (),
        "detection_time_s": float(o["alarmed_at_s"]), "isolation_time_s": None,
    }  # fmt: skip
    latest = finding["detection_time_s"] + UNANTICIPATED_DELAY_S
    if o["isolated_sensor"] >= 0:
        name = sensor_words(SENSORS[int(o["isolated_sensor"])])
        return finding | {"isolated": name, "isolation_time_s": float(o["isolated_at_s"])}
    if t_s > latest:
        name = "unanticipated"
        return finding | {"isolated": name, "isolation_type": name, "isolation_time_s": latest}
    return finding | {"candidates": tuple(sensor_words(SENSORS[i]) for i in np.flatnonzero(o["suspect"]))}
