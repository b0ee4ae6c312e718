"""The simulator interface of PX4: MAVLink in both directions, in lockstep. The socket is in `serve`.

Sent: HIL_SENSOR in each frame, HIL_GPS ten times and HIL_STATE_QUATERNION fifty times a second. Received:
HIL_ACTUATOR_CONTROLS [PX4, docs/en/simulation, "PX4 simulator interface"; SimulatorMavlink.cpp]. The time of
PX4 is the stamp of HIL_SENSOR, and its answer has the same stamp. Only an answer with the stamp of the last
HIL_SENSOR is flown. One with an earlier stamp was answered before: it is only counted, since otherwise two
messages of each kind would be under way for ever.

An autopilot that starts needs time before it answers. Until its first answer, time passes by the clock. Until
it is armed for the first time, the law `nominal` flies level, or the aircraft stands on the ground.
"""

from collections.abc import Iterable
from math import atan2, cos, degrees, hypot, radians, sin, sqrt
from typing import Any

import numpy as np

from beaver_ftc.aircraft import GRAVITY_MPS2
from beaver_ftc.design import standard_air
from beaver_ftc.plant import body_axes
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.mavlink import Inject, Mavlink
from beaver_ftc_links.sitl.vehicle import Instant, Vehicle

ARMED = 128  # bit of HIL_ACTUATOR_CONTROLS.mode: MAV_MODE_FLAG_SAFETY_ARMED
BOOT_US = 1_000_000  # stamp of the first instant: 0 means none
CHANNELS = 16
GPS_HZ = 10.0
STATE_HZ = 50.0
SLOW_HZ = 50.0
# Bits of fields_updated.
INERTIAL = 0b111111
MAGNETIC = 0b111000000
AIR = 0b1111000000000
# The Earth's field where all flights start, 45 N 0 E: declination, inclination, deg; gauss [WMM, 2023].
DECLINATION_DEG = 1.2
INCLINATION_DEG = 60.5
FIELD_GAUSS = 0.467
NO_YAW = 0

Message = Any


class Px4:
    """The protocol. armed: whether the autopilot was armed in this flight. done: a text for each command."""

    def __init__(self, vehicle: Vehicle, link: Link, mavlink: Mavlink, inject: Inject) -> None:
        self._vehicle = vehicle
        self._link = link
        self._mav = mavlink
        self._inject = inject
        self._connections = 0
        self.done: list[str] = []
        self._wait()

    def _wait(self) -> None:
        """Begin with an autopilot that has not answered yet."""
        self.armed = False
        self._answering = False
        self._frame = 0
        self._sent_us = 0
        self._last = b""
        self._said_s = 0.0

    def connect(self, now_s: float) -> bytes:
        """Begin a connection. A further one restarts the flight, since the autopilot has restarted. Returns
        the first messages."""
        self._connections += 1
        self._mav.begin()
        self._wait()
        if self._connections > 1:
            self._link.counts["resets"] += 1
            self._vehicle.begin(self._vehicle.packets_hz)
        return self._say(now_s)

    def take(self, data: bytes, now_s: float) -> bytes:
        """The answer to these bytes."""
        before = self._mav.malformed
        answers = b""
        for message in self._mav.unpack(data):
            if message.get_type() == "HIL_ACTUATOR_CONTROLS":
                answers += self._controls(message, now_s)
            else:
                answer, says = self._mav.obeyed(message, self._inject)
                answers += answer
                self.done += [says] if says else []
        self._link.counts["malformed"] += self._mav.malformed - before
        return answers

    def tick(self, now_s: float, step_s: float) -> bytes:
        """The bytes to send while nothing comes. While PX4 starts: a new frame each step_s. Later: after
        LONG_S, the last HIL_SENSOR again, and the flight waits."""
        if self._answering:
            if now_s - self._said_s < self._link.LONG_S:
                return b""
            self._said_s = now_s
            return self._last
        if now_s - self._said_s < step_s or self._vehicle.over:
            return b""
        self._vehicle.fly([], self._vehicle.packets_hz, in_charge=False)
        return self._say(now_s)

    def _controls(self, message: Message, now_s: float) -> bytes:
        stamp_us = int(message.time_usec)
        counts = self._link.counts
        if stamp_us != self._sent_us:
            counts["repeated" if stamp_us == self._frame_before_us else "late"] += 1
            return b""
        self._answering = True
        self._link.hear(now_s)
        self.armed |= bool(message.mode & ARMED)
        if self._vehicle.over:
            return b""
        self._vehicle.fly(list(message.controls), self._vehicle.packets_hz, in_charge=self.armed)
        counts["frames"] += 1
        return self._say(now_s)

    @property
    def _frame_before_us(self) -> int:
        return self._stamp_us(self._frame - 2)

    def _stamp_us(self, frame: int) -> int:
        return BOOT_US + round(1e6 * frame / self._vehicle.packets_hz)

    def _say(self, now_s: float) -> bytes:
        """The messages of the last instant; the next answer must have their stamp."""
        now = self._vehicle.instant()
        frame = self._frame
        hz = self._vehicle.packets_hz
        self._sent_us = self._stamp_us(frame)
        self._said_s = now_s
        self._frame += 1
        m = self._mav.messages
        packed = b""
        if _due(frame, hz, GPS_HZ):
            packed += self._mav.pack(gps(m, now, self._sent_us))
        if _due(frame, hz, STATE_HZ):
            packed += self._mav.pack(state(m, now, self._sent_us))
        # PX4 waits for HIL_SENSOR: it comes last.
        self._last = self._mav.pack(sensor(m, now, self._sent_us, _due(frame, hz, SLOW_HZ)))
        return packed + self._last


