"""Autopilots in place of ArduPilot and PX4, which are not part of this package: for its tests and benchmarks.

`reader` reads an answer as ArduPilot does, `small` flies, `peers` speak the two protocols, with their quirks.
"""
