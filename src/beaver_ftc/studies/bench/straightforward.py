"""The loop as one writes it first: properties by name, published equations in NumPy, a dictionary a frame.

It flies the published scheme: the detection estimator with its network, three isolation estimators with
interval thresholds, and feedback linearisation. The bench compares its time with that of the loop; tests
compare its verdict. The modules of the loop have the sources of the equations.
"""

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.control.laws.reference import discretise
from beaver_ftc.design.fdc import GEOMETRY, INERTIA_KG_M2, LENGTHS_M, MASS, MOMENTS, SURFACES, TERMS
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.diagnosis.detection.fdae import (
    ALPHA_CENTRES_RAD,
    BETA_CENTRES_RAD,
    N_BASIS,
)
from beaver_ftc.plant import channels as ch
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import sample
from beaver_ftc.studies.bench.contenders import FLAP, MAIN, take_over

SIGNALS = ("alpha", "beta", "ph", "qh", "rh", "dpt")  # whose powers the terms of the moments contain
LEAST_EFFECTIVENESS = 0.1  # that the law assumes of a weak surface
MOST_VARIANCE = 1.0 / 12.0  # variance of a theta that is evenly distributed from -1 to 0
MAX_DEFLECTION_RAD = 0.44  # of aileron, elevator and rudder: about 25 deg


Signals = dict[str, float]  # true signals by their name in the log

# xdot = I^-1 (M - x cross I x), x (3,) rad/s. The moments M (3,), N m, are q S L C: dynamic pressure, wing
# area, LENGTHS_M, coefficients Cl, Cm, Cn. A coefficient is a sum of terms; each term is a value times powers
# of SIGNALS, and for a term of a surface times its deflection.
INVERSE = np.linalg.inv(INERTIA_KG_M2)
COUPLING = np.array([getattr(inertia_coefficients(MASS), name) for name in ("Pqr", "Qpr", "Rpq")])
OF_MOMENTS = [term for term in TERMS.values() if term.coefficient in MOMENTS]
VALUES = np.array([term.value for term in OF_MOMENTS])
POWERS = np.array([[dict(term.of).get(signal, 0) for signal in SIGNALS] for term in OF_MOMENTS])
INTO = np.array([  # (coefficient, none or surface, term): 1 if the term belongs there
    [[(term.coefficient, term.surface) == (coefficient, surface) for term in OF_MOMENTS]
     for surface in (None, *SURFACES)]
    for coefficient in MOMENTS
], float)  # fmt: skip


def f_and_G(x: np.ndarray, truth: Signals) -> tuple[np.ndarray, np.ndarray]:
    """f (3,) rad/s2 and G (3, 4) rad/s2 per rad at the rates x (3,) rad/s, of xdot = f + G u."""
    rates = x * LENGTHS_M / truth["airspeed_mps"] * np.array([0.5, 1.0, 0.5])
    signals = np.array([truth["alpha_rad"], truth["beta_rad"], *rates, truth["dpt"]])
    coefficients = INTO @ (VALUES * (signals**POWERS).prod(axis=1))
    scale = truth["qdyn_pa"] * GEOMETRY.wing_area_m2 * LENGTHS_M
    moments = scale * coefficients[:, 0]
    slopes = scale[:, None] * coefficients[:, 1:]
    return INVERSE @ (moments - np.cross(x, INERTIA_KG_M2 @ x)), INVERSE @ slopes


