"""Recorded flights: read them, identify how the rates respond to the commands, and diagnose faults.

`readers` (one file for each format) give a `RecordedFlight`. `samples` puts its columns on one time base.
`preparation` scales and whitens flights for a fit. `identification` calls `fitting` for the model, and tests
it. `diagnose` filters a flight with the model. `by_aircraft` uses the design model of an aircraft instead.
`findings`, `pages` and `identification_page` write the results. `check` tests a log before all of this, and
`proposal` proposes a vehicle file for it.
"""
