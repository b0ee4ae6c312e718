"""Flights under an autopilot: the simulator in the JSON interface of ArduPilot and the MAVLink of PX4.

    autopilot  <- datagrams or TCP ->  endpoint (serve)  ->  protocol (ardupilot, px4)  ->  vehicle  ->  loop

- `ardupilot`, `px4`: packets and lockstep, without a socket: bytes in, bytes out
- `vehicle`: the flight, from outputs of the autopilot to an instant; `outputs`: from outputs to deflections
- `link`: counts of packets, and times of answers
- `telling`: texts on the results of the diagnosis; `failures`: faults by MAVLink commands; `mavlink` carries
  both, in addition to the protocol
- `serve`: joins all, and returns the result
"""

from enum import StrEnum

Protocol = StrEnum("Protocol", ["ardupilot", "px4"])
PORTS = {Protocol.ardupilot: 9002, Protocol.px4: 4560}
