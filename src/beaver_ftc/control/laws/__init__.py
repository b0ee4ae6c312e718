"""The control laws by name: what use each makes of the verdict, and which inner law makes its demand."""

NOMINAL, ADAPTIVE, FAULT_TOLERANT, ORACLE = range(4)
LAWS = ("nominal", "adaptive", "fault-tolerant", "oracle")  # what use is made of the verdict
PUBLISHED, REJECTING, INDI, LQR, ADAPTING = range(5)  # inner laws: which file makes the demand
COMPILED = {
    "nominal": (NOMINAL, PUBLISHED),
    "adaptive": (ADAPTIVE, PUBLISHED),
    "fault-tolerant": (FAULT_TOLERANT, REJECTING),
    "zhang2005": (FAULT_TOLERANT, ADAPTING),
    "fault-tolerant-published": (FAULT_TOLERANT, PUBLISHED),
    "oracle": (ORACLE, REJECTING),
    "oracle-published": (ORACLE, PUBLISHED),
}


def law_of(name: str) -> tuple[int, int]:
    """What use a law makes of the verdict, and its inner law; of a plug-in those that do the least."""
    return COMPILED.get(name, (NOMINAL, PUBLISHED))
