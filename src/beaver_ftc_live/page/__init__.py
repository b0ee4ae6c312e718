"""The live cockpit: a flight that goes on while a page in the browser shows it, breaks it and repairs it.

    page (static/)  <- websocket ->  server  <- pipe ->  flight process

`messages` is what a page may say and how it is answered, `session` the flight and what is said of it, `game`
the hidden fault, `flying` the process and its clock, `gate` who is let in and may ask what, `server` the web
side, `serve` starts and ends it all. What server and flight process have to agree on stands here.
"""

EVERYONE = 0  # in place of a page's number
BAD_INPUT = "bad input"  # in place of a page: the flight cannot be begun
MAX_BYTES = 2048  # of one message of a page
MAX_GUESTS = 100
