"""Whether there is a fault, which it is, and how large: detection, isolation, fault types, monitors."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.base import Detector, Measured, Verdict
    from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2
    from beaver_ftc.diagnosis.isolation import estimator_names
    from beaver_ftc.diagnosis.readout import OF_BLOCK, Actuator, DiagnosisReadout, SensorMonitor, TypesConfig
    from beaver_ftc.diagnosis.readout import Block as StatisticalBlock
    from beaver_ftc.diagnosis.readout import Hypothesis as StatisticalHypothesis
    from beaver_ftc.diagnosis.state import LOSS, UNANTICIPATED, scheme_number
else:
    __getattr__, __dir__ = lazily(__name__)
