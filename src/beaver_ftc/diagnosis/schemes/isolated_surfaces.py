"""The record of the isolated surfaces: since when each is isolated, its type, and why an isolation ends.

fdi    record of `schemes.fdi_dtype`
s      surface
t      s
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.conclusion import (
    PLUGIN_DECIDES,
    SENSOR_BROKEN,
    SEVERAL_POSSIBLE,
    SURFACE_REFUTED,
    TYPES_REFUTED,
    isolated_surface,
    update_interval,
)
from beaver_ftc.diagnosis.config import PLUGIN_SCHEME
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.types.registry import NAMED, SAME_NAME
from beaver_ftc.diagnosis.types.remaining import TYPE_UNDECIDED, any_remains
from beaver_ftc.diagnosis.types.verdict import DEDUCED_FAULTY


@kernel
def record_isolated_surfaces(fdi, t):
    """Record at t s which surfaces are isolated, and the type of each: where pairs are diagnosed, as their
    status says, else the one surface of the conclusion; none (`void`) once a sensor is found broken, unless
    the monitor keeps the surface."""
    concluded = fdi.verdict
    monitor = fdi.sensor_monitor
    pairs = fdi.types.pair.enabled
    void = sensor_monitor.has_alarm(monitor) and not monitor.output.keeps_surface
    sole = isolated_surface(concluded, fdi.isolation.estimator)
    for s, srf in enumerate(fdi.types.surface):
        isolated = srf.status.is_isolated if pairs else s == sole
        kind = srf.status.fault_type if pairs else concluded.fault_type
        name = SAME_NAME[kind] if kind >= 0 else -1
        reason = SENSOR_BROKEN if void else reason_of_withdrawal(fdi, s, isolated)
        update_interval(concluded, s, isolated and not void, t, name, reason)


@kernel
def reason_of_withdrawal(fdi, s, isolated):
    """The reason why the isolation of surface s, or its type, ends in this frame: the first that applies.

    PLUGIN_DECIDES      the scheme is a plug-in
    SURFACE_REFUTED     the estimator of the surface is excluded (of its position, if all types are
                        diagnosed, else of its loss)
    TYPES_REFUTED       all types are diagnosed, and the stored types of the first fault in pitch are
                        refuted, or no type of the name that it had (any name, if the surface itself is no
                        longer isolated) remains
    SEVERAL_POSSIBLE    otherwise
    """
    cfg = fdi.config
    srf = fdi.types.surface[s]
    j = fdi.layout.position[s] if cfg.diagnoses_all_types else fdi.layout.loss[s]
    if cfg.scheme_number == PLUGIN_SCHEME:
        return PLUGIN_DECIDES
    if j >= 0 and fdi.isolation.estimator[j].excluded:
        return SURFACE_REFUTED
    refuted = s == fdi.types.pair.first_pitch and srf.status.basis == DEDUCED_FAULTY
    named = fdi.verdict.isolated_type[s] if isolated else TYPE_UNDECIDED
    if cfg.diagnoses_all_types and (refuted or not any_remains(srf, NAMED[named])):
        return TYPES_REFUTED
    return SEVERAL_POSSIBLE
