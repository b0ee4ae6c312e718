"""A flight condition: everything that fixes the truth at one instant."""

from dataclasses import dataclass

# Gravity is that of latitude 45 deg, where the FDC data belong.
START_LATITUDE_DEG = 45.0


@dataclass(frozen=True)
class FlightState:
    """State, surfaces and engine at one instant; SI and rad, body axes X forward, Y right, Z down.

    airspeed_mps, alpha_rad, beta_rad: velocity through still air. p, q, r: body rates relative to the Earth.
    phi, theta, psi: attitude, north-east-down to body. altitude_m: geometric, above sea level.
    <s>_rad: surface deflections. engine_rpm, manifold_pressure_inhg: engine setting.
    """

    airspeed_mps: float
    altitude_m: float
    alpha_rad: float = 0.0
    beta_rad: float = 0.0
    p_rad_s: float = 0.0
    q_rad_s: float = 0.0
    r_rad_s: float = 0.0
    phi_rad: float = 0.0
    theta_rad: float = 0.0
    psi_rad: float = 0.0
    aileron_rad: float = 0.0
    elevator_rad: float = 0.0
    rudder_rad: float = 0.0
    flap_rad: float = 0.0
    engine_rpm: float = 1800.0
    manifold_pressure_inhg: float = 20.0
