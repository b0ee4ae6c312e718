"""The former place of the Gymnasium environments, accepted for one version more."""

import warnings

from beaver_ftc.plugins import required

__all__ = ["BeaverEnv", "BeaverVectorEnv"]

_HERE = "beaver_ftc.integrations.gym"

warnings.warn(f"{_HERE} has moved to beaver_ftc_links.gym", DeprecationWarning, stacklevel=2)
BeaverEnv = required("environment", _HERE)
BeaverVectorEnv = required("vector_environment", _HERE)
