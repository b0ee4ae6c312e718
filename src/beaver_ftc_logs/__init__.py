"""Recorded flights: read them, identify how the rates respond to the commands, and diagnose faults.

read        `readers` (one file for each format) give a `RecordedFlight`. `samples` puts its columns on one
            time base; `loading` does both. `usable_columns` and `unit_mistakes` refuse columns.
vehicle     `vehicle` has the vehicle file; `vehicle_of_logs` fills it by the `mixing` in a log.
            `check` tests a log before all of this, and `proposal` proposes a vehicle file for it.
regression  `regression` makes the one regression of a flight; all below select from it.
fit         `preparation` scales flights, `noise_search` whitens them. `orders` fits, `noise_models`,
            `effect_errors`, `gains` and `noise_inflation` say how well the fit is known. `fitting` has the
            settings, some from `setting_estimates`; `validation` has the threshold. `identification`
            calls all of these and tests the `model`.
diagnose    `column_mistakes` and `motion_units` refuse a log. `bank` and `flight_states` make the
            hypotheses and states of the filters (`filtering`), `posterior` and `evidence` their
            probabilities, `posterior_rows` and `naming` the rows of the diagnosis. `trust` withdraws
            rows that are not credible. `diagnose` calls all of these, `detectors` has rivals.
aircraft    `by_aircraft` uses the design model of an aircraft instead of a fit.
results     `findings`, `isolability`, `pages`, `identification_text` and `identification_page`.
"""
