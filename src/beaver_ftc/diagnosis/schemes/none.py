"""No diagnosis: the detection filters stand where they began, and nothing is concluded."""

from beaver_ftc.compiled import apart
from beaver_ftc.diagnosis import scheme
from beaver_ftc.diagnosis.schemes import contract
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme


@apart
def begin(fdi, belief, measured):
    """Begin the detection filters, which the log records (contract.CompiledScheme)."""
    scheme.begin_filters(fdi, measured.x)


SCHEME = CompiledScheme(
    begin, contract.predict_nothing, contract.conclude_nothing, contract.prepare_nothing,
    contract.accumulate_nothing,
)  # fmt: skip
