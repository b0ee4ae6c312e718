"""What the instruments make of the truth: lag, delay, slope, offset, noise, resolution, lost samples.

    reading = quantised((1 + scale_error) lagged(t - delay) + bias + drift t + noise)

or the reading before, if this one is lost.

Noise is white and normal, cut off at NOISE_LIMIT_SIGMA standard deviations: a bound on it can then be
declared and holds. A flight draws its random numbers from a counter of its own [Steele2014], so it repeats
to the bit whatever else is flown beside it. What is known of an instant (`MEASURED`) is made of readings
alone: nothing in it knows the truth.
"""

from math import pi
from typing import Any

import numpy as np

from beaver_ftc.compiled import copy, kernel, record, sized
from beaver_ftc.design.engine import measured_slipstream
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, N_Y, QDYN
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, NOISE_LIMIT_SIGMA, ROWS, SIGNALS

N_SIGNALS = len(SIGNALS)
SENSORS = tuple(row.name for row in ROWS)
N_SENSORS = len(SENSORS)
N_SAMPLED = N_SENSORS - N_IN_EQUATIONS  # those that the sensor monitor alone uses, each read at its own rate
_ALPHA, _BETA, _AIRSPEED, _QDYN = (SENSORS.index(name) for name in ("alpha", "beta", "V", "qdyn"))
PHI, PSI, ALTITUDE, ENGINE_SPEED, MANIFOLD, AX = (
    SENSORS.index(name) for name in ("phi", "psi", "altitude", "engine_rpm", "manifold_pressure", "ax")
)
LONGEST_DELAY = 1000  # JSBSim frames
# Samples that all delay lines together keep: most flights', so that delays can be set in the air; any's.
USUAL_LINE, MOST_LINE = 512, N_SENSORS * (LONGEST_DELAY + 2)

# Counters of random numbers: those of one draw change nothing in the noise of another.
OF_THE_FIRST, OF_THE_FURTHER, OF_FAULTS, OF_FORCES, OF_THE_SAMPLED = range(5)
N_COUNTERS = 5

# What is broken of an instrument: offset, relative error, added noise; held and frozen at; no reading at all.
SENSOR_FAULT = record(
    bias=float, scale=float, noise=float, frozen=int, holding=int, held=float, lost=int
)  # fmt: skip


# What instruments are configured with; a change of sensors in flight replaces all of it. drift: per sample;
# keep: exp(-bandwidth dt), 0 without lag; delay: JSBSim frames, length: samples of the line that are the
# signal's, first: the first of them; every: JSBSim frames from one reading to the next; engine: whether dpt
# is worked out from readings.
CONFIGURED: dict[str, Any] = {
    "real": int, "engine": int, "gain": N_SENSORS, "bias": N_SENSORS, "noise": N_SENSORS,
    "quantum": N_SENSORS, "dropout": N_SENSORS, "drift": N_SENSORS, "keep": N_SENSORS, "delay": N_SENSORS,
    "length": (int, N_SENSORS), "first": (int, N_SENSORS), "every": (int, N_SENSORS),
}  # fmt: skip


@sized
def instruments_dtype(line: int = USUAL_LINE) -> np.dtype:
    """The instruments of a flight whose delay lines keep so many samples: what they are configured with, and
    their memory. counter: which of the random numbers counts now; taken: samples."""
    return record(
        **CONFIGURED, random=("u8", N_COUNTERS), counter=int, lagged=N_SENSORS, line=line,
        taken=(int, N_SENSORS), reading=N_SENSORS, broken=int, fault=(SENSOR_FAULT, N_SENSORS),
    )  # fmt: skip


def take_configuration(instruments: np.void, new: np.void) -> None:
    """Go on with other sensors: random numbers go on, lags and delays begin with what is there."""
    for name in CONFIGURED:
        instruments[name] = new[name]
    instruments["taken"] = 0


# What is known of an instant: every sensor's reading, and sorted by use. attitude: phi, theta, psi, rad;
# altitude m. force (3,) m/s2 without gravity, from accelerometers, where `inertial`: they are read, and none
# may be broken. missing: no reading. fresh: of those with a rate of their own, whether it is a new sample.
MEASURED = record(
    signal=N_SENSORS, x=3, y=N_Y, attitude=3, altitude=float,
    inertial=int, engine=int, force=3, missing=(int, N_SENSORS),
    fresh=(int, max(N_SAMPLED, 1)),
)  # fmt: skip

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@kernel
def uniform(instruments):
    """The next random number of this flight, in [0, 1)."""
    instruments.random[instruments.counter] += _GOLDEN
    z = instruments.random[instruments.counter]
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    z = z ^ (z >> _31)
    return (z >> _11) * 2.0**-53


@kernel
def normal(instruments):
    """The next standard normal number, drawn again beyond NOISE_LIMIT_SIGMA."""
    value = 2.0 * NOISE_LIMIT_SIGMA
    while abs(value) > NOISE_LIMIT_SIGMA:
        radius = np.sqrt(-2.0 * np.log(1.0 - uniform(instruments)))
        value = radius * np.cos(2.0 * np.pi * uniform(instruments))
    return value


