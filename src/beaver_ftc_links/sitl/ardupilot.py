"""ArduPilot's JSON interface: datagrams in, JSON out, in lockstep. No socket: see `serve`.

A datagram is little-endian: magic, frame rate Hz, frame count, pulses in us [ArduPilot, libraries/SITL/
examples/JSON/readme.md]. The answer is one line of JSON between two newlines. A reader looks for the
first occurrence of a key as text, takes what stands right behind the colon, and a vector as `[a,b,c]`
[libraries/SITL/SIM_JSON.cpp]: so no spaces, and a key that is part of another stands before it.

The count rises with each answer received. A count that comes again is a packet sent again, since its answer
was lost: it is answered, not flown. A lower one is late, unless it is said again: nobody repeats what has
been answered, so that is a count restarted, of an autopilot started again. So is 0 or 1, long after.
"""

import json
import struct
from collections.abc import Hashable
from typing import NamedTuple

from beaver_ftc.documents import BadInput
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.vehicle import Instant, Vehicle

_HEAD = struct.Struct("<HHI")
FORMS = {18458: struct.Struct("<16H"), 29569: struct.Struct("<32H")}  # by magic: the pulses
LATE = 64  # frames: so far back a packet may have been overtaken


class Packet(NamedTuple):
    """A datagram: frames a second, number of the frame, pulses in us."""

    rate_hz: int
    number: int
    pulses_us: tuple[int, ...]


def decoded(datagram: bytes) -> Packet | None:
    """The packet in a datagram, or None where it is none."""
    if len(datagram) < _HEAD.size:
        return None
    magic, rate_hz, count = _HEAD.unpack_from(datagram)
    form = FORMS.get(magic)
    if form is None or len(datagram) != _HEAD.size + form.size:
        return None
    return Packet(rate_hz, count, form.unpack_from(datagram, _HEAD.size))


def encoded(now: Instant) -> bytes:
    """The answer: what the autopilot needs, then what it may use. SI, radians, see `Instant`.

    airspeed: true. windvane: the apparent wind, clockwise from ahead. rng_1: the height above its ground.
    """
    said = {
        "timestamp": now.t_s, "imu": {"gyro": now.gyro, "accel_body": now.force}, "position": now.position,
        "attitude": now.attitude, "velocity": now.velocity, "airspeed": now.airspeed_mps,
        "rng_1": -now.position[2], "windvane": {"direction": now.beta_rad, "speed": now.airspeed_mps},
    }  # fmt: skip
    return f"\n{json.dumps(said, separators=(',', ':'))}\n".encode()


class Ardupilot:
    """One endpoint: the first peer's packets are flown, those of others counted.

    complaint: why no flight can be begun, in a line; empty where one can.
    """

    def __init__(self, vehicle: Vehicle, link: Link) -> None:
        self._vehicle, self._link = vehicle, link
        self._peer: Hashable = None
        self._last = -1  # count of the frame flown last; -1: none
        self._again = -1  # a count that came late
        self._answer: bytes | None = None
        self.complaint = ""

    def take(self, datagram: bytes, peer: Hashable, now_s: float) -> bytes | None:
        """What to answer to a datagram, if anything. peer: whose it is; now_s: any clock that runs on."""
        counts, packet = self._link.counts, decoded(datagram)
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
        """Whether somebody new may fly: the first, or an autopilot started again, from another port, once
        nothing has come from the old one for a while."""
        silent = self._link.silent_s(now_s) > self._link.LONG_S
        return self._peer is None or (packet.number <= 1 and silent)

    def _is_restart(self, packet: Packet, peer: Hashable) -> bool:
        """Whether the count has restarted, or at all."""
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
        self._last, self._again = packet.number, -1
        self._link.hear(now_s)
        if self._vehicle.over:
            return None
        self._vehicle.fly(packet.pulses_us, packet.rate_hz)
        self._link.counts["frames"] += 1
        self._answer = encoded(self._vehicle.instant())
        return self._answer
