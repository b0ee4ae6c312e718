"""Fault detection: worst-case filters with adaptive thresholds, and likelihood-ratio tests."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.detection.block_design import LEVEL_NOISE_SHARE
    from beaver_ftc.diagnosis.detection.blocks import N_SLOTS, new_filter_block, restarting_slot
    from beaver_ftc.diagnosis.detection.blocks import STEP_FAULT as STEP_HYPOTHESIS
    from beaver_ftc.diagnosis.detection.filters import filter_poles
    from beaver_ftc.diagnosis.detection.likelihood import bound_responses as response_of_block
    from beaver_ftc.diagnosis.detection.whitening import advance_covariance as advance_block
    from beaver_ftc.diagnosis.detection.whitening import whiten_step as whiten_frame
else:
    __getattr__, __dir__ = lazily(__name__)