@kernel
def delayed(instruments, i, value):
    """Put the value of signal i into its delay line; returns what comes out, between frames if need be."""
    now, first, length = instruments.taken[i], instruments.first[i], instruments.length[i]
    line = instruments.line[first : first + length]
    if now == 0:
        line[:] = value
    line[now % length] = value
    whole = int(instruments.delay[i])
    part = instruments.delay[i] - whole
    late, later = line[(now - whole) % length], line[(now - whole - 1) % length]
    return late + part * (later - late)


@kernel
def wrapped(angle):
    """The angle within -pi and pi."""
    return angle - 2.0 * pi * np.floor(angle / (2.0 * pi) + 0.5)


@kernel
def read_one(instruments, i, true):
    """The reading of signal i, SI. A heading lags the short way round, and its slope is that of the angle
    from north, the short way too: it does not leap where the circle is full."""
    keep = instruments.keep[i] if instruments.taken[i] > 0 else 0.0
    if i == PSI and instruments.taken[i] > 0 and (keep > 0.0 or instruments.delay[i] > 0.0):
        true = instruments.lagged[i] + wrapped(true - instruments.lagged[i])
    instruments.lagged[i] = true + keep * (instruments.lagged[i] - true)
    value = instruments.lagged[i]
    if instruments.delay[i] > 0.0:
        value = delayed(instruments, i, value)
    if i == PSI:
        value += (instruments.gain[i] - 1.0) * wrapped(value) + instruments.bias[i]
    else:
        value = instruments.gain[i] * value + instruments.bias[i]
    if instruments.drift[i] != 0.0:
        value += instruments.drift[i] * instruments.taken[i]
    if instruments.noise[i] > 0.0:
        value += instruments.noise[i] * normal(instruments)
    if instruments.quantum[i] > 0.0:
        value = instruments.quantum[i] * np.floor(value / instruments.quantum[i] + 0.5)
    return value


@kernel
def sample(instruments, signals, i):
    """Put a sample of sensor i in the place of the truth; whether it is a new one: between two the last
    reading stands."""
    value, first = read_one(instruments, i, signals[i]), instruments.taken[i] == 0
    lost = instruments.dropout[i] > 0.0 and uniform(instruments) < instruments.dropout[i]
    due = instruments.taken[i] % instruments.every[i] == 0 and (first or not lost)
    if due:
        instruments.reading[i] = value
    instruments.taken[i] += 1
    signals[i] = instruments.reading[i]
    return due


@kernel
def read_all(instruments, signals):
    """Put a sample of every signal but the accelerometers' in the place of the truth; signals (N_SENSORS,),
    SI, as SENSORS."""
    instruments.counter = OF_THE_FIRST
    for i in range(AX):
        if i == N_SIGNALS:
            instruments.counter = OF_THE_FURTHER
        sample(instruments, signals, i)


@kernel
def read_forces(instruments, signals):
    """The same of the accelerometers, which are not read in every flight."""
    instruments.counter = OF_FORCES
    for i in range(AX, N_IN_EQUATIONS):
        sample(instruments, signals, i)


@kernel
def read_sampled(instruments, signals, fresh):
    """The same of the sensors with a rate of their own."""
    instruments.counter = OF_THE_SAMPLED
    for i in range(N_IN_EQUATIONS, N_SENSORS):
        fresh[i - N_IN_EQUATIONS] = sample(instruments, signals, i)


@kernel
def break_one(instruments, i, reading):
    """What a broken instrument i makes of its reading. A lost one has none: the last is left standing."""
    fault = instruments.fault[i]
    value = (1.0 + fault.scale) * reading + fault.bias
    if fault.noise > 0.0:
        value += fault.noise * normal(instruments)
    stays = fault.frozen or fault.lost
    if stays and fault.holding:
        value = fault.held
    fault.held, fault.holding = value, stays
    return value


@kernel
def break_all(instruments, signals, missing):
    """Put what broken instruments say in the place of their readings; missing (N_SENSORS,): none there.

    A frozen instrument stays at its first reading of the fault.
    """
    instruments.counter = OF_FAULTS
    for i in range(signals.size):
        signals[i] = break_one(instruments, i, signals[i])
        missing[i] = instruments.fault[i].lost


@kernel
def take_sample(measured, x, y, attitude):
    """Take a sample from outside in the place of the instruments': x (3,) rad/s, y signals, attitude (3,)
    rad."""
    copy(x, measured.x)
    copy(attitude, measured.attitude)
    for i in range(y.size):
        measured.y[i] = y[i]


@kernel
def set_inertial(measured, inertial):
    """Whether accelerometers are read, and none may be broken."""
    measured.inertial = inertial


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
def slipstream_read(measured):
    """dpt from the readings of the engine and of the air."""
    signal = measured.signal
    return measured_slipstream(signal[ENGINE_SPEED], signal[MANIFOLD], signal[_AIRSPEED], signal[_QDYN])
