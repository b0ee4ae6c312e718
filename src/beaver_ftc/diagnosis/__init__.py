"""Whether there is a fault, which it is, and how large: detection, isolation, fault types, monitors."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.base import Detector, Measured, Verdict
    from beaver_ftc.diagnosis.readout import OF_BLOCK, Actuator, DiagnosisReadout, SensorMonitor, TypesConfig
    from beaver_ftc.diagnosis.readout import Block as StatisticalBlock
    from beaver_ftc.diagnosis.readout import Hypothesis as StatisticalHypothesis
    from beaver_ftc.diagnosis.state import LOSS, UNANTICIPATED
else:
    __getattr__, __dir__ = lazily(__name__)
