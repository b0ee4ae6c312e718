"""Fault detection: worst-case filters with adaptive thresholds, and likelihood-ratio tests."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.detection.filters import poles_of
    from beaver_ftc.diagnosis.detection.likelihood import N_SLOTS, filter_block, slot_to_reset
    from beaver_ftc.diagnosis.detection.likelihood import STEP as STEP_HYPOTHESIS
    from beaver_ftc.diagnosis.detection.likelihood import advance_covariance as advance_block
    from beaver_ftc.diagnosis.detection.likelihood import fill_uncertainty_response as response_of_block
    from beaver_ftc.diagnosis.detection.likelihood import whiten as whiten_frame
    from beaver_ftc.diagnosis.detection.noise_model import CHANCE
else:
    __getattr__, __dir__ = lazily(__name__)
