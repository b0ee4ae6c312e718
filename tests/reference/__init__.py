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
    noise.py         drift, variances, unknown constants and their bounds  statistical.md
    statistical.py   whitened innovation, tests, scores, which loss         statistical.md
    diagnosis.py     a whole flight, and the residual after the alarm

flights.py, scenarios.py, comparison.py and test_against_flights.py fly a covering array and compare column by
column.

Not here, and not compared: the weights of the network (its output is read from the log), names of fault types
and what is decided of `fault_class: all` (residuals, limits and exclusions of its hypotheses are), verdicts
of pairs, the statistical detector in turbulence (gusts, calm air) and of `fault_class: all` (parity
directions, forces, oscillations), the sensor monitor, probing, damage, turbulence below 150 m, changes of
the declaration in flight. Of a fault inside a frame of several JSBSim steps only abrupt ones are compared.
"""
