"""The closed loop: one frame, its assembly from a scenario, and the same with plug-ins."""
