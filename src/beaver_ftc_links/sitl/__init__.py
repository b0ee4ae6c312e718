"""Under an autopilot: the physics end of ArduPilot's JSON interface and of PX4's simulator interface.

    autopilot  <- datagrams or TCP ->  endpoint (serve)  ->  protocol (ardupilot, px4)  ->  vehicle  ->  loop

`protocol` classes know the packets and the lockstep and have no socket: bytes in, bytes out. `vehicle` is the
flight: outputs in, an instant out; `outputs` makes deflections of outputs. `link` counts what came in and how
quickly it was answered. `telling` puts in words what the diagnosis finds, `failures` breaks what a MAVLink
command asks for, `mavlink` carries both beside the protocol. `serve` joins them and writes the result.
"""

from enum import StrEnum

Protocol = StrEnum("Protocol", ["ardupilot", "px4"])
PORTS = {Protocol.ardupilot: 9002, Protocol.px4: 4560}
