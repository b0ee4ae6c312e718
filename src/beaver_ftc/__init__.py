"""Actuator fault diagnosis and fault-tolerant control of the DHC-2 Beaver, flown by JSBSim."""

__version__ = "0.1.0"
