"""The JSON interface of ArduPilot: datagrams in, JSON out, in lockstep. The socket is in `serve`.

A datagram is little-endian: magic number, frame rate in Hz, frame count, pulses in us [ArduPilot,
libraries/SITL/examples/JSON/readme.md]. The answer is one line of JSON between two newlines. ArduPilot
searches the first occurrence of a key as text, and reads the value directly behind the colon, a vector as
`[a,b,c]` [libraries/SITL/SIM_JSON.cpp]. So the line has no spaces, and a key that is part of another one
precedes it.

The autopilot increases the count with each answer that it receives:

- The same count again: the answer was lost. It is sent again, and no frame is flown.
- A lower count: the packet is late, and gets no answer. If the same lower count comes twice in turn, or if 0
  or 1 comes after more than LATE frames, the autopilot has restarted.
"""

import json
import struct
from collections.abc import Hashable
from typing import NamedTuple

from beaver_ftc.documents import BadInput
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.vehicle import Instant, Vehicle

_HEAD = struct.Struct("<HHI")
FORMS = {18458: struct.Struct("<16H"), 29569: struct.Struct("<32H")}  # magic number -> pulses
LATE = 64  # a packet is at most so many frames late


class Packet(NamedTuple):
    """A datagram: frame rate, Hz; number of the frame; pulses, us."""

    rate_hz: int
    number: int
    pulses_us: tuple[int, ...]


def decoded(datagram: bytes) -> Packet | None:
    """The packet in a datagram; None if there is none."""
    if len(datagram) < _HEAD.size:
        return None
    magic, rate_hz, count = _HEAD.unpack_from(datagram)
    form = FORMS.get(magic)
    if form is None or len(datagram) != _HEAD.size + form.size:
        return None
    return Packet(rate_hz, count, form.unpack_from(datagram, _HEAD.size))


def encoded(now: Instant) -> bytes:
    """The answer. SI, radians, as in `Instant`.

    airspeed: true airspeed. windvane: apparent wind, clockwise from ahead. rng_1: height above the ground of
    the autopilot.
    """
    said = {
        "timestamp": now.t_s, "imu": {"gyro": now.gyro, "accel_body": now.force}, "position": now.position,
        "attitude": now.attitude, "velocity": now.velocity, "airspeed": now.airspeed_mps,
        "rng_1": -now.position[2], "windvane": {"direction": now.beta_rad, "speed": now.airspeed_mps},
    }  # fmt: skip
    return f"\n{json.dumps(said, separators=(',', ':'))}\n".encode()


class Ardupilot:
    """The protocol. The packets of the first peer are flown, those of others are counted.

    complaint: the reason why the last flight could not begin, as a line; empty without one.
    """

    def __init__(self, vehicle: Vehicle, link: Link) -> None:
        self._vehicle = vehicle
        self._link = link
        self._peer: Hashable = None
        self._last = -1  # count of the last flown frame; -1: none
        self._again = -1  # count of the last late packet; -1: none since the last flown frame
        self._answer: bytes | None = None
        self.complaint = ""

    def take(self, datagram: bytes, peer: Hashable, now_s: float) -> bytes | None:
        """The answer to a datagram, if there is one. peer: its sender; now_s: time of a monotonic clock."""
        counts = self._link.counts
        packet = decoded(datagram)
        if packet is None:
            counts["malformed"] += 1
            return None
        if peer != self._peer and not self._may_take_over(packet, now_s):
            counts["strangers"] += 1
            return None
        if not self._is_restart(packet, peer):
            if packet.number == self._last:
                counts["repeated"] += 1
                return self._answer
            if packet.number < self._last:
                counts["late"] += 1
                self._again = packet.number
                return None
            counts["missed"] += packet.number - self._last - 1
        elif not self._begin(packet, peer):
            counts["malformed"] += 1
            return None
        return self._fly(packet, now_s)

    def _may_take_over(self, packet: Packet, now_s: float) -> bool:
        """Whether a new peer may fly: the first one, or one that begins to count when nothing has come from
        the old one for LONG_S, as an autopilot that restarts with another port."""
        silent = self._link.silent_s(now_s) > self._link.LONG_S
        return self._peer is None or (packet.number <= 1 and silent)

    def _is_restart(self, packet: Packet, peer: Hashable) -> bool:
        """Whether the packet begins a flight: the first of its peer, or of a restarted count."""
        if self._last < 0 or peer != self._peer:
            return True
        starts = packet.number <= 1 and self._last > LATE
        return starts or (packet.number < self._last and packet.number == self._again)

    def _begin(self, packet: Packet, peer: Hashable) -> bool:
        try:
            self._vehicle.begin(packet.rate_hz, len(packet.pulses_us))
        except BadInput as error:
            self.complaint = str(error)
            return False
        self._link.counts["resets"] += self._last >= 0
        self._peer = peer
        return True

    def _fly(self, packet: Packet, now_s: float) -> bytes | None:
        self._last = packet.number
        self._again = -1
        self._link.hear(now_s)
        if self._vehicle.over:
            return None
        self._vehicle.fly(packet.pulses_us, packet.rate_hz)
        self._link.counts["frames"] += 1
        self._answer = encoded(self._vehicle.instant())
        return self._answer
