"""The contact in each engine's own law: its parameters, and what that law cannot hold.

Every engine's normal force is one of F = K f(delta) + C g(delta) delta', never below zero. K and
C are chosen so that duration and restitution at the measured speed are the measured ones.
Scaled as in `impact_rig.core.model.contact_law`, a pulse is x'' = -(f(x) + c g(x) x'), x(0) = 0,
x'(0) = 1, from touch until the force is zero: restitution depends on c alone, duration gives T.
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares

from impact_rig.core.signals.record import FloatArray
from impact_rig.simulators.contact import Contact, MeasuredContacts

TOLERANCE = 1e-10
"""Of the integration, relative and absolute in scaled units [-], our choice."""
STEP = 1e-3
"""Of duration and restitution, relative, for derivatives [-], our choice."""
LONGEST = 100.0
"""Of a scaled pulse [T]: one of n = 4 without rebound takes a tenth of it."""
POINTS = 201
"""Of a pulse that is drawn [-]."""
IMPEDANCE = 0.001
"""dwidth of MuJoCo's solimp [-], our choice: a contact carries a load at rest at (1 - d) of the
depth that its spring has, and the impact does not depend on dwidth."""
LARGEST_BENT = 3.0
"""Exponent up to which MuJoCo's spring can be bent [-]: d as x."""
BENT_OVER_TURN = 1.5
"""Depth over which MuJoCo's spring is bent, over that at which the bodies turn [-], our choice:
from a quarter to twice the speed a Hertz contact then lasts as long as it should to 4 %."""
SMALLEST_IMPEDANCE, LARGEST_POWER = 0.1, 20.0
"""Of d0 over dwidth, which MuJoCo has from 1e-4, and of solimp's power [-], our choice."""
BETWEEN_EXPONENTS = 1.25
"""n from which a choice between spring and Hertz falls on Hertz [-]: the middle."""


@dataclass(frozen=True)
class Law:
    """An engine's normal force, scaled: f(x) + c g(x) x', never below zero.

    Attributes
    ----------
    equation : str
        Of the contact of both bodies, by the engine's names; x: their indentation.
    exponent : float
        Of x that it holds [-].
    elastic, damping : callable
        f and g, of the compression x [-].
    """

    equation: str
    exponent: float
    elastic: Callable[[float], float]
    damping: Callable[[float], float]

    def compute_force(self, compression: float, speed: float, coefficient: float) -> float:
        """Return the scaled force, which would be below zero where the engine has none."""
        x = max(compression, 0.0)
        return self.elastic(x) + coefficient * self.damping(x) * speed


@dataclass(frozen=True)
class LawPulse:
    """A scaled pulse of an engine's law: times in T, speeds in v, forces in m_eq v / T."""

    duration: float
    restitution: float
    peak_force: float
    time: FloatArray
    force: FloatArray


def compute_law_pulse(law: Law, coefficient: float, speed: float = 1.0) -> LawPulse:
    """Integrate a pulse from touch until its force is zero.

    Parameters
    ----------
    coefficient : float
        c [-].
    speed : float
        Over the one that the scales belong to [-].
    """

    def move(_: float, state: FloatArray) -> tuple[float, float]:
        return state[1], -law.compute_force(state[0], state[1], coefficient)

    def is_over(_: float, state: FloatArray) -> float:
        return law.compute_force(state[0], state[1], coefficient)

    def is_apart(_: float, state: FloatArray) -> float:
        return float(state[0])

    for event in (is_over, is_apart):
        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        move,
        (0.0, LONGEST),
        (0.0, speed),
        method="DOP853",
        events=(is_over, is_apart),
        rtol=TOLERANCE,
        atol=TOLERANCE,
        dense_output=True,
    )
    duration = float(found.t[-1])
    time = np.linspace(0.0, duration, POINTS)
    states = found.sol(time).T
    force = np.array([max(law.compute_force(x, v, coefficient), 0.0) for x, v in states])
    return LawPulse(duration, float(-found.y[1, -1] / speed), float(force.max()), time, force)


def fit_damping(law: Law, restitution: float) -> float:
    """Return c at which a pulse of a law has this restitution, above 0 [-]."""
    if restitution >= 1.0:
        return 0.0

    def compute_excess(coefficient: float) -> float:
        return compute_law_pulse(law, coefficient).restitution - restitution

    highest = 1.0
    while compute_excess(highest) > 0.0:
        highest *= 2.0
    return float(brentq(compute_excess, 0.0, highest, xtol=1e-12, rtol=1e-12))


