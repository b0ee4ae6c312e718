"""What moves: damage, the actuators of surfaces and engines with all their failures, and the engines' spools.

The actuators are those of every aircraft here, `aircraft/actuator.xml`, with the source's lag, rate limit and
delay set.
"""

from math import cos, pi, radians, sin, sqrt
from typing import Any

from beaver_ftc.plant import ACTUATOR_DELAY as DELAY
from beaver_ftc.plant import actuator_system
from beaver_ftc_aircraft.gtm.elements import component, declared, do, function, piecewise, read, triple, value
from beaver_ftc_aircraft.gtm.masses import structural_in, weights_by_case
from beaver_ftc_aircraft.gtm.parameters import DAMAGE_CASE, GEAR, can_be_taken, cases, parameters

ENGINES = ("left_engine", "right_engine")
THROTTLE = "fcs/throttle-cmd-norm"
PERCENT = 100.0
_SAMPLES, _STEP_S = 4, 0.005  # of a command that are kept: the last, and three steps of 5 ms before it
_DUE, _AGE, _SPACING, _AGO = (f"fcs/delay/{name}" for name in ("due", "age-s", "spacing-s", "samples-ago"))


def systems() -> dict[str, str]:
    """System files by name, in the order in which they run."""
    found = {"damage": _damage(), "delay": _clock()}
    for surface, of in parameters()["surfaces"].items():
        found[surface] = _surface(surface, of)
    for engine in ENGINES:
        found[engine] = _lever(engine)
    return found | {"engines": _spools()}


def _system(name: str, properties: str, components: str, attributes: str = "") -> str:
    channel = f'<channel name="{name}"{attributes}>{components}</channel>' if components else ""
    return f'<?xml version="1.0"?>\n<system name="{name}">{properties}{channel}</system>\n'


def damage_property(case: str) -> str:
    """1 if this damage is there, 0 if not."""
    return f"failures/damage/{case}"


def present(surface: str) -> str:
    """1 for a surface that is there, 0 for one that damage took."""
    return f"failures/{surface}/present"


def _damage() -> str:
    """Which case is in force (of several the first), which surfaces that leaves, and the masses it moves."""
    names = list(cases())
    which = value(0.0)
    for number, name in reversed([*enumerate(names, 1)]):
        is_there = do("gt", read(damage_property(name)), 0.5)
        which = do("ifthen", is_there, number, which)
    parts = [component(DAMAGE_CASE, "Number of the damage in force, 0 for none", which)]
    for surface in can_be_taken():
        taking = [number for number, name in enumerate(names, 1) if surface in cases()[name]["takes"]]
        gone = do("or", *(do("eq", read(DAMAGE_CASE), number) for number in (*taking, taking[0])))
        parts.append(component(present(surface), "Whether damage has left it", do("ifthen", gone, 0.0, 1.0)))
    down = do("ifthen", do("ge", read(GEAR), 0.5), 1.0, 0.0)
    parts.append(component("gear/mass-down", "Whether the gear's mass is down", down))
    for index, weights in weights_by_case().items():
        says = (
            "Weight of a small mass: together they make mass, centre of gravity and inertia those of the case"
        )
        name = f"inertia/damage-mass-{index}-lbs"
        parts.append(component(name, says, weights, f"inertia/pointmass-weight-lbs[{index}]"))
    properties = declared(GEAR) + "".join(declared(damage_property(name)) for name in names)
    return _system("damage", properties, "".join(parts))


