"""A measured contact as a spring between two free bodies, in the files of multibody engines.

MuJoCo: a1 = (1 - d) a0 - d (b v + k r), with b = damping / dwidth and
k = stiffness d / dwidth^2, d growing from d0 to dwidth: a spring and a damper for each kilogram,
both bent. https://mujoco.readthedocs.io/en/stable/modeling.html#solver-parameters

SDFormat: kp = kp1 kp2 / (kp1 + kp2) and kd = kd1 + kd2 of both surfaces, joined so by Gazebo
Classic's ODEPhysics::Collide. http://sdformat.org/spec?elem=surface
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import join_findings
from impact_rig.core.given.records import FloatArray, Origin
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MICRO, format_quantity

IMPEDANCE = 0.001  # [-], dwidth of MuJoCo's solimp: the impact does not depend on it
SPHERE_RADIUS = 0.01  # [m], of the bodies: the laws know no radius


@dataclass(frozen=True)
class KnownContact:
    """Two free bodies and the law identified between them."""

    sample: str
    hammer_mass: float  # [kg]
    sample_mass: float  # [kg], with its accelerometer
    law: ContactLaw
    origin: Origin  # of the hits that the law was identified from

    @property
    def equivalent_mass(self) -> float:
        """m1 m2 / (m1 + m2) [kg]."""
        return self.hammer_mass * self.sample_mass / (self.hammer_mass + self.sample_mass)

    @property
    def restitution(self) -> float:
        """Speed of separation over impact speed [-]; 1 where noise makes it seem to be more."""
        return min(1.0, self.law.restitution.value)


def make_contact(results: Results, name: str) -> KnownContact:
    """Return the contact of one sample.

    Raises
    ------
    ParameterError
        If there is no result of the sample, or no law was identified, or a mass is not known.
    """
    law = next((item.contact_law for item in results.samples if item.name == name), None)
    if law is None:
        names = ", ".join(repr(item.name) for item in results.samples) or "none"
        raise ParameterError(f"there is no result of sample {name!r}: there are some of {names}")
    if not (law.is_known and law.stiffness.is_known and law.impact_speed.is_known):
        reason = join_findings(law.notes) or "none was looked for"
        raise ParameterError(f"sample {name!r} has no identified contact law: {reason}")
    return KnownContact(
        sample=name,
        hammer_mass=results.setup.hammer_mass,
        sample_mass=results.setup.samples.get_moving_mass(name),
        law=law,
        origin=results.find_origin(name),
    )


@dataclass(frozen=True)
class Bend:
    """How an engine's spring and damper grow with the compression s: D = 1 - (1 - D0) (1 - s)^p.

    All in the scales of `impact_rig.core.estimates.law_pulses`.
    """

    start: float = 1.0  # [-], D0
    power: float = 1.0  # [-], p
    depth: float = 1.0  # [v T], compression from which D is 1

    def compute(self, compression: float) -> float:
        """Return D [-]."""
        left = 1.0 - min(compression / self.depth, 1.0)
        return 1.0 - (1.0 - self.start) * left**self.power


STRAIGHT = Bend()


def fit_bend(exponent: float) -> Bend:
    """Return the bend at which D^2 s is nearest to s^n.

    It is within 1.1 % of the force for n from 1 to 2.5, and within 3 % at n = 3, which stands for
    all above. Below n = 1 there is no such bend.
    """
    if exponent <= 1.0:
        return STRAIGHT
    # Half as deep again as a contact without loss: from a quarter to twice the speed a Hertz
    # contact then lasts as long as it should to 4 %.
    depth = 1.5 * ((exponent + 1.0) / 2.0) ** (1.0 / (exponent + 1.0))
    part = np.linspace(0.0, 1.0, 201)

    def compute_error(shape: FloatArray) -> FloatArray:
        start, power = shape
        bent = 1.0 - (1.0 - start) * (1.0 - part) ** power
        return np.asarray(bent**2 * part - part ** min(exponent, 3.0))

    found = least_squares(compute_error, (0.5, 1.3), bounds=((0.1, 1.0), (1.0, 20.0)))
    start, power = found.x.tolist()
    return Bend(start, power, depth)


@dataclass(frozen=True)
class Spring:
    """F = stiffness D^2 x + damping D x', never below zero, between the two bodies."""

    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    bend: Bend
    depth: float  # [m], from which D is 1


