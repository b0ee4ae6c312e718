"""How far a runaway surface has come: at no less than half its rate limit towards a stop, where it stays."""

from beaver_ftc.compiled import kernel


@kernel
def way(fdi, surface, frame):
    """The least way (rad) a runaway has gone by a frame; over a block the mean was reached within it."""
    elapsed = frame - surface.started_at
    if fdi.types.config.length > 1:
        elapsed = max(elapsed - 1, 0)
    return surface.least_runaway_rate * fdi.types.config.span_s * elapsed


@kernel
def upwards(fdi, surface, frame):
    """How far up a runaway has come by a frame, at least: rad, the stop at most."""
    if surface.started_at < 0:
        return surface.travel_low
    return min(surface.travel_high, surface.start_low + way(fdi, surface, frame))


@kernel
def downwards(fdi, surface, frame):
    """How far down one has come: rad, the stop at most."""
    if surface.started_at < 0:
        return surface.travel_high
    return max(surface.travel_low, surface.start_high - way(fdi, surface, frame))
