"""The configuration that several stages of the diagnosis read: the scheme, and whose alarms and exclusions
count.

The number of a scheme decides which kernels fly: schemes/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import fill, record
from beaver_ftc.plugins import DETECTORS, is_compiled
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import FdiConfig

EITHER_DETECTOR, WORST_CASE_DETECTOR, STATISTICAL_DETECTOR = 0, 1, 2  # detectors whose conclusions count
AUTHORITIES = {
    "either": EITHER_DETECTOR,
    "worst-case": WORST_CASE_DETECTOR,
    "statistical": STATISTICAL_DETECTOR,
}
# Schemes: ours; the published one; none; that of a plug-in, whose verdict replaces ours.
ADAPTIVE_SCHEME, PUBLISHED_SCHEME, NO_SCHEME, PLUGIN_SCHEME = range(4)
_SCHEMES = {"adaptive-estimators": ADAPTIVE_SCHEME, "zhang2005": PUBLISHED_SCHEME, "none": NO_SCHEME}

# enabled: a compiled scheme diagnoses; scheme_number: of that scheme;
# authority, exclusion_authority: the detector whose alarms, and whose exclusions count, EITHER_DETECTOR,
# WORST_CASE_DETECTOR or STATISTICAL_DETECTOR; diagnoses_all_types: faults of every type;
# abrupt: a fault is declared to stay as it is; n_substeps: JSBSim steps in a frame; dt s.
SHARED_CONFIG_RECORD = record(
    enabled=int, scheme_number=int, exclusion_authority=int, authority=int, diagnoses_all_types=int,
    abrupt=int, n_substeps=int, dt=float,
)  # fmt: skip


def configure_shared(cfg: np.void, declared: Declared) -> None:
    """Fill the shared configuration (SHARED_CONFIG_RECORD)."""
    fdi = declared.fdi
    fill(
        cfg, enabled=fdi.diagnoses, dt=1.0 / declared.rate_hz, scheme_number=scheme_number(fdi.scheme),
        exclusion_authority=whose_exclusions(fdi), authority=AUTHORITIES[fdi.authority],
        diagnoses_all_types=fdi.fault_class == "all", abrupt=fdi.fault_profile == "abrupt",
        n_substeps=declared.substeps,
    )  # fmt: skip


def whose_exclusions(config: FdiConfig) -> int:
    """The detector whose exclusions count: EITHER_DETECTOR, WORST_CASE_DETECTOR or STATISTICAL_DETECTOR."""
    if not config.weighs_chance:
        return WORST_CASE_DETECTOR
    if config.fault_class == "all" and config.authority == "statistical":
        return EITHER_DETECTOR  # the worst case excludes types of fault for any authority
    return AUTHORITIES[config.authority]


def scheme_number(name: str) -> int:
    """The number of a scheme by its name in plugins.yaml; of every Python plug-in PLUGIN_SCHEME."""
    return _SCHEMES[name] if is_compiled(DETECTORS, name) else PLUGIN_SCHEME
