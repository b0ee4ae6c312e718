"""Random scenarios within the schema, for the properties that must hold for all of them."""

from hypothesis import strategies as st

AMPLITUDES = st.floats(-50, 50).map(lambda x: round(x, 6))


def numbers(least: float, most: float):
    return st.floats(least, most, allow_nan=False)


def optional(**fields):
    return st.fixed_dictionaries({}, optional=fields)


WINDOW = {"start_s": numbers(0, 50), "end_s": numbers(51, 90)}
SHAPES = {
    "sine": (
        {"amplitude_deg_s": AMPLITUDES, "frequency_hz": numbers(0.01, 5)},
        {"phase_deg": numbers(-360, 360)},
    ),
    "doublet": ({"amplitude_deg_s": AMPLITUDES}, {"width_s": numbers(0.01, 9)}),
    "step": ({"amplitude_deg_s": AMPLITUDES}, WINDOW),
    "square": ({"amplitude_deg_s": AMPLITUDES, "frequency_hz": numbers(0.01, 5)}, WINDOW),
    "ramp": ({"amplitude_deg_s": AMPLITUDES, "end_s": numbers(51, 90)}, {"start_s": numbers(0, 50)}),
    "chirp": (
        {
            "amplitude_deg_s": AMPLITUDES,
            "start_frequency_hz": numbers(0.01, 5),
            "end_frequency_hz": numbers(0.01, 5),
            "end_s": numbers(51, 90),
        },
        {"start_s": numbers(0, 50)},
    ),
    "csv": (
        {
            "file": st.just("a.csv"),
            "time_s": st.just([0.0, 1.5]),
            "values_deg_s": st.lists(AMPLITUDES, min_size=2, max_size=2),
        },
        {},
    ),
}  # fmt: skip
SIGNALS = st.lists(
    st.one_of(
        st.fixed_dictionaries({kind: st.fixed_dictionaries(needed, optional=extra)})
        for kind, (needed, extra) in SHAPES.items()
    ),
    max_size=3,
)
PARAMETERS = {
    "loss_of_effectiveness": {"magnitude": numbers(0, 1)},
    "stuck": {"position_deg": numbers(-5, 15)},  # within the stops of every surface
    "hardover": {"direction": st.sampled_from([1, -1])},
    "float": {},
    "bias": {"bias_deg": numbers(-10, 10)},
    "rate_limit": {"scale": numbers(0, 1)},
    "oscillatory": {"amplitude_deg": numbers(0.01, 10), "frequency_rad_s": numbers(0.1, 100)},
}
SURFACES = st.sampled_from(["aileron", "elevator", "rudder", "flap"])
FAULTS = st.lists(
    st.one_of(
        *(
            st.fixed_dictionaries(
                {"type": st.just(kind), "actuator": SURFACES, "at_s": numbers(0, 20), **parameters},
                optional={"end_s": numbers(21, 90)},
            )
            for kind, parameters in PARAMETERS.items()
        ),
        st.fixed_dictionaries(
            {
                "type": st.just("unanticipated"),
                "at_s": numbers(0, 20),
                "profile": st.just("incipient"),
                "kappa_per_s": numbers(0.01, 100),
            }
        ),
    ),
    max_size=4,
)
DYNAMICS = optional(
    bandwidth_rad_s=numbers(0, 100), rate_limit_deg_s=numbers(0, 100), travel_deg=st.just([-10.0, 20.5])
)
SCENARIOS = st.fixed_dictionaries(
    {"name": st.from_regex(r"[A-Za-z0-9_-]{1,100}", fullmatch=True), "duration_s": numbers(30, 360_000)},
    optional={
        "description": st.text(max_size=200),
        "seed": st.integers(0, 2**63 - 1),
        "substeps": st.integers(1, 50),
        "initial": optional(airspeed_mps=numbers(20, 70), altitude_m=numbers(-300, 6000)),
        "reference": optional(p=SIGNALS, q=SIGNALS, r=SIGNALS),
        "faults": FAULTS,
        "uncertainty": optional(
            inertia_coupling=optional(p=numbers(-1, 1)),
            coefficients=st.dictionaries(st.sampled_from(["Cm_alpha", "Cl_da", "Cn_dr"]), numbers(-10, 10)),
        ),
        "actuators": st.one_of(st.sampled_from(["ideal", "servo"]), DYNAMICS, optional(flap=DYNAMICS)),
        "sensors": st.one_of(st.just("ideal"), optional(q=optional(noise_std_deg_s=numbers(0, 1)))),
        "environment": st.one_of(
            optional(wind_mps=st.lists(numbers(-20, 20), min_size=3, max_size=3)),
            st.just({"turbulence": "dryden", "severity": "light"}),
        ),
        "design_model": optional(engine_terms=st.booleans()),
        "expect": optional(no_departure=st.booleans(), no_false_alarm=st.booleans()),
    },
)