def _surface(surface: str, of: dict[str, Any]) -> str:
    """The actuator of one surface, with what of it damage leaves."""
    low, high = (radians(end) for end in of["travel_deg"])
    text = actuator_system(surface, low, high)
    servo = parameters()["servo"]
    if of["kind"] != "stabiliser":  # which is set on the ground, and moved by nothing
        text = _set(text, f"actuators/{surface}/bandwidth-rad_sec", servo["bandwidth_rad_s"])
        text = _set(text, f"actuators/{surface}/rate-limit-rad_sec", radians(servo["rate_limit_deg_s"]))
        text = _delayed(text, surface)
    norm = declared(f"fcs/{surface}-cmd-norm")  # JSBSim knows its own only
    text = text.replace("<property", f"{norm}\n  <property", 1)
    if surface in can_be_taken():
        stands = f"<property> failures/{surface}/effectiveness </property>"
        text = text.replace(stands, f"{stands} {read(present(surface))}")
    if of["kind"] == "stabiliser":  # the elevator sees its angle even where half of it is gone
        body = do("product", read(f"failures/{surface}/effectiveness"), read(f"fcs/{surface}-pos-rad"))
        stands = component("fcs/stabiliser-stands-rad", "Its angle, all of it there or not", body)
        text = text.replace("</channel>", f"{stands}</channel>")
    return text


def _set(text: str, name: str, number: float) -> str:
    """Give a declared property of a template another value."""
    found = f'<property value="0"> {name} </property>'
    assert found in text
    return text.replace(found, f'<property value="{number!r}"> {name} </property>')


def _clock() -> str:
    """When a sample of the commands is due: after 5 ms, or a frame if that is longer, and always where time
    stands still. How many samples ago the delay is."""
    frame = read("simulation/dt")
    still = do("eq", frame, 0.0)
    more = do("integer", do("difference", do("quotient", _STEP_S, frame), 1e-6))
    frames = do("sum", more, 1.0)
    older = do("sum", read(_AGE), frame)
    due = do("ge", older, do("difference", read(_SPACING), 1e-9))
    ago = do("quotient", do("difference", read(DELAY), read(_AGE)), read(_SPACING))
    parts = [
        component(_SPACING, "Between samples", do("ifthen", still, _STEP_S, do("product", frame, frames))),
        component(_DUE, "Whether to take a sample", do("or", due, still)),
        component(_AGE, "Since the last sample", do("ifthen", read(_DUE), 0.0, older)),
        component(_AGO, "How many samples ago the delay is", ago),
    ]
    return _system(
        "delay", declared(DELAY, parameters()["servo"]["delay_s"]), "".join(parts), f' execute="{DELAY}"'
    )


def _delayed(text: str, surface: str) -> str:
    """Let the actuator see the command late, by a line between samples. An ideal actuator sees it at once."""
    command, late = f"fcs/{surface}-cmd-rad", f"fcs/{surface}-cmd-late-rad"
    line = [f"fcs/{surface}-cmd-{i}-ago-rad" for i in range(_SAMPLES)]
    still, parts = do("eq", read("simulation/dt"), 0.0), []
    for i in reversed(range(_SAMPLES)):
        before = do("ifthen", still, read(command), read(line[i - 1])) if i else read(command)
        body = do("ifthen", read(_DUE), before, read(line[i]))
        parts.append(component(line[i], f"The command {i} samples ago", body))
    between = piecewise(_AGO, [float(i) for i in range(_SAMPLES)], [read(name) for name in line])
    as_asked = do("ifthen", do("gt", read(_AGO), 0.0), between, read(command))
    parts.append(component(late, "The command as the servo gets it", as_asked))
    channel = f'<channel name="{surface} delay" execute="{DELAY}">{"".join(parts)}</channel>'
    seen = do("ifthen", do("gt", read(DELAY), 0.0), read(late), read(command))
    head, demand, tail = text.partition(f'name="fcs/{surface}-demand-rad"')
    tail = tail.replace(f"<property> {command} </property>", seen, 1)
    return head.replace("<channel", f"{channel}\n  <channel", 1) + demand + tail


