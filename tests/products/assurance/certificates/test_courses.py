"""Exclusions by a course, rule by rule, on a surface seen by hand: which frames, compared with what."""

from types import SimpleNamespace

import pytest

from beaver_ftc.diagnosis.readout import Actuator, FaultTypesConfig
from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER, N_TYPES, TYPES
from beaver_ftc_assurance.certificates import check_certificate, courses, kinds
from telling import numbers

CONFIG = FaultTypesConfig(
    single_instant=True,
    n_substeps=2,
    returns_lagged=False,
    half_blocks=2,
    frames_per_block=1,
    block_duration_s=0.05,
    dt_s=0.5,
)


def tape(travel=(-0.2, 0.7), blocks=1):
    """Surface 1 of three, whose position is estimator 2: all that it adds, five frames from the tenth on."""
    offset, slope, spread = numbers(3, 5, 4, 3)
    actuator = Actuator(*travel, 0.1, 0.2, 0.3)
    diagnosis = SimpleNamespace(
        layout=SimpleNamespace(
            position_estimator_index_by_surface=(0, 2, 3), dominant_axis_by_surface=(0, 1, 2)
        ),
        estimators=[SimpleNamespace(active_axes=(e,)) for e in "abcd"],
        surface_fault_types=[None, SimpleNamespace(actuator=actuator), None],
        types_config=CONFIG._replace(frames_per_block=blocks),
    )
    return SimpleNamespace(
        first=10, offset=offset, slope=slope, spread=spread, alarm=SimpleNamespace(diagnosis=diagnosis)
    )


@pytest.mark.parametrize("kind", range(N_TYPES))
def test_the_checker_defines_every_type_as_its_row_does(kind):
    """It is written apart from the rows; of the types of the package it takes nothing from the log."""
    row, words, travel = TYPES[kind], DESCRIPTIONS_IN_TYPE_ORDER[kind], (-0.2, 0.7)
    if row.frames_test:
        assert check_certificate.COURSES[words] == (
            row.frames_test.replace(" ", "_"),
            row.stop_direction,
        )
        assert row.frames_test in courses.RULES
    else:
        expected = (
            row.deflection_relation.command_gain,
            row.deflection_relation.theta_is_share,
            row.has_constant_parameter,
        )
        assert check_certificate.RELATIONS[words](*travel) == (
            *expected,
            *row.deflection_relation.theta_span(*travel),
        )
    assert kinds.type_definition_columns(tape(), "aileron", 1, kind) == {}
