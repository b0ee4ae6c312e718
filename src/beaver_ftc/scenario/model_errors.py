"""Differences between the truth and the design model: errors of the truth (`uncertainty:`), and deliberate
ones of the design model (`design_model:`)."""

from typing import Annotated

from pydantic import Field

from beaver_ftc.documents.document import Flag, Number, Section, entry, number
from beaver_ftc.scenario.actuators import Actuators, TrueActuators
from beaver_ftc.scenario.airframe import Ratio, Ratios
from beaver_ftc.scenario.sensors import Sensors


class InertiaCoupling(Section):
    """Relative errors of the inertia coupling in the truth. The inertia coupling is the angular acceleration
    that comes from products of two body rates. In the published study [Zhang2005] these errors are at most
    0.25."""

    p: Number = number(0.0, "share of 1", "coefficient of q r", ge=-1, le=1, examples=[0.2])
    q: Number = number(0.0, "share of 1", "coefficient of p r", ge=-1, le=1, examples=[0.2])
    r: Number = number(0.0, "share of 1", "coefficient of p q", ge=-1, le=1, examples=[0.2])


class Sinusoid(Section):
    """amplitude times sin(frequency t), t: time of the flight."""

    amplitude_rad_s2: Number = number(0.0, "rad/s2", "amplitude", ge=0, le=10, examples=[0.02])
    frequency_rad_s: Number = number(10.0, "rad/s", "angular frequency", gt=0, le=1000)


class SinusoidAxes(Section):
    """One sinusoidal acceleration for each axis."""

    p: Sinusoid = Field(default_factory=Sinusoid)
    q: Sinusoid = Field(default_factory=Sinusoid)
    r: Sinusoid = Field(default_factory=Sinusoid)


class TrueInertia(Section):
    """Inertia of the truth, divided by the inertia in the aircraft file."""

    Ix: Number = number(1.0, "1", "roll inertia", ge=0.5, le=2)
    Iy: Number = number(1.0, "1", "pitch inertia", ge=0.5, le=2)
    Iz: Number = number(1.0, "1", "yaw inertia", ge=0.5, le=2)


Offset = Annotated[Number, Field(ge=-0.5, le=0.5)]


class Uncertainty(Section):
    """Differences between the truth and the design model.

    inertia_coupling: relative errors of the inertia coupling, the acceleration from products of two rates

    sinusoid: a sinusoidal error of each angular acceleration
    coefficients: factors on aerodynamic terms of the truth, by name
    mass: mass of the truth, divided by the mass in the aircraft file. The inertia is not changed, 1
    inertia: inertia of the truth, divided by the inertia in the aircraft file

    cg_m: shift of the true centre of gravity: forward, right, down, m
    actuators: actuators of the truth, compared with `actuators`
    """

    inertia_coupling: InertiaCoupling = entry(InertiaCoupling)
    sinusoid: SinusoidAxes = entry(SinusoidAxes)
    coefficients: Ratios = entry(dict, examples=[{"Cm_alpha": 1.05}])
    mass: Number = number(1.0, "1", ge=0.5, le=2)
    inertia: TrueInertia = entry(TrueInertia)
    cg_m: tuple[Offset, Offset, Offset] = number((0.0, 0.0, 0.0), "m", examples=[[0.05, 0, 0]])
    actuators: TrueActuators = entry(TrueActuators, examples=[{"bandwidth": 0.8}])


Scale = Annotated[Number, Field(ge=0.1, le=10)]


class InertiaScale(Section):
    """Inertia of the design model, divided by the inertia in the aircraft file."""

    Ix: Scale = number(1.0, "1", "roll inertia")
    Iy: Scale = number(1.0, "1", "pitch inertia")
    Iz: Scale = number(1.0, "1", "yaw inertia")
    Jxz: Ratio = number(1.0, "1", "product of inertia")


class DesignModel(Section):
    """Deliberate errors of the design model. The truth does not change.

    engine_terms: false: no slipstream terms (`dpt`) in Cl, Cm and Cn, as in the published study
    linearised: true: linearised about the trim at the start
    frozen_alpha: true: alpha has its trim value
    mass: mass, divided by that in the aircraft file; the inertia is scaled too, 1
    inertia: inertia of the design model
    coefficients: factors on aerodynamic terms, by name
    actuators: actuators for the diagnosis and the laws. Left out: as `actuators`
    sensors: sensors as the laws know them, in the forms of `sensors`. Left out: as `sensors`, in a sweep of
    `sensors` as the base's
    """

    engine_terms: Flag = True
    linearised: Flag = False
    frozen_alpha: Flag = False
    mass: Scale = number(1.0, "1")
    inertia: InertiaScale = entry(InertiaScale)
    coefficients: Ratios = entry(dict, examples=[{"Cm_alpha": 0.9}])
    actuators: Actuators | None = entry(None, examples=["servo"])
    sensors: Sensors | None = entry(None, examples=["tactical-grade"])
