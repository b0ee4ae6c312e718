"""What the survey goes over: faults, how soon they are to be found, speeds, altitudes, excitation."""

from typing import Any

from beaver_ftc.design.model import AILERON, ELEVATOR, RUDDER

FAULTS = {"aileron": AILERON, "elevator": ELEVATOR, "rudder": RUDDER}
DETECT_WITHIN_S, ISOLATE_WITHIN_S = 0.5, 1.0
SPEEDS_MPS, ALTITUDES_M = (36.0, 40.0, 44.0, 48.0, 52.0), (0.0, 1000.0, 2000.0, 3000.0)
EXCITATIONS = (0.25, 0.5, 1.0, 2.0)  # of the scenario's references

Row = dict[str, Any]
