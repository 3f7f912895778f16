"""A contact in the files of multibody engines.

MuJoCo: a1 = (1 - d) a0 - d (b v + k r), with b = damping / dwidth and
k = stiffness d / dwidth^2, d growing from d0 to dwidth: a spring and a damper for each kilogram,
both bent. https://mujoco.readthedocs.io/en/stable/modeling.html#solver-parameters

SDFormat: kp = kp1 kp2 / (kp1 + kp2) and kd = kd1 + kd2 of both surfaces, joined so by Gazebo
Classic's ODEPhysics::Collide. http://sdformat.org/spec?elem=surface
"""

import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from impact_rig.results.numbers import MICRO, format_quantity
from impact_rig.simulators.contact import STRAIGHT, Bend, Contact, Spring, fit_bend, fit_spring

IMPEDANCE = 0.001  # [-], dwidth of MuJoCo's solimp: the impact does not depend on it
SPHERE_RADIUS = 0.01  # [m], of the bodies: the laws know no radius
WIDTH = 92  # [characters], of comments


@dataclass(frozen=True)
class Engine:
    """The rules of one engine."""

    title: str
    suffix: str  # of its files
    equation: str
    choose_bend: Callable[[float], Bend]  # of the law's exponent
    convert: Callable[[Contact, Spring], Mapping[str, float]]  # to the engine's parameters
    body: str  # template of a body
    world: str  # template of the file


def format_contact(engine: Engine, contact: Contact) -> str:
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


def _format_comment(engine: Engine, contact: Contact, values: Mapping[str, float]) -> str:
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
    printable = [
        "".join(letter if letter.isprintable() else "?" for letter in line) for line in lines
    ]
    wrapped = [part for line in printable for part in textwrap.wrap(line, WIDTH)]
    # Two hyphens would end the comment: a sample may be called so.
    return "\n".join(wrapped).replace("--", "==")


def _convert_to_mujoco(contact: Contact, spring: Spring) -> Mapping[str, float]:
    return {
        "stiffness": spring.stiffness / contact.equivalent_mass,  # [1/s^2]
        "damping": spring.damping / contact.equivalent_mass,  # [1/s]
        "d0": spring.bend.start * IMPEDANCE,
        "dwidth": IMPEDANCE,
        "width": spring.depth,  # [m]
        "power": spring.bend.power,
    }


def _convert_to_sdf(_: Contact, spring: Spring) -> Mapping[str, float]:
    return {"kp": 2.0 * spring.stiffness, "kd": 0.5 * spring.damping}  # [N/m], [N s/m]


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
        convert=_convert_to_sdf,
        body=SDF_BODY,
        world=SDF_WORLD,
    ),
}
