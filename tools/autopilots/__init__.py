"""Autopilots in place of ArduPilot and PX4, which are not part of this package: for its tests and benchmarks.

`reader` reads an answer as ArduPilot does, `small` flies, `circuit` takes off and lands, `peers` speak both
protocols, with their quirks.
"""