def _lever(engine: str) -> str:
    """A throttle: saturation only, and all failures of a surface. The common lever adds to its own."""
    text = actuator_system(engine, 0.0, 1.0).replace(f"fcs/{engine}-cmd-norm", f"fcs/{engine}-lever-norm")
    names = {"-frequency-rad_sec": "-frequency-RAD_SEC", "-rad_sec": "-norm_sec", "-rad": "-norm"}
    for old, new in names.items():
        text = text.replace(old, new)
    text = text.replace("-RAD_SEC", "-rad_sec")
    own = f"<property> fcs/{engine}-cmd-norm </property>"
    head, channel, tail = text.partition("<channel")
    tail = tail.replace(own, do("sum", own, read(THROTTLE)))
    extra = declared(THROTTLE) if engine == ENGINES[0] else ""
    head = head.replace("<property", f"{extra}{declared(f'fcs/{engine}-lever-norm')}\n  <property", 1)
    return head + channel + tail


def _spools() -> str:
    """Lagged throttle of both engines: x' = A x + (u, 0), exact for a throttle that stays for a frame.

    A has complex eigenvalues -s +- j w: exp(A t) = e^(-s t) [cos(w t) + (A + s) sin(w t) / w].
    """
    damping, stiffness = parameters()["engine"]["spool"]["a"]
    s = damping / 2.0
    w = sqrt(stiffness - s * s)
    dt = read("simulation/dt")
    turn = do("product", w, dt)
    fade = do("exp", do("product", -s, dt))
    parts = [
        component("fcs/spool-cosine", "e^(-s dt) cos(w dt)", do("product", fade, do("cos", turn))),
        component("fcs/spool-sine", "e^(-s dt) sin(w dt) / w", do("product", 1.0 / w, fade, do("sin", turn))),
    ]
    for engine in ENGINES:
        first, second, throttle = (f"fcs/{engine}-spool-{name}" for name in ("rate", "level", "throttle"))
        parts += _spool(engine, (first, second, throttle), damping, stiffness)
    return _system("engines", "", "".join(parts))


def _spool(engine: str, names: tuple[str, str, str], damping: float, stiffness: float) -> list[str]:
    """States about where they settle, (0, u / stiffness): there they only turn and fade."""
    first, second, held = names
    cosine, sine = read("fcs/spool-cosine"), read("fcs/spool-sine")
    still = do("eq", read("simulation/dt"), 0.0)
    off = do("difference", read(second), do("quotient", read(held), stiffness))
    throttle = do("product", PERCENT, read(f"fcs/{engine}-effective-norm"))
    off_before = component(f"{second}-off", "The second state, from where it settles", off)
    # [first, off] times exp(A dt), A = [[-damping, -stiffness], [1, 0]], A + s = [[-s, -stiffness], [1, s]]
    s = damping / 2.0
    new_first = do(
        "sum",
        do("product", read(first), do("difference", cosine, do("product", s, sine))),
        do("product", -stiffness, sine, read(f"{second}-off")),
    )
    new_second = do(
        "sum",
        do("product", sine, read(f"{first}-before")),
        do("product", read(f"{second}-off"), do("sum", cosine, do("product", s, sine))),
        do("quotient", read(held), stiffness),
    )
    settled = do("quotient", throttle, stiffness)
    a, b = parameters()["engine"]["spool"]["c"]
    lagged = do("sum", do("product", a, read(first)), do("product", b, read(second)))
    return [
        off_before,
        component(f"{first}-before", "The first state, a frame ago", read(first)),
        component(first, "First state, settled where time stands still", do("ifthen", still, 0.0, new_first)),
        component(second, "Second state", do("ifthen", still, settled, new_second)),
        component(held, "Throttle over the frame to come, %", throttle),
        component(f"fcs/{engine}-lagged-percent", "Throttle as the engine has followed it, %", lagged),
    ]


