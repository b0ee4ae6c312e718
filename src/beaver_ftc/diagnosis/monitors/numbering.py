"""The sensor monitor's tests and readings by number.

The tests of the equations (redundancy.py) come first, then those of sensors that should equal another
reading.
"""

import numpy as np

from beaver_ftc.plant.instruments import PHI, SENSORS, SIGNALS
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS

_NAMED = [row.test for row in ROWS]
# The tests by number. A row of scenario/sensors.py names the test that shows a jump of its sensor at once.
# The tests of turning about the three axes follow each other, and those of phi, theta, psi. The tests that
# rows of further sensors name come last.
TEST_NAMES = (
    "roll", "pitch", "yaw", "bank angle", "pitch angle", "heading", "speed", "incidence", "sideslip",
    "density", "climb", "engine speed", "manifold pressure",
    *filter(None, _NAMED[N_IN_EQUATIONS:]),
)  # fmt: skip
N_EQUATIONS = len(TEST_NAMES)  # number of the first test of a duplicate sensor
TURN_TEST, ANGLE_TEST = 0, 3
SPEED_TEST, ALPHA_TEST, BETA_TEST, DENSITY_TEST, CLIMB_TEST, RPM_TEST, PRESSURE_TEST = range(6, 13)
# By test of an equation: the place in the readings of the sensor whose row names the test
SENSOR_OF = tuple(_NAMED.index(name) for name in TEST_NAMES)
DUPLICATES = tuple((SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None)
N_TESTS = N_EQUATIONS + len(DUPLICATES)
# The duplicate sensors, each of which should equal another reading, its counterpart (its row in
# scenario/sensors.py says which). By duplicate: its place in the readings; the place of the counterpart; the
# test that an error of the counterpart exceeds; the largest difference of the two true quantities, SI.
DUPLICATE = np.array([i for i, _ in DUPLICATES], np.int64)
COUNTERPART = np.array([SENSORS.index(equal.reading) for _, equal in DUPLICATES], np.int64)
COUNTERPART_TEST = np.array([TEST_NAMES.index(_NAMED[i]) for i in COUNTERPART], np.int64)
DUPLICATE_TOLERANCE = np.array([equal.within for _, equal in DUPLICATES], float)
# Poles of the filters of each test. The first is so fast that its filter is the residual itself.
FILTER_POLES_PER_S = (1e6, 10.0, 1.0)
N_POLES = len(FILTER_POLES_PER_S)
NO_SENSOR = -1
# Places in the readings (SENSORS). Names with an I_ differ from the places in y of a frame (design/table.py),
# such as ALPHA.
P, Q, R, I_ALPHA, I_BETA, I_AIRSPEED, I_QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2