class Estimators:
    """The detection estimator, its network, the isolation estimators.

    x_hat, threshold, residual (3,) rad/s: of the detection estimator. weights (3, N_BASIS) rad/s2, basis
    (N_BASIS,): of its network. (estimator, axis), rad/s: fie, the estimates; Om, R_pos, R_neg (R+, R-): the
    filtered regressors and their positive and negative parts; B: the filtered bound; fie_residual, lower,
    upper: eps, each residual, and its limits. theta, P (estimator, axis): the loss of effectiveness, -1 to 0,
    and the variance of its estimate. docs/explanation/isolation.md derives what `adapt` and `judge` compute.
    """

    def __init__(self, scenario: Scenario, dt: float) -> None:
        fdi = scenario.fdi
        self.dt = dt
        self.gain = scenario.control.network_gain_per_s2
        self.keep = np.exp(-scenario.control.network_leak_per_s * dt)
        self.decay = np.exp(-fdi.detection_pole_per_s * dt)
        self.fie_decay = np.exp(-fdi.isolation_pole_per_s * dt)
        self.forgetting = np.exp(-dt / fdi.forgetting_time_s)
        self.pole = fdi.detection_pole_per_s
        # only weights and excluded are changed in place: the other arrays may share their initial values
        self.x_hat = self.threshold = self.residual = np.zeros(3)
        self.weights = np.zeros((3, N_BASIS))
        self.basis = np.zeros(N_BASIS)
        self.detected = False
        self.excluded = np.zeros(3, bool)
        self.fie = self.theta = self.Om = self.R_pos = self.R_neg = self.B = np.zeros((3, 3))
        self.P = np.full((3, 3), MOST_VARIANCE)
        self.fie_residual = self.lower = self.upper = np.full((3, 3), np.nan)

    def predict(self, x: np.ndarray, rate: np.ndarray, Z: np.ndarray, eta_bar: np.ndarray) -> None:
        """Advance the detection estimator by a frame, each axis.

            x_hat     <- x + dt (rate + w.basis + (effectiveness - 1) Z) + decay (x_hat - x)
            threshold <- decay threshold + dt eta_bar
            w         <- keep (w + dt gain outside basis),  outside: the residual beyond its threshold

        x (3,) rad/s: rates at the begin of the frame. rate (3,) rad/s2: f + G u. Z (surface, axis) rad/s2:
        the part of G u of each surface. eta_bar (3,) rad/s2: the bound on the uncertainty. effectiveness: of
        the surfaces. keep is 1 as long as no fault is isolated; w changes only after the alarm.
        """
        if self.detected:
            self.adapt(x, rate, Z, eta_bar)
            outside = np.sign(self.residual) * np.maximum(np.abs(self.residual) - self.threshold, 0.0)
            self.weights += self.dt * self.gain * np.outer(outside, self.basis)
            self.weights *= self.keep if self.isolated is not None else 1.0
        predicted = rate + self.weights @ self.basis + (self.effectiveness[MAIN] - 1.0) @ Z
        self.x_hat = x + self.dt * predicted + self.decay * (self.x_hat - x)
        self.threshold = self.decay * self.threshold + self.dt * eta_bar

    def adapt(self, x: np.ndarray, rate: np.ndarray, Z: np.ndarray, eta_bar: np.ndarray) -> None:
        """Advance the isolation estimators by a frame: least squares, projected onto theta in [-1, 0].

        D  = clip(theta + P Om eps / (B^2 + Om^2 P), -1, 0) - theta,  eps = x - x_hat
        P  <- min(P B^2 / (B^2 + Om^2 P) / forgetting, MOST_VARIANCE)
        Om <- a Om + dt Z,  x_hat <- x + dt (rate + Z theta) + a (x_hat - x) + Om D,  theta <- theta + D
        R+ <- a R+ + dt max(Z, 0),  R- <- a R- + dt min(Z, 0),  B <- a B + dt eta_bar

        a: the decay of a frame. All right sides have the values before this frame, except that x_hat
        has the new Om.
        """
        a, dt, noise = self.fie_decay, self.dt, self.B**2
        scale = noise + self.Om**2 * self.P
        gain = np.divide(self.P * self.Om, scale, out=np.zeros((3, 3)), where=scale > 0)
        theta = np.clip(self.theta + gain * self.fie_residual, -1.0, 0.0)
        share = np.divide(noise, scale, out=np.ones((3, 3)), where=scale > 0)
        self.P = np.minimum(self.P * share / self.forgetting, MOST_VARIANCE)
        Om = a * self.Om + dt * Z
        self.fie = x + dt * (rate + Z * self.theta) + a * (self.fie - x) + Om * (theta - self.theta)
        self.Om = Om
        self.theta = theta
        self.R_pos = a * self.R_pos + dt * np.maximum(Z, 0.0)
        self.R_neg = a * self.R_neg + dt * np.minimum(Z, 0.0)
        self.B = a * self.B + dt * eta_bar

    def judge(self, x: np.ndarray, alpha: float, beta: float) -> None:
        """Compare the estimates with the measured x (3,) rad/s: raise the alarm, exclude faults.

        alarm: |x - x_hat| > threshold on any axis. Not excluded, as long as on every axis
        -R+ - Om theta - B <= eps <= -R- - Om theta + B. Alarm and exclusion are final.
        """
        self.residual = x - self.x_hat
        if not self.detected and (np.abs(self.residual) > self.threshold).any():
            self.detected = True
            self.fie = np.tile(x, (3, 1))
        if self.detected:
            self.fie_residual = x - self.fie
            self.lower = -self.R_pos - self.Om * self.theta - self.B
            self.upper = -self.R_neg - self.Om * self.theta + self.B
            within = (self.lower <= self.fie_residual) & (self.fie_residual <= self.upper)
            self.excluded |= ~within.all(axis=1)
            self.basis = _basis(alpha, beta)

    @property
    def isolated(self) -> int | None:
        """The index of the only estimator that is not excluded, after the alarm; None if there are several or
        none."""
        not_excluded = np.flatnonzero(~self.excluded)
        return int(not_excluded[0]) if self.detected and not_excluded.size == 1 else None

    @property
    def unknown(self) -> np.ndarray:
        """The unknown acceleration w . basis + pole residual, (3,) rad/s2; 0 before the alarm."""
        return self.weights @ self.basis + self.pole * self.residual if self.detected else np.zeros(3)

    @property
    def effectiveness(self) -> np.ndarray:
        """The effectiveness of the surfaces, (4,): 1 + theta of the isolated one, at least
        LEAST_EFFECTIVENESS; 1 of all others."""
        effectiveness = np.ones(4)
        isolated = self.isolated
        if isolated is not None:
            effectiveness[isolated] = max(1.0 + self.theta[isolated, isolated], LEAST_EFFECTIVENESS)
        return effectiveness


