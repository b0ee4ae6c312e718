"""Outer loops: altitude, airspeed, heading and bank by body rates and engine power."""
