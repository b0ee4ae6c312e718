"""Check a log before a fit: columns, units, gaps, dead signals. Without a vehicle file, `proposal` proposes
one."""

from pathlib import Path

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import physics
from beaver_ftc_logs.likely_logs import read_likely
from beaver_ftc_logs.loading import read_vehicle_parts
from beaver_ftc_logs.proposal import NoVehicleError, guess_vehicle, rates_agree
from beaver_ftc_logs.recording import RecordedFlight
from beaver_ftc_logs.samples import convert_to_si, resample
from beaver_ftc_logs.usable_columns import named_angles
from beaver_ftc_logs.vehicle import Vehicle


def check_log(path: Path, vehicle: Vehicle | None, reader: str | None) -> Document:
    """The document on a log: remarks in `lines`, and the proposed vehicle file in `vehicle` if none is given.

    usable: whether the log can be identified or diagnosed with the vehicle. Raises BadInput if the log cannot
    be read at all.
    """
    lines: list[str] = []
    guess: Document | None = None
    if vehicle is None:
        likely = read_likely(path, reader)
        lines += likely.remarks
        try:
            guess = guess_vehicle(path, likely)
        except NoVehicleError as reason:
            lines.append(f"{path}: {reason}")
            return {"log": str(path), "usable": False, "lines": lines, "vehicle": None}
        vehicle = Vehicle.model_validate(guess)
    checks = [_check_recording(log, vehicle) for log in read_vehicle_parts(path, vehicle, reader)]
    for part, (_, remarks) in enumerate(checks, 1):
        head = f"part {part} of {len(checks)}: " if len(checks) > 1 else ""
        lines += [f"{head}{remark}" for remark in remarks]
    usable = all(is_usable for is_usable, _ in checks)
    return {"log": str(path), "usable": usable, "lines": lines, "vehicle": guess}


def _check_recording(log: RecordedFlight, vehicle: Vehicle) -> tuple[bool, list[str]]:
    """Whether a log can be identified or diagnosed, and the lines that describe it."""
    try:
        samples = resample(log, vehicle)
    except BadInput as error:
        return False, [str(error)]
    n_gaps = int(samples.stretch_number[-1])
    span_s = float(samples.t_s[-1] - samples.t_s[0])
    gap = f", the longest of {np.diff(samples.t_s).max():.4g} s" if n_gaps else ""
    size = (
        f"{len(samples.t_s)} samples at {1.0 / samples.dt_s:.3g} Hz over {span_s:.4g} s; gaps: {n_gaps}{gap}"
    )
    still = [
        f"rate {axis} does not move: nothing can be identified or diagnosed"
        for axis, rate in zip("pqr", samples.rates.T, strict=True)
        if np.unique(rate[np.isfinite(rate)]).size < 2
    ]
    return not still, [size, *samples.notes, *_compare_angles(log, vehicle), *still]


def _compare_angles(log: RecordedFlight, vehicle: Vehicle) -> list[str]:
    """A line for each pair of rate and angle, both in SI, whether they agree; or one line with the reason why
    the roll rate cannot be compared: pitch and yaw are not compared then either."""
    columns = convert_to_si(log, vehicle).columns
    angles = named_angles(columns, vehicle)
    if angles[0] is None:
        return ["no roll angle is named and logged: whether the rates are in rad/s is not checked"]
    gyros = [columns[name] for name in vehicle.rate_columns]
    in_si = [angle and angle[1] for angle in angles]
    fits = [physics.fit_angle(gyros, in_si, axis) for axis in range(3)]
    if fits[0] is None:
        return ["too little moves to compare the rates with the roll angle"]
    return [
        f"the change of {angle[0]} is {fit.slope:.3f} times the integral of {rate} (correlation "
        f"{fit.correlation:.2f}): {'they agree' if rates_agree(fit) else 'they tell nothing of one another'}"
        for fit, angle, rate in zip(fits, angles, vehicle.rate_columns, strict=True)
        if fit and angle
    ]


def as_text(findings: Document) -> str:
    """The document of `check_log` as lines of text."""
    usable = "can be used" if findings["usable"] else "cannot be used so"
    return "\n".join([f"{findings['log']}: {usable}", *(f"  {line}" for line in findings["lines"])])
