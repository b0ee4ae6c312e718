"""The sensor monitor's tests and readings by number.

The tests of the equations (redundancy.py) come first, then those of sensors that should equal another
reading.
"""

import numpy as np

from beaver_ftc.plant.instruments import PHI, SENSORS, SIGNALS
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS

_NAMED = [row.test for row in ROWS]
# The tests by number. Each test is named by the sensor (scenario/sensors.py) whose jump it shows at once. The
# tests of turning about the axes follow each other, and those of phi, theta, psi. The tests that rows of
# sampled sensors name come last.
TEST_NAMES = (
    "roll", "pitch", "yaw", "bank angle", "pitch angle", "heading", "speed", "incidence", "sideslip",
    "density", "climb", "engine speed", "manifold pressure",
    *filter(None, _NAMED[N_IN_EQUATIONS:]),
)  # fmt: skip
N_EQUATIONS = len(TEST_NAMES)  # then the tests of sensors that should equal another reading
TURN_TEST, ANGLE_TEST = 0, 3
SPEED_TEST, ALPHA_TEST, BETA_TEST, DENSITY_TEST, CLIMB_TEST, RPM_TEST, PRESSURE_TEST = range(6, 13)
SENSOR_OF = tuple(_NAMED.index(name) for name in TEST_NAMES)
DUPLICATES = tuple((SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None)
N_TESTS = N_EQUATIONS + len(DUPLICATES)
# Of each sensor that should equal another reading (its row in scenario/sensors.py says which): its place in
# the readings, the place of that reading, and the largest difference of the two quantities, SI.
DUPLICATE = np.array([i for i, _ in DUPLICATES], np.int64)
COUNTERPART = np.array([SENSORS.index(equal.reading) for _, equal in DUPLICATES], np.int64)
# The test that an error of that reading exceeds.
COUNTERPART_TEST = np.array([TEST_NAMES.index(_NAMED[i]) for i in COUNTERPART], np.int64)
DUPLICATE_TOLERANCE = np.array([equal.within for _, equal in DUPLICATES], float)
FILTER_POLES_PER_S = (1e6, 10.0, 1.0)  # of the filters of each test; the first is the residual itself
N_POLES = len(FILTER_POLES_PER_S)
NO_SENSOR = -1
# Places in the readings (SENSORS). Those with an I_ have another place in y: ALPHA of design/table.py.
P, Q, R, I_ALPHA, I_BETA, I_AIRSPEED, I_QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2