def _due(frame: int, hz: float, wanted_hz: float) -> bool:
    """Whether a message of a lower rate belongs to this frame."""
    return frame % max(1, round(hz / wanted_hz)) == 0


def sensor(m: Any, now: Instant, stamp_us: int, all_fields: bool) -> Message:
    """HIL_SENSOR: the inertial fields, and with all_fields the others."""
    updated = INERTIAL | MAGNETIC | AIR if all_fields else INERTIAL
    magnetic = magnetic_gauss(now.true_attitude) if all_fields else (0.0, 0.0, 0.0)
    pressure_hpa, celsius = standard_air(now.altitude_m)
    return m.MAVLink_hil_sensor_message(
        stamp_us, *now.force, *now.gyro, *magnetic, pressure_hpa, now.qdyn_pa / 100.0, now.altitude_m,
        celsius, updated, 0,
    )  # fmt: skip


def gps(m: Any, now: Instant, stamp_us: int) -> Message:
    """HIL_GPS: a good fix, with the true values."""
    north, east, down = _int16(now.velocity, 100.0)
    course = round(100.0 * degrees(atan2(east, north))) % 36000
    return m.MAVLink_hil_gps_message(
        stamp_us, 3, *_place(now), 30, 40, round(hypot(north, east)), north, east, down, course, 12, 0, NO_YAW
    )


def state(m: Any, now: Instant, stamp_us: int) -> Message:
    """HIL_STATE_QUATERNION: the true state, for logs."""
    velocity = _int16(now.velocity, 100.0)
    force = _int16(now.force, 1000.0 / GRAVITY_MPS2)
    indicated_mps = sqrt(max(2.0 * now.qdyn_pa / 1.225, 0.0))
    indicated, speed = (min(round(100.0 * v), 65535) for v in (indicated_mps, now.airspeed_mps))
    return m.MAVLink_hil_state_quaternion_message(
        stamp_us, quaternion(*now.true_attitude), *now.gyro, *_place(now), *velocity, indicated, speed, *force
    )


def _int16(values: Iterable[float], scale: float) -> list[int]:
    """Scaled values, rounded and limited to those of 16 bits."""
    return [max(min(round(scale * value), 32767), -32768) for value in values]


def _place(now: Instant) -> tuple[int, int, int]:
    """Latitude and longitude in 1e-7 deg, height above sea level in mm."""
    return round(1e7 * now.latitude_deg), round(1e7 * now.longitude_deg), round(1e3 * now.height_m)


def quaternion(phi: float, theta: float, psi: float) -> list[float]:
    """The rotation from earth to body axes by yaw, pitch, roll, scalar first."""
    (cr, sr), (cp, sp), (cy, sy) = ((cos(0.5 * a), sin(0.5 * a)) for a in (phi, theta, psi))
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def magnetic_gauss(attitude: tuple[float, ...]) -> tuple[float, float, float]:
    """The Earth's field in body axes, gauss."""
    declination = radians(DECLINATION_DEG)
    inclination = radians(INCLINATION_DEG)
    level = cos(inclination)
    earth = np.array([level * cos(declination), level * sin(declination), sin(inclination)])
    x, y, z = (body_axes(*attitude) @ earth * FIELD_GAUSS).tolist()
    return x, y, z