@dataclass(frozen=True)
class Value:
    """A parameter as an engine wants it.

    Attributes
    ----------
    value : float
        At the speed that the parameters are for, in `unit`.
    unit : str
        The engine's.
    expanded : float
        Half-width of the 95 % interval that follows from those of duration and restitution, taken
        as independent; NaN: not determined.
    lowest, highest : float
        Over the measured speeds.
    """

    value: float
    unit: str
    expanded: float = math.nan
    lowest: float = math.nan
    highest: float = math.nan


@dataclass(frozen=True)
class Parameters:
    """What an engine is given for a contact.

    Attributes
    ----------
    engine : Engine
        Whose they are.
    contact : Contact
        What they are to show.
    measured : MeasuredContacts
        Where it comes from.
    values : mapping of str to Value
        By the engine's own names.
    coefficient : float
        c of the engine's law [-].
    time_scale : float
        T [s].
    """

    engine: "Engine"
    contact: Contact
    measured: MeasuredContacts
    values: Mapping[str, Value]
    coefficient: float
    time_scale: float

    @property
    def law(self) -> Law:
        """The engine's, for this contact."""
        return self.engine.choose_law(self.contact)

    def compute_pulse(self, speed: float | None = None) -> LawPulse:
        """Return what the engine's law says at a speed [m/s], in SI units."""
        speed = self.contact.speed if speed is None else speed
        ratio = speed / self.contact.speed
        pulse = compute_law_pulse(self.law, self.coefficient, ratio)
        force = self.contact.equivalent_mass * self.contact.speed / self.time_scale
        return LawPulse(
            duration=pulse.duration * self.time_scale,
            restitution=pulse.restitution,
            peak_force=pulse.peak_force * force,
            time=pulse.time * self.time_scale,
            force=pulse.force * force,
        )


@dataclass(frozen=True)
class Engine:
    """A multibody engine as far as contacts go.

    Attributes
    ----------
    name, title : str
        For commands and for people.
    choose_law : callable
        Its law, for a contact.
    convert : callable
        From contact, c and T to its parameters in its units: see the functions below.
    both_bodies : str
        Where the parameters are to be given.
    package : str
        On PyPI, where `--check` runs in it; empty: it does not.
    module : str
        What Python imports of it.
    """

    name: str
    title: str
    choose_law: Callable[[Contact], Law]
    convert: Callable[[Contact, float, float], dict[str, Value]]
    both_bodies: str
    package: str = ""
    module: str = ""


def compute_parameters(
    engine: Engine, measured: MeasuredContacts, speed: float | None = None
) -> Parameters:
    """Find an engine's parameters of a contact.

    Parameters
    ----------
    engine : Engine
        One of `ENGINES`.
    measured : MeasuredContacts
        Of one sample.
    speed : float, optional
        At which duration and restitution are to be met [m/s]; otherwise as `at_speed` has it.

    Raises
    ------
    ParameterError
        If the speed is outside what was measured.
    """
    contact = measured.at_speed(speed)
    coefficient, scale = _fit(engine, contact)
    values = engine.convert(contact, coefficient, scale)
    speeds = [engine.convert(item, *_fit(engine, item)) for item in measured.contacts]
    effects = _differentiate(engine, contact, values)
    found = {}
    for name, item in values.items():
        spread = [others[name].value for others in (values, *speeds)]
        expanded = math.hypot(*effects[name]) if effects[name] else math.nan
        found[name] = replace(item, expanded=expanded, lowest=min(spread), highest=max(spread))
    return Parameters(engine, contact, measured, found, coefficient, scale)


def _differentiate(
    engine: Engine, contact: Contact, values: Mapping[str, Value]
) -> dict[str, list[float]]:
    """Return what the uncertainties of duration and restitution, where known, do to each value."""
    effects: dict[str, list[float]] = {name: [] for name in values}
    for quantity in ("duration", "restitution"):
        met = getattr(contact, quantity)
        expanded = getattr(contact, f"{quantity}_expanded")
        if math.isnan(expanded):
            continue
        # Downwards: a restitution does not rise above 1.
        moved = replace(contact, **{quantity: met * (1.0 - STEP)})
        changed = engine.convert(moved, *_fit(engine, moved))
        for name, value in values.items():
            effects[name].append((changed[name].value - value.value) * expanded / (STEP * met))
    return effects


def _fit(engine: Engine, contact: Contact) -> tuple[float, float]:
    """Return c [-] and T [s] that meet restitution and duration."""
    law = engine.choose_law(contact)
    coefficient = fit_damping(law, contact.restitution)
    return coefficient, contact.duration / compute_law_pulse(law, coefficient).duration


def _make_spring(equation: str) -> Callable[[Contact], Law]:
    law = Law(equation, 1.0, lambda x: x, lambda _: 1.0)
    return lambda _: law


def _compute_spring(contact: Contact, coefficient: float, scale: float) -> tuple[float, float]:
    """Return K [N/m] and C [N s/m] of F = K delta + C delta'."""
    mass = contact.equivalent_mass
    return mass / scale**2, coefficient * mass / scale


