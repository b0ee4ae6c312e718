"""What the survey goes over: faults, how soon they are to be found, speeds, altitudes, excitation."""

from typing import Any

DETECT_WITHIN_S, ISOLATE_WITHIN_S = 0.5, 1.0
SPEEDS = (0.24, 0.4, 0.56, 0.72, 0.88)  # of the way from the lowest to the highest airspeed of the envelope
ALTITUDES_M = (0.0, 1000.0, 2000.0, 3000.0)
EXCITATIONS = (0.25, 0.5, 1.0, 2.0)  # of the scenario's references

Row = dict[str, Any]
