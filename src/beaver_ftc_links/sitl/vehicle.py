"""A flight that an autopilot commands: it receives outputs, flies JSBSim frames, and returns an `Instant`."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beaver_ftc.aircraft import M_PER_FT, MOST_CHANNELS, Aircraft
from beaver_ftc.design import DesignFunctions, design_record
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import (
    FrameReadout,
    Instruments,
    Loop,
    command_power,
    end_outer_loops,
    hold_from_start,
    set_ground,
    stop_diagnosis,
    take_diagnosis,
)
from beaver_ftc.plant import AX, SENSORS, lay_ground, stand_on_ground
from beaver_ftc.results import Simulation, SpooledLog
from beaver_ftc.scenario import Declared, Scenario
from beaver_ftc_links.sitl.outputs import Outputs, power_range

if TYPE_CHECKING:
    from beaver_ftc.diagnosis import Detector

# Rates of the diagnosis at which its guarantees are tested.
SLOWEST_HZ = 20.0
FASTEST_HZ = 400.0
FASTEST_PACKETS_HZ = 4000.0
# Height of the wheels at which the diagnosis begins after take-off, and at which it ends.
UP_M = 5.0
DOWN_M = 2.0
SLOW_MPS = 10.0
GUSTY_M = 609.6  # height above which a flight from the ground is diagnosed in declared turbulence
WHOLE = 1e-6  # JSBSim frames: a number that differs by less from a whole one counts as whole
# The autopilot commands the surfaces and the flight path: what the scenario says of both is replaced.
THEIRS = {"control.law": "nominal", "control.options": {}, "reference": {}}
OF_THE_LAW = ("pre_fault_rms_deg_s", "post_fault_rms_deg_s")

Vector = np.ndarray

_NODES = (  # properties of the truth that no instrument of the plant measures, and factors to SI
    ("velocities/v-north-fps", M_PER_FT),
    ("velocities/v-east-fps", M_PER_FT),
    ("velocities/v-down-fps", M_PER_FT),
    ("position/lat-geod-deg", 1.0),
    ("position/long-gc-deg", 1.0),
    ("position/h-sl-ft", M_PER_FT),
    ("attitude/phi-rad", 1.0),
    ("attitude/theta-rad", 1.0),
    ("attitude/psi-rad", 1.0),
    ("position/lat-gc-rad", 1.0),
    ("position/long-gc-rad", 1.0),
)
_AT = {name: i for i, name in enumerate(SENSORS)}


class Instant(NamedTuple):
    """The measurements for the autopilot. SI, radians; body axes forward, right, down; earth axes north,
    east, down.

    Readings of the instruments, with errors and faults, the same as for the diagnosis: gyro, specific force
    (without gravity), attitude (roll, pitch, yaw), airspeed, sideslip, dynamic pressure, altitude above sea
    level. True values, which no instrument of the plant measures: position from the start of the flight, with
    the autopilot's ground as 0; velocity over the ground; latitude and longitude, deg; height above sea
    level.
    """

    t_s: float
    gyro: tuple[float, ...]
    force: tuple[float, ...]
    attitude: tuple[float, ...]
    airspeed_mps: float
    beta_rad: float
    qdyn_pa: float
    altitude_m: float
    position: tuple[float, float, float]
    velocity: tuple[float, ...]
    latitude_deg: float
    longitude_deg: float
    height_m: float
    true_attitude: tuple[float, ...]


class OverGround(Loop):
    """A flight that may begin, and end, on the ground."""

    from_ground = True


class Flown(Simulation):
    """A flight that an autopilot commands instead of a law, some JSBSim frames at a time.

    The ground is `ground_m` above sea level, if the aircraft's file has a section `ground`. Near the ground
    nothing is diagnosed, as no declared bound covers the forces on the wheels. The diagnosis begins, again,
    once the aircraft is high and fast enough for its model; with declared turbulence, once it is above the
    height from which the declaration holds. A verdict remains when the aircraft lands. listens_from_s: time
    at which the diagnosis first began; None before.
    """

    _loop_type = OverGround

    def __init__(
        self,
        scenario: Scenario,
        *,
        detector: "Detector | None" = None,
        log: bool | SpooledLog = True,
        ground_m: float = 0.0,
    ) -> None:
        self.ground_m = ground_m
        super().__init__(scenario, detector=detector, log=log)

    def _make_ready(self) -> None:
        super()._make_ready()
        self._runs = 0  # JSBSim frames of the next frame that are flown
        self._engaged = False
        self.listens_from_s: float | None = 0.0
        self._diagnoses = True
        self._fresh: Vector | None = None  # the assembled record, with which a diagnosis begins
        self._slowest_mps = self.airframe.envelope.airspeed_mps[0]
        if self.airframe.file.ground is not None:
            self._lay_ground()
        self._begin()
        node = self._loop.plant.node
        self._nodes = [(node(name).get_double_value, factor) for name, factor in _NODES]
        self._instruments = Instruments(self._frame)
        self._origin = FrameReadout(self._frame).origin

    def _lay_ground(self) -> None:
        loop, frame, file = self._loop, self._frame, self.airframe.file
        assert file.ground is not None
        loop._may_fly_again = False  # with a ground to it
        set_ground(frame, self.ground_m, SLOW_MPS)
        self._standing_m = self.ground_m + file.ground.height_m
        self._lowest_m = GUSTY_M if Declared.of(self._scenario).air.moves else DOWN_M
        self._fresh = loop.frames.copy()
        if not self._scenario.initial.on_ground:
            if loop.trim.altitude_m < self._standing_m + UP_M:
                says = f"{loop.trim.altitude_m:g} is at or below the ground at {self.ground_m:g}"
                allowed = f"allowed: above {self._standing_m + UP_M:g}, another --ground, or on_ground"
                raise BadInput(f"{self._scenario.name}: initial.altitude_m: {says}, {allowed}")
            lay_ground(loop.plant, self.ground_m)
            return
        if loop.plugin_frame is not None:
            says = "that begins in flight, allowed on the ground: one of this package"
            raise BadInput(f"{self._scenario.name}: fdi.scheme: no plug-in knows {says}")
        self.idle = power_range(self.airframe)[0]
        settings = {
            name: self.idle if setting.property == self.airframe.trim.throttle else loop.trim.settings[name]
            for name, setting in self.airframe.engine.settings.items()
        }
        stand_on_ground(loop.plant, replace(loop.trim, settings=settings), self.ground_m)
        hold_from_start(frame, self.trim_rad)
        self._by_hand = True
        self._stop_diagnosis()
        self.listens_from_s = None

    def _stop_diagnosis(self) -> None:
        stop_diagnosis(self._frame)
        self._diagnoses = False

    def _start_or_stop_diagnosis(self) -> None:
        """End the diagnosis near the ground; begin it again in flight unless there is an alarm. The height is
        that of a radar altimeter without error, the true one; the airspeed is that of the instrument."""
        height_m = FrameReadout(self._frame).height_m - self._standing_m
        if self._diagnoses:
            if height_m < self._lowest_m:
                self._stop_diagnosis()
        elif (
            height_m > self._lowest_m + UP_M - DOWN_M
            and self._instruments.readings()[_AT["V"]] > self._slowest_mps
            and not self.alarmed
        ):
            self._begin_diagnosis()

    def _begin_diagnosis(self) -> None:
        take_diagnosis(self._frame, self._fresh[0], self._next)  # type: ignore[index]
        self._diagnoses = True
        if self.listens_from_s is None:
            self.listens_from_s = self._now_s

    @property
    def G(self) -> Vector:
        """Effectiveness of each surface about each axis, (3, n) rad/s2 per rad, by the equations of its file
        at the trim that the designer knows."""
        return DesignFunctions(design_record(self.airframe)).G(self._loop.trimmed.y)

    @property
    def airframe(self) -> Aircraft:
        """The aircraft that flies."""
        return self._loop.aircraft

    @property
    def alarmed(self) -> bool:
        """Whether there is an alarm."""
        return FrameReadout(self._frame).alarmed or self._loop.plugin_frame is not None

    def pilot(self, runs: int, deflections: Vector | None, power: float | None) -> None:
        """Fly `runs` JSBSim frames, or to the end of the flight. From the next frame of the loop on the
        surfaces have these deflections (n,), rad, and the engine this setting; None: those of the law, and no
        change."""
        while runs > 0 and not self.done:
            if self._runs == 0:
                self._take(deflections, power)
            left = self._loop.scenario.substeps - self._runs
            if runs < left:
                self._inside(runs)
                return
            runs -= left
            self._runs = 0
            self._last.clear()
            if self._fresh is not None:
                self._start_or_stop_diagnosis()
            self._fly_to(self._next + 1)

    def _take(self, deflections: Vector | None, power: float | None) -> None:
        self._loop.hold(deflections)
        if deflections is None:
            return
        self._by_hand = True
        if not self._engaged:
            self._engaged = True
            end_outer_loops(self._frame)
        if power is not None:
            command_power(self._frame, power)
            self._loop.plant.write(self._loop.aircraft.trim.throttle, power)

    def _inside(self, runs: int) -> None:
        if self._runs == 0 and self._next >= self._turn_at:
            self._turn_at = self._loop.turn_to(self._next)
        self._loop.fly_inside(runs)
        self._runs += runs

    def instant(self) -> Instant:
        """The readings and true values after the last JSBSim frame."""
        signal = self._instruments.readings()
        true = [read() * factor for read, factor in self._nodes]
        north = (true[9] - self._origin.latitude_rad) * self._origin.radius_m
        east = (true[10] - self._origin.longitude_rad) * self._origin.parallel_radius_m
        t_s = self._next_instant_s
        return Instant(
            t_s, tuple(signal[:3]), tuple(signal[AX : AX + 3]), tuple(signal[_AT["phi"] : _AT["psi"] + 1]),
            signal[_AT["V"]], signal[_AT["beta"]], signal[_AT["qdyn"]], signal[_AT["altitude"]],
            (north, east, self.ground_m - true[5]), tuple(true[:3]),
            true[3], true[4], true[5], tuple(true[6:9]),
        )  # fmt: skip

    @property
    def _next_instant_s(self) -> float:
        substeps = self._loop.scenario.substeps
        return ((self._next - 1) * substeps + self._runs) / (substeps * self.rate_hz)


class Vehicle:
    """The flight of an autopilot, at the rate of its packets; it restarts when the packets do.

    pulses: as in `Outputs`. rate_hz: rate of the packets; None: the rate that the packets state. hold_s: time
    at the start in which the law `nominal` flies level, s. ground_m: height of the ground for the autopilot
    above sea level; None: 0, or the altitude of a flight from the ground. log: whether a log is kept.
    """

    def __init__(
        self,
        scenario: Scenario,
        pulses: bool,
        rate_hz: float | None = None,
        hold_s: float = 0.0,
        ground_m: float | None = None,
        log: bool = True,
    ) -> None:
        self.given = scenario
        self.hold_s = hold_s
        self._fixed_hz = rate_hz
        self._pulses = pulses
        self._log = log
        self._on_ground = bool(scenario.initial.on_ground)
        if self._on_ground and (hold_s or ground_m is not None):
            what = "--hold" if hold_s else "--ground"
            says = "has no meaning on the ground, which is at initial.altitude_m, allowed: to leave it out"
            raise BadInput(f"{scenario.name}: {what} {says}")
        self._ground_m = scenario.initial.altitude_m if self._on_ground else ground_m or 0.0
        self.sim: Flown | None = None
        self.scenario = scenario
        self.packets_hz = 0.0
        self.outputs: Outputs
        self.off_rate = 0
        self.begin(scenario.rate_hz if rate_hz is None else rate_hz)
        self._warm_up()

    def _warm_up(self) -> None:
        """Compile the kernels of such a flight before an autopilot waits for an answer."""
        flight = self.flight
        substeps = self.scenario.substeps
        if not self._on_ground:
            flight.pilot(2 * substeps, None, None)
        flight.pilot(2 * substeps, flight.trim_rad, None)
        flight.reset()

    def begin(self, packets_hz: float, channels: int = MOST_CHANNELS) -> None:
        """Begin a flight from trim. packets_hz: rate of the packets; channels: number of their outputs.
        Raises BadInput for a flight that is not possible."""
        if self.sim is not None:
            self.outputs.check(channels)
        packets_hz = self._fixed_hz or packets_hz
        if self.sim is not None and packets_hz == self.packets_hz:
            if self.sim.frames > 1 or self._inside:
                self.sim.reset()
        else:
            before = self.sim
            self.scenario = at_rate(self.given, packets_hz)
            log = SpooledLog() if self._log else False
            self.sim = Flown(self.scenario, log=log, ground_m=self._ground_m)
            if before is not None:
                before.release()
        self.packets_hz = packets_hz
        self._jsbsim_hz = self.scenario.rate_hz * self.scenario.substeps
        self.outputs = Outputs(
            self.scenario.airframe, self.sim.G, self.sim.trim_rad, self.sim.travel_rad, self._pulses
        )

    @property
    def flight(self) -> Flown:
        """The flight in progress."""
        assert self.sim is not None
        return self.sim

    @property
    def _inside(self) -> bool:
        return self.sim is not None and self.sim._runs > 0

    @property
    def over(self) -> bool:
        """Whether the flight has ended: after its duration, or because the aircraft is lost."""
        return self.flight.done

    def runs_of(self, frame_hz: float) -> int:
        """Number of JSBSim frames in a frame of this rate. If it is no whole number, or the rate is fixed,
        that of the rate at which the flight began."""
        wanted = self._jsbsim_hz / frame_hz if frame_hz >= SLOWEST_HZ else 0.0
        runs = round(wanted)
        if self._fixed_hz is None and runs >= 1 and abs(wanted - runs) <= WHOLE * runs:
            return runs
        if frame_hz != self.packets_hz:
            self.off_rate += 1
        return round(self._jsbsim_hz / self.packets_hz)

    def fly(self, outputs: Sequence[float], frame_hz: float, in_charge: bool = True) -> None:
        """Fly a frame of the autopilot. in_charge: whether its outputs command the surfaces once `hold_s` is
        over."""
        sim = self.flight
        runs = self.runs_of(frame_hz)
        if in_charge and sim.frames / sim.rate_hz > self.hold_s:
            sim.pilot(runs, self.outputs.deflections(outputs), self.outputs.power(outputs))
        elif self._on_ground:
            sim.pilot(runs, sim.trim_rad, sim.idle)
        else:
            sim.pilot(runs, None, None)

    def instant(self) -> Instant:
        """The instant after the last frame."""
        return self.flight.instant()


def at_rate(scenario: Scenario, packets_hz: float) -> Scenario:
    """The scenario at the rate of the packets. Above FASTEST_HZ, at a whole fraction of it: several packets
    are then a frame of the loop, and the outputs of the first of them count. Raises BadInput for a rate that
    is out of range."""
    if not SLOWEST_HZ <= packets_hz <= FASTEST_PACKETS_HZ:
        allowed = f"{SLOWEST_HZ:g} to {FASTEST_PACKETS_HZ:g} Hz, or --rate"
        raise BadInput(f"{scenario.name}: frames of an autopilot at {packets_hz:g} Hz, allowed: {allowed}")
    packets = ceil(packets_hz / FASTEST_HZ - 1e-9)  # packets in a frame of the loop
    substeps = packets * ceil(scenario.substeps / packets)
    changes = {**THEIRS, "rate_hz": packets_hz / packets, "substeps": substeps}
    return scenario.with_(changes)


def without_reference(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """The scenario without the keys of `expect` that hold for a law of this package only, and a line for each
    of them. Raises BadInput for `changes`, since these change such a law or sensors of the diagnosis.
    """
    if scenario.changes:
        raise BadInput(f"{scenario.name}: changes: there are none under an autopilot, allowed: faults")
    asked = [name for name in OF_THE_LAW if scenario.expect and getattr(scenario.expect, name)]
    left_out = {f"expect.{name}": None for name in asked}
    said = [f"expect.{name} is left out: the reference is the autopilot's own" for name in asked]
    return scenario.with_(left_out) if asked else scenario, said