def _solve_turn(exponent: float) -> float:
    """Return the depth at which bodies turn that lose nothing [v T]."""
    return float(((exponent + 1.0) / 2.0) ** (1.0 / (exponent + 1.0)))


@functools.cache
def _fit_impedance(exponent: float) -> tuple[float, float]:
    """Return D0 and p at which (D0 + (1 - D0) (1 - (1 - s)^p))^2 s is nearest to s^n.

    Of s from 0 to 1. The largest difference is 0.011 up to n = 2.5, and 0.03 at n = 3, which
    stands for all above; below n = 1 there is no such D, and it is 1.
    """
    if exponent <= 1.0:
        return 1.0, 1.0
    depth = np.linspace(0.0, 1.0, POINTS)

    def compute_error(shape: FloatArray) -> FloatArray:
        start, power = shape
        impedance = start + (1.0 - start) * (1.0 - (1.0 - depth) ** power)
        return np.asarray(impedance**2 * depth - depth ** min(exponent, LARGEST_BENT))

    found = least_squares(
        compute_error, (0.5, 1.3), bounds=((SMALLEST_IMPEDANCE, 1.0), (1.0, LARGEST_POWER))
    )
    start, power = found.x.tolist()
    return start, power


def _choose_mujoco_law(contact: Contact) -> Law:
    start, power = _fit_impedance(contact.exponent)
    width = BENT_OVER_TURN * _solve_turn(contact.exponent)

    def compute_impedance(compression: float) -> float:
        part = min(compression / width, 1.0)
        return start + (1.0 - start) * (1.0 - (1.0 - part) ** power)

    return Law(
        "F = m_eq (stiffness D^2 x + damping D x'), D = d(x) / dwidth",
        min(max(contact.exponent, 1.0), LARGEST_BENT),
        lambda x: compute_impedance(x) ** 2 * x,
        compute_impedance,
    )


def _convert_to_mujoco(contact: Contact, coefficient: float, scale: float) -> dict[str, Value]:
    """Return MuJoCo's solref = (-stiffness, -damping) and what of solimp is not always the same.

    Of one contact a1 = (1 - d) a0 - d (b v + k r), with b = damping / dwidth and
    k = stiffness d / dwidth^2, d going from d0 to dwidth over a depth of width: a spring and a
    damper for each kilogram, which never pull, both bent by d. "Solver parameters",
    https://mujoco.readthedocs.io/en/stable/modeling.html#solver-parameters.
    """
    stiffness, damping = _compute_spring(contact, coefficient, scale)
    mass = contact.equivalent_mass
    start, power = _fit_impedance(contact.exponent)
    return {
        "stiffness": Value(stiffness / mass, "1/s^2"),
        "damping": Value(damping / mass, "1/s"),
        "d0": Value(start * IMPEDANCE, ""),
        "width": Value(
            BENT_OVER_TURN * _solve_turn(contact.exponent) * contact.speed * scale, "m"
        ),
        "power": Value(power, ""),
    }


def _convert_to_drake(contact: Contact, coefficient: float, scale: float) -> dict[str, Value]:
    """Return Drake's properties of each body: F = k x (1 + d x')+, k = k1 k2 / (k1 + k2).

    "Compliant point contact", https://drake.mit.edu/doxygen_cxx/group__compliant__contact.html.
    """
    stiffness, _ = _compute_spring(contact, coefficient, scale)
    return {
        "point_contact_stiffness": Value(2.0 * stiffness, "N/m"),
        "hunt_crossley_dissipation": Value(coefficient / contact.speed, "s/m"),
    }


def _convert_to_sdf(contact: Contact, coefficient: float, scale: float) -> dict[str, Value]:
    """Return SDFormat's kp and kd of each surface: kp = kp1 kp2 / (kp1 + kp2), kd = kd1 + kd2.

    http://sdformat.org/spec?elem=surface; joined so by Gazebo Classic's ODEPhysics::Collide, which
    makes ERP = h kp / (h kp + kd) and CFM = 1 / (h kp + kd) of them at the step h.
    """
    stiffness, damping = _compute_spring(contact, coefficient, scale)
    return {"kp": Value(2.0 * stiffness, "N/m"), "kd": Value(damping / 2.0, "N s/m")}


def _convert_to_pybullet(contact: Contact, coefficient: float, scale: float) -> dict[str, Value]:
    """Return PyBullet's arguments of changeDynamics, the same for each body.

    Joined by btManifoldResult: stiffness s1 s2 / (s1 + s2), damping d1 + d2; made ERP and CFM as
    in `_convert_to_sdf` by btSequentialImpulseConstraintSolver. "PyBullet Quickstart Guide",
    changeDynamics.
    """
    stiffness, damping = _compute_spring(contact, coefficient, scale)
    return {
        "contactStiffness": Value(2.0 * stiffness, "N/m"),
        "contactDamping": Value(damping / 2.0, "N s/m"),
    }


