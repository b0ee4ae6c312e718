"""MAVLink messages as bytes, and a UDP line to a ground station.

Needs pymavlink: the extra `flights`.
"""

import socket
from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_links.sitl import failures
from beaver_ftc_links.sitl.telling import Text

Message = Any  # pymavlink makes the classes at run time
Inject = Callable[[tuple[float, float, float]], tuple[int, str]]
TEXT = 50  # largest number of characters in a STATUSTEXT
SYSTEM = 1
COMPONENT = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
HEARTBEAT_S = 1.0
MOST_BYTES = 4096


def dialect() -> Any:
    """The module of pymavlink with the messages. Raises BadInput if it is not installed."""
    try:
        return import_module("pymavlink.dialects.v20.common")
    except ImportError:
        raise BadInput("sitl: MAVLink needs pymavlink, allowed: pip install 'beaver-ftc[flights]'") from None


class Mavlink:
    """One end of a line. malformed: number of parts of the input so far that are no message."""

    def __init__(self) -> None:
        self.messages = dialect()
        self.malformed = 0
        self._texts = 0
        self.begin()

    def begin(self) -> None:
        """Begin a new line, without the incomplete message of the old one."""
        self._mav = self.messages.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._mav.robust_parsing = True

    def pack(self, message: Message) -> bytes:
        """A message as bytes."""
        return bytes(message.pack(self._mav))

    def unpack(self, data: bytes) -> list[Message]:
        """The messages that end in these bytes."""
        found = self._mav.parse_buffer(data) or []
        sound = [message for message in found if message.get_type() != "BAD_DATA"]
        self.malformed += len(found) - len(sound)
        return sound

    def texts(self, said: Iterable[Text]) -> bytes:
        """The texts as STATUSTEXT messages; a text that is too long for one is split."""
        packed = b""
        for _, severity, text in said:
            given = text.encode("ascii", "replace")
            parts = [given[i : i + TEXT] for i in range(0, len(given), TEXT)]
            if len(parts) > 1:
                self._texts = self._texts % 65535 + 1
            number = self._texts if len(parts) > 1 else 0
            for i, part in enumerate(parts):
                packed += self.pack(self.messages.MAVLink_statustext_message(severity, part, number, i))
        return packed

    def obeyed(self, message: Message, inject: Inject) -> tuple[bytes, str]:
        """The answer to a MAV_CMD_INJECT_FAILURE, and a text on the fault; both empty for another message."""
        if message.get_type() != "COMMAND_LONG" or message.command != failures.COMMAND:
            return b"", ""
        result, says = inject((message.param1, message.param2, message.param3))
        back = message.get_srcSystem(), message.get_srcComponent()
        ack = self.messages.MAVLink_command_ack_message(message.command, result, 0, 0, *back)
        return self.pack(ack), says


class GroundLine:
    """Texts to a ground station over UDP, with a heartbeat each HEARTBEAT_S; and commands from it."""

    def __init__(self, host: str, port: int) -> None:
        self._mav = Mavlink()
        self._to = host, port
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._beat_s = -HEARTBEAT_S

    def fileno(self) -> int:
        """The file descriptor of the socket, for `select`."""
        return self._socket.fileno()

    def say(self, said: Iterable[Text]) -> None:
        """Send texts."""
        packed = self._mav.texts(said)
        if packed:
            self._send(packed)

    def serve(self, now_s: float, inject: Inject) -> list[str]:
        """Send a heartbeat if one is due, and execute the commands that have come. Returns a text for each.
        now_s: time of a monotonic clock."""
        if now_s >= self._beat_s + HEARTBEAT_S:
            self._beat_s = now_s
            m = self._mav.messages
            beat = m.MAVLink_heartbeat_message(
                m.MAV_TYPE_ONBOARD_CONTROLLER, m.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
            )
            self._send(self._mav.pack(beat))
        done: list[str] = []
        while True:
            try:
                data, _ = self._socket.recvfrom(MOST_BYTES)
            except OSError:  # no datagram
                return done
            for message in self._mav.unpack(data):
                answer, says = self._mav.obeyed(message, inject)
                if answer:
                    self._send(answer)
                    done.append(says)

    def _send(self, data: bytes) -> None:
        try:
            self._socket.sendto(data, self._to)
        except OSError:  # no ground station: the flight goes on
            return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