def fit_spring(contact: KnownContact, bend: Bend) -> Spring:
    """Return the spring whose duration and restitution are those of the contact."""
    coefficient = _fit_damping(contact.restitution, bend)
    duration, _ = _compute_pulse(coefficient, bend)
    scale = contact.law.duration.value / duration  # T [s]
    mass, speed = contact.equivalent_mass, contact.law.impact_speed.value
    return Spring(
        stiffness=mass / scale**2,
        damping=coefficient * mass / scale,
        bend=bend,
        depth=bend.depth * speed * scale,
    )


def _fit_damping(restitution: float, bend: Bend) -> float:
    if restitution >= 1.0:
        return 0.0

    def compute_excess(coefficient: float) -> float:
        return _compute_pulse(coefficient, bend)[1] - restitution

    highest = 1.0
    while compute_excess(highest) > 0.0:
        highest *= 2.0
    return float(brentq(compute_excess, 0.0, highest, xtol=1e-12, rtol=1e-12))


def _compute_pulse(coefficient: float, bend: Bend) -> tuple[float, float]:
    """Return duration [T] and restitution [-] of a scaled pulse."""

    def compute_force(compression: float, speed: float) -> float:
        bent = bend.compute(compression)
        return bent**2 * compression + coefficient * bent * speed

    def move(_: float, state: FloatArray) -> tuple[float, float]:
        return state[1], -compute_force(state[0], state[1])

    def is_over(_: float, state: FloatArray) -> float:
        return compute_force(state[0], state[1])

    is_over.terminal, is_over.direction = True, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        move,
        (0.0, 100.0),
        (0.0, 1.0),
        method="DOP853",
        events=is_over,
        rtol=1e-10,
        atol=1e-10,
    )
    return float(found.t[-1]), float(-found.y[1, -1])


@dataclass(frozen=True)
class Engine:
    """The rules of one engine."""

    title: str
    suffix: str  # of its files
    equation: str
    choose_bend: Callable[[float], Bend]  # of the law's exponent
    convert: Callable[[KnownContact, Spring], Mapping[str, float]]  # to the engine's parameters
    body: str  # template of a body
    world: str  # template of the file


def format_contact(engine: Engine, contact: KnownContact) -> str:
    """Return an engine's file of two spheres that touch, with what was measured in a comment."""
    spring = fit_spring(contact, engine.choose_bend(contact.law.exponent.value))
    values = engine.convert(contact, spring)
    texts = {name: f"{value:.10g}" for name, value in values.items()}
    bodies = "".join(
        engine.body.format(
            name=name,
            place=place,
            mass=f"{mass:.10g}",
            inertia=f"{0.4 * mass * SPHERE_RADIUS**2:.10g}",
            radius=SPHERE_RADIUS,
            **texts,
        )
        for name, place, mass in (
            ("hammer", 0.0, contact.hammer_mass),
            ("sample", 2.0 * SPHERE_RADIUS, contact.sample_mass),
        )
    )
    comment = _format_comment(engine, contact, values)
    return engine.world.format(comment=comment, bodies=bodies, radius=SPHERE_RADIUS, **texts)