def _basis(alpha: float, beta: float) -> np.ndarray:
    """Radial basis functions of alpha and of beta (rad), (N_BASIS,), exp(-((value - centre) / spacing)^2 /
    2), divided by their norm."""
    phi = np.concatenate([
        np.exp(-0.5 * ((value - centres) / (centres[1] - centres[0])) ** 2)
        for value, centres in ((alpha, ALPHA_CENTRES_RAD), (beta, BETA_CENTRES_RAD))
    ])  # fmt: skip
    return phi / np.linalg.norm(phi)


class FeedbackLinearisation:
    """Reference model and proportional-integral feedback. The flap stays in trim, the other deflections u are
    within MAX_DEFLECTION_RAD.

    error = x_model - x,   I <- I + dt error,   u = G^-1 (xdot_model + Kp error + Ki I - f - unknown)
    """

    def __init__(self, scenario: Scenario, dt: float, flap_rad: float) -> None:
        control = scenario.control
        self.dt = dt
        self.Kp = control.proportional_per_s
        self.Ki = control.integral_per_s2
        self.A, self.B = discretise(control.reference_natural_frequency_rad_s, control.reference_damping, dt)
        self.model = np.zeros((2, 3))  # rate and acceleration of the reference model
        self.integral = np.zeros(3)
        self.flap_rad = flap_rad

    def command(
        self, x: np.ndarray, f: np.ndarray, G: np.ndarray, unknown: np.ndarray, reference: np.ndarray
    ) -> np.ndarray:
        """The deflections (4,) rad. G (3, 4) includes the estimated effectiveness: a weak surface gets a
        larger command. reference (3,) rad/s."""
        error = self.model[0] - x
        self.integral += self.dt * error
        demand = self.model[1] + self.Kp * error + self.Ki * self.integral - f - unknown
        three = np.linalg.solve(G[:, MAIN], demand - G[:, FLAP] * self.flap_rad)
        self.model = self.A @ self.model + np.outer(self.B, reference)
        return np.append(np.clip(three, -MAX_DEFLECTION_RAD, MAX_DEFLECTION_RAD), self.flap_rad)


