"""Recorded flights: read them, identify how the rates respond to the commands, and diagnose faults.

read        `readers` (one file for each format) give a `RecordedFlight`. `samples` puts its columns on one
            time base; `loading` does both. `usable_columns` and `unit_mistakes` refuse columns, `refusals`
            has the words.
vehicle     `vehicle` and `vehicle_columns` have the vehicle file; `vehicle_of_logs` fills it by the `mixing`
            in a log. `check` tests a log before all of this, `proposal` proposes a vehicle file for it, and
            `likely_logs` reads one without.
regression  `regression` makes the one regression of a flight; all below select from it.
fit         `fit_parts` has the flights of a fit. `preparation` scales them, `noise_search` whitens them.
            `orders` fits, `noise_models`, `effect_errors`, `gains` and `noise_inflation` say how well the fit
            is known. `fitting` has the settings, some from `setting_estimates`; `validation` has the
            threshold. `identification` calls all of these and tests the `model`.
diagnose    `column_mistakes` and `motion_units` refuse a log. `bank` and `flight_states` make the
            hypotheses and states of the filters (`filtering`), `posterior` and `evidence` their
            probabilities, `posterior_rows` and `naming` the rows of the diagnosis. `trust` withdraws
            rows that are not credible. `diagnose` calls all of these, `detectors` has rivals.
aircraft    `by_aircraft` uses the design model of an aircraft instead of a fit; `aircraft_verdict` judges.
results     `findings`, `isolability`, `pages`, `identification_text` and `identification_page`.
"""
