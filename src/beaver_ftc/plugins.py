"""Which detectors and laws there are: built in, by entry point of an installed package, or `module:Class`.

    [project.entry-points."beaver_ftc.detectors"]        # in the pyproject.toml of the package
    my-detector = "my_package:MyDetector"

A scenario names them by `fdi.scheme` and `control.law`; it never names a path.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module, util
from inspect import getdoc, isclass

from beaver_ftc.errors import BadInput, suggestion

DETECTORS, LAWS = "beaver_ftc.detectors", "beaver_ftc.laws"
OURS = "beaver-ftc"
_BY_CLASS = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")

# Name -> (module:Class, what `list` says of it). Without a class it is in the compiled frame itself.
_OURS = {
    DETECTORS: {
        "adaptive-estimators": (
            "",
            "N + 1 nonlinear adaptive estimators with adaptive thresholds [Zhang2005].",
        ),
        "none": ("", "No diagnosis."),
        "rls-monitor": (
            "beaver_ftc.diagnosis.rivals.rls:RlsMonitor",
            "Recursive least-squares monitor of each surface and its rate, without a model [Keipour2019].",
        ),
        "augmented-ekf": (
            "beaver_ftc.diagnosis.rivals.ekf:AugmentedEkf",
            "Extended Kalman filter of effectiveness, chi-square test on the estimates [Jazwinski1970].",
        ),
        "augmented-ukf": (
            "beaver_ftc.diagnosis.rivals.ukf:AugmentedUkf",
            "Unscented Kalman filter of effectiveness, CUSUM on the innovation squared [Julier2004].",
        ),
        "multiple-models": (
            "beaver_ftc.diagnosis.rivals.imm:InteractingMultipleModels",
            "Interacting multiple models of lost effectiveness, alarm on the odds of a fault [Blom1988].",
        ),
        "observer-constant": (
            "beaver_ftc.diagnosis.rivals.observer:ConstantThresholdObserver",
            "Observer residual with a constant threshold, surface named by least squares [Chen1999].",
        ),
    },
    LAWS: {
        "nominal": ("", "Feedback linearisation with proportional-integral feedback."),
        "adaptive": (
            "",
            "Nominal, and compensates an unknown fault by what the estimators have learnt of it.",
        ),
        "fault-tolerant": ("", "Adaptive, and hands pitch control from a weak elevator to the flap."),
        "oracle": ("", "Fault-tolerant, and told the true fault the moment it occurs: the yardstick."),
        "indi": (
            "beaver_ftc.control.rivals.indi:IncrementalInversion",
            "Incremental nonlinear dynamic inversion on filtered angular acceleration [Sieberling2010].",
        ),
        "l1-adaptive": (
            "beaver_ftc.control.rivals.l1:L1Adaptive",
            "L1 adaptive control, piecewise-constant adaptation behind a low-pass filter [Hovakimyan2010].",
        ),
        "lqr": (
            "beaver_ftc.control.rivals.lqr:FixedGainLqr",
            "Fixed-gain linear quadratic regulator about the trim, with integral action [Anderson1990].",
        ),
    },
}
_METHODS = ("reset", "step")


@dataclass(frozen=True)
class Registered:
    """A detector or law by name. target: `module:Class`, empty for what the compiled frame does itself."""

    group: str
    name: str
    target: str
    package: str
    says: str = ""

    def description(self) -> str:
        """One line; of another package's class the first of its docstring, or why it cannot be loaded."""
        if self.says:
            return self.says
        try:
            return (getdoc(plugin_class(self.group, self.name)) or "").partition("\n")[0]
        except BadInput as error:
            return f"broken: {error}"


def is_compiled(group: str, name: str) -> bool:
    """Whether the compiled frame does this scheme or law itself."""
    return name in _OURS[group] and not _OURS[group][name][0]


def registered(group: str) -> dict[str, Registered]:
    """Everything registered under DETECTORS or LAWS, by name, ours first; imports none of it."""
    ours = {
        name: Registered(group, name, target, OURS, says) for name, (target, says) in _OURS[group].items()
    }
    others = {entry.name: entry for entry in _from_packages(group) if entry.name not in ours}
    return ours | others


def _from_packages(group: str) -> Iterable[Registered]:
    from importlib.metadata import entry_points

    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        yield Registered(group, point.name, point.value, point.dist.name if point.dist else "")


def refusal(group: str, name: str) -> str | None:
    """What is wrong with a scheme's or law's name in a scenario, and what is allowed; None if nothing is."""
    if name in _OURS[group]:
        return None
    known = registered(group)
    if name in known:
        return None
    if not _BY_CLASS.fullmatch(name):
        what = "scheme" if group == DETECTORS else "law"
        return (
            f"unknown {what} {name[:100]!r}{suggestion(name, known)}, or module:Class of an installed package"
        )
    module = name.partition(".")[0].partition(":")[0]
    return None if util.find_spec(module) else f"no installed package has the module {module!r}"


def plugin_class(group: str, name: str) -> type:
    """The class behind a name that is not compiled in. Raises BadInput, naming it, if there is none."""
    entry = registered(group).get(name)
    target = entry.target if entry else name
    module, _, attribute = target.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except Exception as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"plug-in {name}: cannot load {target}: {type(error).__name__}: {reason}") from error
    missing = [method for method in _METHODS if not callable(getattr(found, method, None))]
    if not isclass(found) or missing:
        needs = f"lacks {' and '.join(missing)}" if missing else "is not a class"
        raise BadInput(f"plug-in {name}: {target} {needs}, allowed: a class with reset and step")
    return found
