"""The live cockpit: a flight that goes on while a page in the browser shows it, breaks it and repairs it.

    page (static/)  <- websocket ->  server  <- pipe ->  flight process

`messages` is what a page may say, `session` the flight and what is said of it, `pace` its clock, `game` the
hidden fault, `flying` the process, `gate` who is let in, `pages` who looks on, `server` and `serve` the rest.
"""
