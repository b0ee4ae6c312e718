"""Exact confidence limits for counts: what has not been seen yet, and how sure one may be of it."""


def poisson_upper(events: int, exposure: float, confidence: float = 0.95) -> float:
    """Upper limit of a rate after `events` in `exposure`: the rate that gives so few with 1 - confidence
    [Garwood1936].
    """
    from scipy.special import gammaincinv

    return float(gammaincinv(events + 1, confidence)) / exposure if exposure > 0 else float("inf")


def binomial_upper(events: int, trials: int, confidence: float = 0.95) -> float:
    """Upper limit of a probability after `events` in `trials` [ClopperPearson1934]."""
    from scipy.special import betaincinv

    return float(betaincinv(events + 1, trials - events, confidence)) if events < trials else 1.0
