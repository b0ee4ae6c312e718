"""PX4's simulator interface: MAVLink both ways, in lockstep. No socket: see `serve`.

Out HIL_SENSOR each frame, HIL_GPS ten times and HIL_STATE_QUATERNION fifty times a second; in
HIL_ACTUATOR_CONTROLS [PX4, docs/en/simulation, "PX4 simulator interface"; SimulatorMavlink.cpp]. PX4 has no
clock of its own then: HIL_SENSOR's stamp is its time, and its answer bears that stamp. So an answer with the
stamp of the HIL_SENSOR sent last is flown, one with an earlier stamp has been answered already: it is
counted, neither flown nor answered, or two of each would be under way for ever.

An autopilot that starts needs time to pass before it answers. Until its first answer time runs by the clock,
and until it is armed for the first time the law `nominal` flies, level.
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
GPS_HZ, STATE_HZ, SLOW_HZ = 10.0, 50.0, 50.0
INERTIAL, MAGNETIC, AIR = 0b111111, 0b111000000, 0b1111000000000  # bits of fields_updated
# The Earth's field where all flights start, 45 N 0 E: declination, inclination, deg; gauss [WMM, 2023].
DECLINATION_DEG, INCLINATION_DEG, FIELD_GAUSS = 1.2, 60.5, 0.467
NO_YAW = 0

Message = Any


class Px4:
    """One endpoint. armed: the autopilot has been armed in this flight."""

    def __init__(self, vehicle: Vehicle, link: Link, mavlink: Mavlink, inject: Inject) -> None:
        self._vehicle, self._link, self._mav, self._inject = vehicle, link, mavlink, inject
        self._connections = 0
        self.done: list[str] = []  # what commands have had done, in words
        self._wait()

    def _wait(self) -> None:
        """An autopilot is new: it has said nothing yet."""
        self.armed, self._answering = False, False
        self._frame, self._sent_us, self._last, self._said_s = 0, 0, b"", 0.0

    def connect(self, now_s: float) -> bytes:
        """A new connection is an autopilot started again, and so is the flight. Returns what to send."""
        self._connections += 1
        self._mav.begin()
        self._wait()
        if self._connections > 1:
            self._link.counts["resets"] += 1
            self._vehicle.begin(self._vehicle.packets_hz)
        return self._say(now_s)

    def take(self, data: bytes, now_s: float) -> bytes:
        """What to send after these bytes have come."""
        before, answers = self._mav.malformed, b""
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
        """What to send while nothing comes: time that passes while PX4 starts, a frame each step_s; later,
        after a second, the last instant again. The flight stands meanwhile."""
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
        stamp_us, counts = int(message.time_usec), self._link.counts
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
        """The instant, for the next answer to bear its stamp."""
        now, frame, hz = self._vehicle.instant(), self._frame, self._vehicle.packets_hz
        self._sent_us, self._said_s = self._stamp_us(frame), now_s
        self._frame += 1
        m = self._mav.messages
        packed = b""
        if _due(frame, hz, GPS_HZ):
            packed += self._mav.pack(gps(m, now, self._sent_us))
        if _due(frame, hz, STATE_HZ):
            packed += self._mav.pack(state(m, now, self._sent_us))
        # what it waits for comes last
        self._last = self._mav.pack(sensor(m, now, self._sent_us, _due(frame, hz, SLOW_HZ)))
        return packed + self._last


def _due(frame: int, hz: float, wanted_hz: float) -> bool:
    """Whether a message of a lower rate belongs to this frame."""
    return frame % max(1, round(hz / wanted_hz)) == 0


def sensor(m: Any, now: Instant, stamp_us: int, all_fields: bool) -> Message:
    """HIL_SENSOR: inertial each time, the others when `all_fields`."""
    updated = INERTIAL | MAGNETIC | AIR if all_fields else INERTIAL
    magnetic = magnetic_gauss(now.true_attitude) if all_fields else (0.0, 0.0, 0.0)
    pressure_hpa, celsius = standard_air(now.altitude_m)
    return m.MAVLink_hil_sensor_message(
        stamp_us, *now.force, *now.gyro, *magnetic, pressure_hpa, now.qdyn_pa / 100.0, now.altitude_m,
        celsius, updated, 0,
    )  # fmt: skip


def gps(m: Any, now: Instant, stamp_us: int) -> Message:
    """HIL_GPS: a good fix, of the truth."""
    north, east, down = _int16(now.velocity, 100.0)
    course = round(100.0 * degrees(atan2(east, north))) % 36000
    return m.MAVLink_hil_gps_message(
        stamp_us, 3, *_place(now), 30, 40, round(hypot(north, east)), north, east, down, course, 12, 0, NO_YAW
    )


def state(m: Any, now: Instant, stamp_us: int) -> Message:
    """HIL_STATE_QUATERNION: the truth, for logs."""
    velocity, force = _int16(now.velocity, 100.0), _int16(now.force, 1000.0 / GRAVITY_MPS2)
    indicated_mps = sqrt(max(2.0 * now.qdyn_pa / 1.225, 0.0))
    indicated, speed = (min(round(100.0 * v), 65535) for v in (indicated_mps, now.airspeed_mps))
    return m.MAVLink_hil_state_quaternion_message(
        stamp_us, quaternion(*now.true_attitude), *now.gyro, *_place(now), *velocity, indicated, speed, *force
    )


def _int16(values: Iterable[float], scale: float) -> list[int]:
    """Scaled values, the largest and the smallest that a field holds where they exceed these."""
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
    declination, inclination = radians(DECLINATION_DEG), radians(INCLINATION_DEG)
    level = cos(inclination)
    earth = np.array([level * cos(declination), level * sin(declination), sin(inclination)])
    x, y, z = (body_axes(*attitude) @ earth * FIELD_GAUSS).tolist()
    return x, y, z