def _choose_chrono_law(contact: Contact) -> Law:
    """Return PlainCoulomb, F = kn delta^(3/2) + gn delta^(1/2) delta', or Hooke with m_eq gn."""
    if contact.exponent < BETWEEN_EXPONENTS:
        return Law("F = kn x + m_eq gn x' (Hooke)", 1.0, lambda x: x, lambda _: 1.0)
    return Law(
        "F = kn x^1.5 + gn x^0.5 x' (PlainCoulomb)", 1.5, lambda x: math.sqrt(x) * x, math.sqrt
    )


def _convert_to_chrono(contact: Contact, coefficient: float, scale: float) -> dict[str, Value]:
    """Return Chrono's kn and gn without material properties: it takes the mean of both bodies'.

    ChSystemSMC::ContactForceModel, https://api.projectchrono.org/classchrono_1_1_ch_system_s_m_c.html,
    equations as in ChContactSMC::CalculateForceTorque. Its model Hertz needs a radius, which no
    impact tells; PlainCoulomb has the same exponent without one.
    """
    mass = contact.equivalent_mass
    if contact.exponent < BETWEEN_EXPONENTS:
        stiffness, damping = _compute_spring(contact, coefficient, scale)
        return {"kn": Value(stiffness, "N/m"), "gn": Value(damping / mass, "1/s")}
    reach = contact.speed * scale
    return {
        "kn": Value(mass / (scale**2 * math.sqrt(reach)), "N/m^1.5"),
        "gn": Value(coefficient * mass / (scale * math.sqrt(reach)), "N s/m^1.5"),
    }


def _choose_adams_law(contact: Contact) -> Law:
    """Return max(0, k delta^e + STEP(delta, 0, 0, d, cmax) delta')."""
    depth = _solve_turn(contact.exponent)

    def compute_step(compression: float) -> float:
        part = min(compression / depth, 1.0)
        return part**2 * (3.0 - 2.0 * part)

    exponent = contact.exponent
    return Law(
        "F = k x^e + STEP(x, 0, 0, d, cmax) x'", exponent, lambda x: x**exponent, compute_step
    )


def _convert_to_adams(contact: Contact, coefficient: float, scale: float) -> dict[str, Value]:
    """Return k, e, cmax and d of the IMPACT function, in mm, N and s, as Adams begins with.

    IMPACT(x, x', x1, k, e, cmax, d) = max(0, k (x1 - x)^e - STEP(x, x1 - d, cmax, x1, 0) x'): see
    IMPACT in the guides of Adams Solver and of MotionSolve. d is where the bodies would turn
    without loss.
    """
    mass, reach, n = contact.equivalent_mass, contact.speed * scale, contact.exponent
    millimetres = 1e3
    return {
        "k": Value(mass / (scale**2 * reach ** (n - 1.0)) / millimetres**n, "N/mm^e"),
        "e": Value(n, ""),
        "cmax": Value(coefficient * mass / scale / millimetres, "N s/mm"),
        "d": Value(_solve_turn(n) * reach * millimetres, "mm"),
    }


_DRAKE = Law(
    "F = (point_contact_stiffness / 2) x (1 + hunt_crossley_dissipation x')",
    1.0,
    lambda x: x,
    lambda x: x,
)
ENGINES = {
    engine.name: engine
    for engine in (
        Engine(
            "mujoco",
            "MuJoCo",
            _choose_mujoco_law,
            _convert_to_mujoco,
            "both geoms have these, in solref with a minus sign and in solimp",
            "mujoco",
            "mujoco",
        ),
        Engine(
            "drake",
            "Drake",
            lambda _: _DRAKE,
            _convert_to_drake,
            "both bodies have these",
            "drake",
            "pydrake",
        ),
        Engine(
            "sdf",
            "SDFormat",
            _make_spring("F = (kp / 2) x + 2 kd x'"),
            _convert_to_sdf,
            "both bodies have these",
        ),
        Engine(
            "pybullet",
            "PyBullet",
            _make_spring("F = (contactStiffness / 2) x + 2 contactDamping x'"),
            _convert_to_pybullet,
            "both bodies have these",
            "pybullet",
            "pybullet",
        ),
        Engine(
            "chrono",
            "Chrono",
            _choose_chrono_law,
            _convert_to_chrono,
            "both materials have these",
        ),
        Engine(
            "adams",
            "Adams",
            _choose_adams_law,
            _convert_to_adams,
            "of the contact as a whole, in mm, N and s",
        ),
    )
}
"""By name."""
