"""Fault detection: worst-case filters with adaptive thresholds, and likelihood-ratio tests."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.detection.filters import filter_poles_per_s
    from beaver_ftc.diagnosis.detection.likelihood import (
        N_ONSET_SLOTS,
        new_filter_block,
        onset_slot_restarting_at_frame,
    )
    from beaver_ftc.diagnosis.detection.likelihood import STEP_FAULT as STEP_HYPOTHESIS
    from beaver_ftc.diagnosis.detection.likelihood import advance_covariance as advance_block
    from beaver_ftc.diagnosis.detection.likelihood import advance_whitening_filter as whiten_frame
    from beaver_ftc.diagnosis.detection.likelihood import (
        fill_uncertainty_response_bounds as response_of_block,
    )
    from beaver_ftc.diagnosis.detection.statistical import NOISE_SHARE_OF_ALARM_LEVEL
else:
    __getattr__, __dir__ = lazily(__name__)
