"""The autopilot's side of both protocols, around a `Small` or another function that computes outputs."""

import socket
import struct
from collections.abc import Callable, Iterable
from math import asin, atan2
from typing import Any

from pymavlink.dialects.v20 import common

from tools.autopilots.reader import read
from tools.autopilots.small import Told

Outputs = tuple[float, float, float, float]
Pilot = Callable[[Told], Outputs]
CENTRED: Outputs = (0.0, 0.0, 0.4, 0.0)
FORMS = {16: (18458, "<HHI16H"), 32: (29569, "<HHI32H")}
MOST_BYTES = 65536


def pulses(outputs: Outputs) -> list[int]:
    """Pulses, us, of roll, pitch, throttle and yaw, in the usual channels."""
    roll, pitch, throttle, yaw = outputs
    return [
        round(1500 + 500 * roll),
        round(1500 + 500 * pitch),
        round(1000 + 1000 * throttle),
        round(1500 + 500 * yaw),
    ]


def packet(count: int, rate_hz: int, outputs_us: Iterable[int], channels: int = 16) -> bytes:
    """A datagram as ArduPilot sends it."""
    magic, form = FORMS[channels]
    given = list(outputs_us)
    return struct.pack(form, magic, rate_hz, count, *given, *[0] * (channels - len(given)))


def told(answer: bytes) -> Told:
    """The quantities that ArduPilot reads from an answer."""
    values = read(answer)
    (t_s,), (_, _, down), (_, _, sinking) = values["timestamp"], values["position"], values["velocity"]
    rates, attitude = values["imu/gyro"], values["attitude"]
    (airspeed,) = values["airspeed"]
    side = values["imu/accel_body"][1]
    return Told(t_s, rates, attitude, -down, -sinking, airspeed, side)


class Ardupilot:
    """ArduPilot: it counts its frames from 0, and repeats a packet after `patience_s` without an answer."""

    def __init__(self, pilot: Pilot, rate_hz: int = 100) -> None:
        self._pilot, self.rate_hz = pilot, rate_hz
        self.count, self._outputs = 0, CENTRED
        self.sent: list[bytes] = []

    def next(self) -> bytes:
        """The packet of the next frame."""
        return packet(self.count, self.rate_hz, pulses(self._outputs))

    def hear(self, answer: bytes) -> Told:
        """Read an answer, and go on to the next frame."""
        now = told(answer)
        self._outputs = self._pilot(now)
        self.count += 1
        return now

    def fly(self, address: tuple[str, int], frames: int, patience_s: float = 1.0) -> Told | None:
        """Fly frames over UDP, until there are no more answers."""
        now = None
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.connect(address)
            line.settimeout(patience_s)
            for _ in range(frames):
                datagram = self.next()
                answer = self._asked(line, datagram)
                if answer is None:
                    return now
                self.sent.append(datagram)
                now = self.hear(answer)
        return now

    def _asked(self, line: socket.socket, datagram: bytes) -> bytes | None:
        for _ in range(60):
            line.send(datagram)
            try:
                return line.recv(MOST_BYTES)
            except TimeoutError:
                continue
            except ConnectionError:  # nobody is there any more
                return None
        return None


class Px4:
    """PX4 in lockstep: each HIL_SENSOR sets its time, and it answers with HIL_ACTUATOR_CONTROLS of that time.

    silent: number of HIL_SENSOR messages at the start without an answer, while the autopilot starts;
    armed_after: number of answers without the armed bit. state, gps: the last messages of these kinds.
    """

    def __init__(self, pilot: Pilot, silent: int = 5, armed_after: int = 5) -> None:
        self._pilot, self._silent, self._armed_after = pilot, silent, armed_after
        self._mav = common.MAVLink(None, srcSystem=1, srcComponent=1)
        self._mav.robust_parsing = True
        self.state: Any = None
        self.gps: Any = None
        self.stamps: list[int] = []

    def hear(self, data: bytes) -> bytes:
        """The answer to these bytes."""
        answer = b""
        for message in self._mav.parse_buffer(data) or []:
            kind = message.get_type()
            if kind == "HIL_SENSOR":
                answer += self._controls(message)
            elif kind == "HIL_STATE_QUATERNION":
                self.state = message
            elif kind == "HIL_GPS":
                self.gps = message
        return answer

    def _controls(self, sensor: Any) -> bytes:
        """The answer to a sensor message: none at first, nor to one that is sent again."""
        if len(self.stamps) < self._silent:
            self.stamps.append(sensor.time_usec)
            return b""
        if self.stamps and sensor.time_usec <= self.stamps[-1]:
            return b""  # said again
        self.stamps.append(sensor.time_usec)
        armed = len(self.stamps) > self._silent + self._armed_after
        outputs = self._pilot(self._told(sensor)) if armed else (0.0, 0.0, 0.0, 0.0)
        message = common.MAVLink_hil_actuator_controls_message(
            sensor.time_usec, [*outputs, *[0.0] * 12], 128 * armed + 1, 1
        )
        return bytes(message.pack(self._mav))

    def _told(self, sensor: Any) -> Told:
        """The measured quantities. Attitude and climb are the true ones, which PX4 would estimate."""
        w, x, y, z = self.state.attitude_quaternion
        attitude = (
            atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))),
            atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        )
        rates = sensor.xgyro, sensor.ygyro, sensor.zgyro
        airspeed = self.state.true_airspeed / 100.0
        climb = -self.state.vz / 100.0
        return Told(
            sensor.time_usec / 1e6, rates, attitude, sensor.pressure_alt, climb, airspeed, sensor.yacc
        )

    def fly(self, address: tuple[str, int], frames: int, patience_s: float = 3.0) -> None:
        """Connect and answer until this number of HIL_SENSOR messages has come, or the line is closed."""
        with socket.create_connection(address, timeout=patience_s) as line:
            while len(self.stamps) < frames:
                try:
                    data = line.recv(MOST_BYTES)
                except (TimeoutError, ConnectionError):
                    return
                if not data:
                    return
                answer = self.hear(data)
                if answer:
                    line.sendall(answer)
