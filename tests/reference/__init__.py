"""The diagnosis once more, in plain NumPy, written from the pages: an executable reference.

It reads like the pages: a file a subject, each function a formula with its equation. It takes the declared
half of a scenario, and the readings and commands of a flight, and gives the columns of the log and the names.
It depends on no name of the package but its public ones (flights.py), so the package may be rebuilt under it.

    declaration.py   what is declared: aircraft.yaml, scenario keys with their defaults
    prediction.py    f, G, servos, means over a frame, tolerance r_s        detection.md, glossary.md
    bounds.py        eta_bar with all its parts, gyro errors, maps          detection.md, derived-aircraft.md
    detection.py     bank of filters, poles, thresholds, alarm              detection.md
    isolation.py     hypotheses, estimators, tests 1 to 4, decision         isolation.md, fault-types.md
                     gradients and norm bounds of scheme zhang2005          paper, sec. IV
    types.py         places of a surface, sets of each type, releases       fault-types.md
    naming.py        from the types left to surface, type and candidates    fault-types.md
    pairs.py         the same with two faults at once                       fault-types.md
    noise.py         drift, variances, unknown constants and their bounds  statistical.md
    gusts.py         gusts that vanes measure, and what they leave          statistical.md
    likelihood.py    whitened innovation, tests, scores                     statistical.md
    directions.py    parity directions of an aircraft                       statistical.md
    forces.py        side and normal force, integrated flow angles          statistical.md
    oscillations.py  tests for an oscillation                               statistical.md
    parity.py        tests in parity directions, their confirmation         statistical.md
    statistical.py   the alarm, and which fault                             statistical.md
    diagnosis.py     a whole flight, and the residual after the alarm
    monitor.py       tests between instruments, their filters and bounds    instruments.md

flights.py, scenarios.py, comparison.py and test_against_flights.py fly a covering array and compare column by
column. test_monitor.py flies the drawn flights of monitored.yaml, and compares the largest ratio of residual
to threshold, its test, that the alarm is raised, and that the name is an instrument "changed by" the test.

Not here, and not compared: the weights of the network (its output is read from the log), the names of
`fault_class: all` with `fault_profile: abrupt` (there the rest of a surface that the law gives up is
evidence), probing, damage, changes of the declaration in flight. Of a fault inside a frame of several
JSBSim steps only abrupt ones are compared.

Of the statistical detector not here: in turbulence, aircraft whose design model has no forces (derived ones;
their coarse estimate, and accelerometers in its place), and an estimated speed below half the airspeed;
deliberate errors of force coefficients; accelerometers that may be broken, with `sensor_monitor: always`.

Of the sensor monitor not here, and not compared: the tests 11 and 12 (no plug-in reads the engine's
instruments) and those of additional sensors, the pause in a steep attitude, exclusion of candidates by other
tests, its two comparisons (gyro or attitude angle; accelerometer, vane or airspeed), instruments broken from
the start, frozen readings, substitutes (so the ratios end with the name), the test of gyros by the
statistical detector, failed engines, gusts below 150 m or above 1.4 times the airspeed in trim, slope errors
of the heading.
"""
