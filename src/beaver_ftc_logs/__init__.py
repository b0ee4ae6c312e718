"""Recorded flights: read them, identify how the vehicle answers its commands, and say what broke and when.

The order of the work is the order of the modules: `readers` (one file a format) give a `RecordedFlight`,
`samples` puts its columns on one time base, `fitting` finds the model and `identification` says how good it
is, `diagnose` filters a flight with it, `findings` and `pages` say what was found and what cannot be known.
"""