def engine_functions() -> str:
    """Speed and thrust of each engine, the angular momentum of both rotors, and thrust as a coefficient.

    Ram drag follows the thrust line, and cannot turn thrust round.
    """
    of, found = parameters()["engine"], []
    shaft, momentum = of["shaft"], {axis: [] for axis in "xyz"}  # type: ignore[var-annotated]
    inertia = pi * shaft["diameter_ft"] ** 4 / 32.0 * shaft["length_ft"] * shaft["density_slug_ft3"]
    per_percent = inertia * 2.0 * pi / 60.0 * of["full_rpm"] / PERCENT
    for engine in ENGINES:
        found += _engine(engine)
        for axis, share in zip("xyz", direction(engine), strict=True):
            rpm = read(f"engine/{engine}/rpm-percent")
            momentum[axis].append(do("product", share * per_percent, rpm))
    for axis, parts in momentum.items():
        found.append(function(f"engine/rotors/h-{axis}", "Angular momentum, slug ft2/s", do("sum", *parts)))
    thrust = do("sum", *(read(f"engine/{engine}/thrust-lbs") for engine in ENGINES))
    dynamic = do("product", do("max", 0.01, read("aero/qbar-psf")), read("metrics/Sw-sqft"))
    says = "Thrust of both engines over dynamic pressure and wing area"
    found.append(function("aero/thrust-coefficient", says, do("quotient", thrust, dynamic)))
    return "".join(found)


def external_reactions() -> str:
    """Thrust along each engine's line, and the gyroscopic moment of both rotors: omega x h, as the source has
    it; a rotor that turns positively about x has the opposite."""
    forces = []
    for engine in ENGINES:
        body = f"<function>{read(f'engine/{engine}/thrust-lbs')}</function>"
        location = triple(structural_in(_of(engine)["position_ft"]))
        forces.append(
            f'<force name="{engine}" frame="BODY">{body}<location unit="IN">{location}</location>'
            f"<direction>{triple(direction(engine))}</direction></force>"
        )
    rate = {axis: read(f"velocities/{name}-rad_sec") for axis, name in zip("xyz", "pqr", strict=True)}
    for axis, one, other in ("xyz", "yzx", "zxy"):
        body = do(
            "difference",
            do("product", rate[one], read(f"engine/rotors/h-{other}")),
            do("product", rate[other], read(f"engine/rotors/h-{one}")),
        )
        unit = triple(axis == each for each in "xyz")
        forces.append(
            f'<moment name="rotors-{axis}" frame="BODY"><function>{body}</function>'
            f"<direction>{unit}</direction></moment>"
        )
    return f"<external_reactions>{''.join(forces)}</external_reactions>"


def _of(engine: str) -> dict[str, Any]:
    found: dict[str, Any] = parameters()["engines"][engine.partition("_")[0]]
    return found


def direction(engine: str) -> tuple[float, float, float]:
    """The way an engine pushes, body axes."""
    pitched, yawed = (radians(_of(engine)[f"{way}_deg"]) for way in ("pitched", "yawed"))
    return cos(pitched) * cos(yawed), sin(yawed), -sin(pitched) * cos(yawed)


def _polynomial(of: list[float], x: str) -> str:
    """Horner's scheme, highest power first."""
    body = value(float(of[0]))
    for coefficient in of[1:]:
        body = do("product", body, x)
        body = do("sum", body, coefficient) if coefficient else body
    return body


def _engine(engine: str) -> list[str]:
    of = parameters()["engine"]
    rpm, static = f"engine/{engine}/rpm-percent", f"engine/{engine}/static-thrust-lbs"
    thin = do("quotient", read("atmosphere/P-psf"), of["sea_level_psf"])
    ram = do("product", of["ram_drag"], read("aero/qbar-psf"), read("metrics/Sw-sqft"))
    net = do("difference", do("product", read(static), thin), ram)
    return [
        function(rpm, "Speed, %", _polynomial(of["rpm_percent"], read(f"fcs/{engine}-lagged-percent"))),
        function(static, "Thrust at sea level, at rest", _polynomial(of["thrust_lbf"], read(rpm))),
        function(f"engine/{engine}/thrust-lbs", "Thrust less ram drag", do("max", 0.0, net)),
    ]
