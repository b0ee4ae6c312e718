"""What is known of an instant: readings, by sensor and by use. Nothing here knows the truth."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.engine import measured_slipstream
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, DPT, N_Y, QDYN
from beaver_ftc.plant.instruments import ALTITUDE, AX, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI, SIGNALS

_OF = {name: i for i, name in enumerate(SIGNALS)}
_ALPHA, _BETA, _AIRSPEED, _QDYN = (_OF[name] for name in ("alpha", "beta", "V", "qdyn"))

# What is known of an instant: every sensor's reading, and sorted by use. attitude: phi, theta, psi, rad;
# altitude m. force (3,) m/s2 without gravity, from accelerometers, where `inertial`: they are read, and none
# may be broken. missing: no reading.
MEASURED = np.dtype(
    [
        ("signal", "f8", (N_SENSORS,)), ("x", "f8", (3,)), ("y", "f8", (N_Y,)),
        ("attitude", "f8", (3,)), ("altitude", "f8"),
        ("inertial", "i8"), ("engine", "i8"), ("force", "f8", (3,)), ("missing", "i8", (N_SENSORS,)),
    ],
    align=True,
)  # fmt: skip


@kernel
def share_out(measured):
    """From the readings to x, y, attitude, force and altitude."""
    signal, y = measured.signal, measured.y
    for i in range(3):
        measured.x[i] = signal[i]
        measured.attitude[i] = signal[PHI + i]
        measured.force[i] = signal[AX + i]
    y[ALPHA], y[BETA], y[AIRSPEED] = signal[_ALPHA], signal[_BETA], signal[_AIRSPEED]
    y[QDYN] = signal[_QDYN]
    measured.altitude = signal[ALTITUDE]


@kernel
def note_slipstream(measured):
    """Work dpt out from the readings of the engine and of the air."""
    signal = measured.signal
    measured.y[DPT] = measured_slipstream(
        signal[ENGINE_SPEED], signal[MANIFOLD], signal[_AIRSPEED], signal[_QDYN]
    )