def _format_comment(engine: Engine, contact: KnownContact, values: Mapping[str, float]) -> str:
    law = contact.law
    lines = [
        f"Contact of {contact.sample} with the hammer, identified by impact-rig.",
        f"Origin of the hits: {contact.origin}.",
        (
            f"Bodies: {1e3 * contact.hammer_mass:.2f} g and {1e3 * contact.sample_mass:.2f} g,"
            f" free, meeting at {1e3 * law.impact_speed.value:.2f} mm/s."
        ),
        f"Contact duration {format_quantity(law.duration, 2, MICRO)} µs.",
        f"Restitution {format_quantity(law.restitution, 4)}.",
        f"Peak force {law.peak_force.value:.4g} N.",
        (
            f"Contact law F = k x^n and a loss by {law.form}, n = {law.exponent.value:.4g},"
            f" k = {law.stiffness.value:.5g} N/m^n."
        ),
        f"{engine.title} has {engine.equation}, never below zero:",
        *(f"{name} = {value:.6g}" for name, value in values.items()),
        f"Duration and restitution {contact.restitution:.4g} are met at this speed.",
    ]
    printable = (
        "".join(letter if letter.isprintable() else "?" for letter in line) for line in lines
    )
    # Two hyphens would end the comment: a sample may be called so.
    return "\n".join(printable).replace("--", "==")


def _convert_to_mujoco(contact: KnownContact, spring: Spring) -> Mapping[str, float]:
    return {
        "stiffness": spring.stiffness / contact.equivalent_mass,  # [1/s^2]
        "damping": spring.damping / contact.equivalent_mass,  # [1/s]
        "d0": spring.bend.start * IMPEDANCE,
        "dwidth": IMPEDANCE,
        "width": spring.depth,  # [m]
        "power": spring.bend.power,
    }


MUJOCO_BODY = """\
    <body name="{name}" pos="{place} 0 0">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom class="impact"/>
    </body>
"""
MUJOCO_WORLD = """\
<?xml version="1.0"?>
<!--
{comment}
MuJoCo's contacts know no mass: these parameters are for bodies of the same m1 m2 / (m1 + m2).
-->
<mujoco model="impact">
  <option timestep="1e-6" gravity="0 0 0"/>
  <default>
    <default class="impact">
      <geom type="sphere" size="{radius}" condim="1" solref="-{stiffness} -{damping}"
            solimp="{d0} {dwidth} {width} 0 {power}"/>
    </default>
  </default>
  <worldbody>
{bodies}  </worldbody>
</mujoco>
"""
SDF_BODY = """\
    <model name="{name}">
      <pose>{place} 0 0 0 0 0</pose>
      <link name="body">
        <inertial>
          <mass>{mass}</mass>
          <inertia><ixx>{inertia}</ixx><iyy>{inertia}</iyy><izz>{inertia}</izz></inertia>
        </inertial>
        <collision name="contact">
          <geometry><sphere><radius>{radius}</radius></sphere></geometry>
          <surface>
            <contact>
              <ode>
                <kp>{kp}</kp>
                <kd>{kd}</kd>
                <max_vel>1000</max_vel>
                <min_depth>0</min_depth>
              </ode>
            </contact>
            <friction><ode><mu>0</mu><mu2>0</mu2></ode></friction>
          </surface>
        </collision>
      </link>
    </model>
"""
SDF_WORLD = """\
<?xml version="1.0"?>
<!--
{comment}
For engines that read ode, as Gazebo Classic's does. The default of max_vel would cut the push of
the spring. A step h acts as a further damping of kp h: take steps far below the duration.
-->
<sdf version="1.7">
  <world name="impact">
    <gravity>0 0 0</gravity>
    <physics name="impact" type="ode">
      <max_step_size>1e-07</max_step_size>
      <real_time_factor>0</real_time_factor>
    </physics>
{bodies}  </world>
</sdf>
"""

ENGINES = {
    "mujoco": Engine(
        title="MuJoCo",
        suffix=".xml",
        equation="F = m_eq (stiffness D^2 x + damping D x'), D = d(x) / dwidth",
        choose_bend=fit_bend,
        convert=_convert_to_mujoco,
        body=MUJOCO_BODY,
        world=MUJOCO_WORLD,
    ),
    "sdf": Engine(
        title="SDFormat",
        suffix=".sdf",
        equation="F = (kp / 2) x + 2 kd x'",
        choose_bend=lambda _: STRAIGHT,
        # [N/m], [N s/m]
        convert=lambda _, spring: {"kp": 2.0 * spring.stiffness, "kd": 0.5 * spring.damping},
        body=SDF_BODY,
        world=SDF_WORLD,
    ),
}