class Straightforward:
    """A contender that flies a scenario from `at_s` on.

    then: arguments of `Estimators.predict` for the next frame; None in the first frame.
    """

    def __init__(self, scenario: Scenario, at_s: float, frames: int) -> None:
        self.scenario = scenario
        self.at_s = at_s
        self.start = take_over(scenario, at_s)
        self.plant = self.start.plant
        self.references = sample(scenario.reference, at_s + np.arange(frames) / scenario.rate_hz)
        self.prepare()

    def prepare(self) -> None:
        """Return to the start, with new estimators and an empty log."""
        self.start.come_back()
        dt = 1.0 / self.scenario.rate_hz
        self.estimators = Estimators(self.scenario, dt)
        self.law = FeedbackLinearisation(self.scenario, dt, self.start.state.flap_rad)
        self.u = np.array(list(self.start.commands.values()))
        self.law.model[0] = [getattr(self.start.state, f"{axis}_rad_s") for axis in AXES]
        self.then: tuple[np.ndarray, ...] | None = None
        self.log: list[Signals] = []

    def fly(self, frames: int) -> None:
        """Fly on."""
        for k in range(frames):
            self.step(self.references[k])

    def step(self, reference: np.ndarray) -> None:
        """Fly one frame: run, measure, predict, judge, command, log. reference (3,) rad/s."""
        fdm = self.plant.fdm
        estimators = self.estimators
        fdm.run()
        truth = {name: fdm[property_] * factor for name, property_, factor in ch.TRUTH}
        x = np.array([truth[f"{axis}_rad_s"] for axis in AXES])
        f, G = f_and_G(x, truth)
        if self.then is None:
            estimators.x_hat = x
        else:
            estimators.predict(*self.then)
        estimators.judge(x, truth["alpha_rad"], truth["beta_rad"])
        self.then = (x, f + G @ self.u, (G * self.u)[:, MAIN].T, self.bound(x))
        self.u = self.law.command(x, f, G * estimators.effectiveness, estimators.unknown, reference)
        for surface, deflection in zip(SURFACES, self.u, strict=True):
            fdm[f"fcs/{surface}-cmd-rad"] = deflection
        self.log.append(self.row(truth, x, reference))

    def bound(self, x: np.ndarray) -> np.ndarray:
        """The bound on the uncertainty, (3,) rad/s2: the published one, and W (2 sum |x| + W) for the turning
        Earth, W its rate."""
        declared = Declared.of(self.scenario)
        cross = np.array([x[1] * x[2], x[0] * x[2], x[0] * x[1]])
        earth = EARTH_RATE_RAD_S * (2.0 * np.abs(x).sum() + EARTH_RATE_RAD_S)
        return np.array(declared.coupling) * np.abs(COUPLING * cross) + declared.constant_rad_s2 + earth

    def row(self, truth: Signals, x: np.ndarray, reference: np.ndarray) -> Signals:
        """A row of the log, by column."""
        e = self.estimators
        row = truth | {f"{s}_cmd_rad": u for s, u in zip(SURFACES, self.u, strict=True)}
        of_axes = {
            "measured": x, "reference": reference, "model": self.law.model[0], "residual": e.residual,
            "threshold": e.threshold,
        }  # fmt: skip
        row |= {f"{AXES[i]}_{name}_rad_s": values[i] for name, values in of_axes.items() for i in range(3)}
        for name, values in (("residual", e.fie_residual), ("lower", e.lower), ("upper", e.upper)):
            row |= {f"fie_{SURFACES[s]}_{AXES[i]}_{name}_rad_s": values[s, i] for s, i in np.ndindex(3, 3)}
        return row | {"detected": e.detected}
