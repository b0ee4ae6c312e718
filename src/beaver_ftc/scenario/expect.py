"""What a flight must meet (`expect:`)."""

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from beaver_ftc.documents.document import Flag, Number, Section, entry, number
from beaver_ftc.scenario.faults import FaultType, Nameable

# What is expected of the diagnosis; and what of a fault, without which it cannot be expected.
OF_DIAGNOSIS = ("detected_within_s", "isolated_as", "isolated_within_s", "isolated_type", "candidate_type")
OF_A_FAULT = (*OF_DIAGNOSIS, "post_fault_rms_deg_s")
MOST_NAMES = 20  # of a flight: as many surfaces as an aircraft may have


class RmsLimits(Section):
    """Largest allowed root mean square (RMS) of the tracking error on each axis."""

    p: Number | None = number(None, "deg/s", "roll rate", ge=0, le=1000, examples=[1.5])
    q: Number | None = number(None, "deg/s", "pitch rate", ge=0, le=1000, examples=[1.5])
    r: Number | None = number(None, "deg/s", "yaw rate", ge=0, le=1000, examples=[1.5])


class Arrival(Section):
    """Largest allowed deviations from the commanded flight path at the end of the flight. Before the
    check, a first-order lag with a time constant of 10 s smooths each deviation."""

    altitude_m: Number | None = number(None, "m", "altitude", gt=0, le=10_000, examples=[10])
    airspeed_mps: Number | None = number(None, "m/s", "airspeed", gt=0, le=100, examples=[2])
    heading_deg: Number | None = number(None, "deg", "heading", gt=0, le=180, examples=[5])
    in_envelope: Flag | None = entry(None, "whether the flight must end inside the validated envelope")


def _one_or_list(given: Any) -> str:
    return "(list)" if isinstance(given, list | tuple) else "(one)"


Names = Annotated[tuple[Nameable, ...], Field(max_length=MOST_NAMES)]


class Expect(Section):
    """Conditions that the flight must meet. A condition that is left out is not checked.

    detected_within_s: largest time from the fault to the first alarm, s
    isolated_as: name that the diagnosis must give: a surface, an instrument such as `sensor p`, or
    `unanticipated`. A list has one name for each fault, in their order
    isolated_type: fault type that the diagnosis must name
    candidate_type: fault type that must be named or stay possible
    isolated_within_s: largest time from the fault to its name, s
    no_false_alarm: whether no alarm may come before the first fault
    no_departure: whether the aircraft must survive
    pre_fault_rms_deg_s: largest RMS tracking error before the fault, without a fault of the whole flight
    post_fault_rms_deg_s: largest RMS tracking error after the fault
    altitude_within_m: largest deviation from the commanded altitude, m
    airspeed_within_mps: largest deviation from the commanded airspeed, after a lag of 10 s, m/s
    airspeed_within_limits_mps: as `airspeed_within_mps`, with a command that the aircraft can hold after the
    fault, m/s
    heading_within_deg: largest deviation from the commanded heading, without 30 s after each change, deg
    stays_in_envelope: whether the flight must stay inside the validated envelope
    arrives: largest deviations from the flight path at the end, after a lag of 10 s. A lost aircraft does
    not arrive
    """

    detected_within_s: Number | None = number(None, "s", ge=0, le=360_000, examples=[0.5])
    isolated_as: (
        Annotated[
            Annotated[Nameable, Tag("(one)")] | Annotated[Names, Tag("(list)")], Discriminator(_one_or_list)
        ]
        | None
    ) = entry(None, examples=["elevator", ["elevator", "rudder"]])
    isolated_type: FaultType | None = None
    candidate_type: FaultType | None = None
    isolated_within_s: Number | None = number(None, "s", ge=0, le=360_000, examples=[2])
    no_false_alarm: Flag | None = None
    no_departure: Flag | None = None
    pre_fault_rms_deg_s: RmsLimits | None = None
    post_fault_rms_deg_s: RmsLimits | None = None
    altitude_within_m: Number | None = number(None, "m", gt=0, le=10_000, examples=[25])
    airspeed_within_mps: Number | None = number(None, "m/s", gt=0, le=100, examples=[3.5])
    airspeed_within_limits_mps: Number | None = number(None, "m/s", gt=0, le=100, examples=[2])
    heading_within_deg: Number | None = number(None, "deg", gt=0, le=180, examples=[6])
    stays_in_envelope: Flag | None = None
    arrives: Arrival | None = None
