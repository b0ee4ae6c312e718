"""The printed text of an identification: one line for each assumption, test and remark."""

from beaver_ftc.results import Document
from beaver_ftc_logs.fit_checks import LEAST_INFLATION
from beaver_ftc_logs.identification import SCORES, axis_text
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.trust import unknown_sentences


def identification_text(model: Model) -> str:
    """The identification as text: a line on the fit, and an indented line for each finding."""
    results: Document = model.identified
    flights = results["flights"]
    lines = [
        f"{model.vehicle.name}: {sum(flight['samples'] for flight in flights)} samples at "
        f"{model.rate_hz:.3g} Hz, flights: {len(flights)}; past samples of the rates: {model.history}, "
        f"of the commands: {model.lags}",
        *results.get("assumed", []),
        *_model_lines(model),
        *unknown_sentences(model),
        *(f"{flight['name']}: {note}" for flight in flights for note in flight["notes"]),
        *map(_fold_text, results["tests"]),
        *_day_lines(results["another_day"], len(flights)),
        f"the residual's colour widens standard errors by {axis_text(results['colour'])}",
    ]
    if "delay_s" in (output := results["output_error"]):
        lines.append(_output_error_text(output))
    if collinear := results["collinear"]:
        lines.append(_collinear_text(collinear))
    return "\n  ".join(lines)


def _model_lines(model: Model) -> list[str]:
    """Lines on the groups of surfaces, on their powers of the airspeed and on the noise models."""
    lines = [f"together, not distinguishable: {', '.join(group)}" for group in model.groups if len(group) > 1]
    vehicle = model.vehicle
    if (V0 := vehicle.reference_airspeed_mps) is not None:
        powers = [f", {s} with airspeed^{n:g}" for s, n in vehicle.airspeed_powers.items() if n != 2]
        lines.append(f"surfaces work with the dynamic pressure, 1 at {V0:.4g} m/s{''.join(powers)}")
    lines += [
        f"noise of the colour {', '.join(f'{c:.3g}' for c in noise.average)}: {noise.wider:.2g} times as "
        "wide, in squares, as gains of 10 s left out differ, and other laws may"
        for noise in model.colours
    ]
    return list(dict.fromkeys(lines))  # several noises of one colour may read the same


def _output_error_text(output: Document) -> str:
    """The line on the fit of free runs: servo lag and delay, s, with their standard deviations."""
    lag = f"servo lag {output['servo_lag_s']:.3f} s (sd {output['servo_lag_sd_s']:.3f})"
    if output["shorter_than_can_be_told"]:
        lag = "servo lag shorter than this rate can tell"
    delay = f"delay {output['delay_s']:.3f} s (sd {output['delay_sd_s']:.3f})"
    explained = axis_text(output["explained_of_windows_not_fitted"])
    return f"output error: {lag}, {delay}, explains of 2 s free runs not fitted {explained}"


def _collinear_text(collinear: list[Document]) -> str:
    """The line on regressors that the others nearly determine. collinear: the worst comes first."""
    worst = collinear[0]
    n = len(collinear)
    are = "regressors are" if n > 1 else "regressor is"
    factor = worst["inflation"]
    times = "made up by the others" if factor is None else f"{factor:.0f} times"
    return (
        f"{n} {are} collinear (variance inflated over {LEAST_INFLATION:g} times), most {worst['regressor']} "
        f"({times})"
    )


def _day_lines(expected: Document, n_flights: int) -> list[str]:
    """Lines on flights that were not fitted. With a single flight, its halves are left out: they show nothing
    about another day.
    """
    half = "another half of this day, not of another day"
    unit = "another day, each left out in turn" if n_flights > 1 else half
    lines = []
    if "classes" in expected:
        scores = [
            f"{key.replace('_', ' ')} {expected[key]['mean']:.3f} ({expected[key]['worst']:.3f})"
            for key in SCORES
        ]
        lines.append(f"expect of {unit}, mean (worst): {', '.join(scores)}")
    if "false_alarms_per_hour" in expected:
        alarms = expected["false_alarms_per_hour"]
        lines.append(
            f"false alarms: {alarms['asked']:g} an hour asked for, "
            f"{alarms['low']:.2g} to {alarms['high']:.2g} at 90 %, "
            f"by {expected['minutes_left_out']:.1f} min of health left out"
        )
        if missing := expected["minutes_missing"]:
            lines.append(f"to show this rate without a fitted tail {missing:.0f} min of health are missing")
        if expected.get("parts"):
            alarmed = f"{expected['alarmed']} of {expected['parts']} parts left out alarm"
            lines.append(f"at the threshold of the others {alarmed}")
    return lines


def _fold_text(fold: Document) -> str:
    """The line on a part left out: how well the model of the others explains it."""
    if not fold["samples"]:
        return f"without {fold['left_out']}: nothing in it is known"
    line = f"without {fold['left_out']}: explains {axis_text(fold['explained'])} of it"
    if "score" not in fold:
        return line
    scores = fold["score"]
    return (
        f"{line}; {len(scores['settings'])} classes {scores['classes']:.3f}, healthy or faulty "
        f"{scores['healthy_or_faulty']:.3f}, side {scores['side']:.3f}, mean error {scores['mean_error']:.3f}"
    )
