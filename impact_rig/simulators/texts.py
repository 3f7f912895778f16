"""Parameters in each engine's own form, with what was measured and what the law cannot hold."""

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from impact_rig.core.errors import ParameterError
from impact_rig.core.origin import MEASURED, SIMULATED
from impact_rig.results.numbers import MICRO, format_difference, format_uncertain
from impact_rig.simulators.contact import Contact
from impact_rig.simulators.parameters import IMPEDANCE, Parameters, Value

SPHERE_RADIUS = 0.01
"""Of the bodies of a model [m], our choice: the laws know no radius."""
WIDTH = 92
"""Of comments [characters], our choice."""
OTHER_SPEEDS = (0.5, 2.0)
"""Over the speed of the parameters, at which law and engine are compared [-], our choice."""
FASTEST_CORRECTION = 1e3
"""max_vel of SDFormat [m/s]: its default of 0.01 m/s would cut the spring's push."""


def format_text(parameters: Parameters, suffix: str) -> str:
    """Return the file of an engine.

    Parameters
    ----------
    parameters : Parameters
        What goes into it.
    suffix : str
        Of the file: one of `SUFFIXES` of the engine.
    """
    lines = _describe(parameters)
    return _FORMATS[parameters.engine.name, suffix](parameters, lines)


def choose_suffix(engine: str, path: Path) -> str:
    """Return the suffix of an engine's file.

    Raises
    ------
    ParameterError
        If the engine reads none of that suffix.
    """
    if path.suffix.lower() not in SUFFIXES[engine]:
        raise ParameterError(
            f"{path} is no file of {engine}, which has {' or '.join(SUFFIXES[engine])}"
        )
    return path.suffix.lower()


def _describe(parameters: Parameters) -> list[str]:
    """Return what the comments say, line by line."""
    contact, law = parameters.contact, parameters.law
    own = parameters.compute_pulse()
    kind = parameters.measured.origin.kind
    origin = kind if kind == SIMULATED else MEASURED
    lines = [
        f"Contact of {contact.sample} with the hammer, identified by impact-rig.",
        *textwrap.wrap(f"Origin of the hits: {parameters.measured.origin}.", WIDTH),
        "",
        (
            f"Bodies: {1e3 * contact.hammer_mass:.2f} g and {1e3 * contact.sample_mass:.2f} g,"
            f" free, meeting at {1e3 * contact.speed:.2f} mm/s."
        ),
        f"{origin.capitalize()} at {parameters.measured.describe_speeds()}:",
        f"  contact duration  {_format(contact.duration, contact.duration_expanded, MICRO)} µs",
        f"  restitution       {_format(contact.restitution, contact.restitution_expanded, 1.0)}",
        f"  peak force        {contact.peak_force:.4g} N",
        (
            f"  contact law       F = k x^n (1 + a x'), n = {contact.exponent:.4g},"
            f" k = {contact.stiffness:.5g} N/m^n, a = {contact.damping:.4g} s/m"
        ),
    ]
    if contact.damping < 0.0:
        lines.append(
            "  a is below zero, which no contact of free bodies has: restitution is 1 here"
        )
    lines += [
        "",
        (
            f"{parameters.engine.title} has {law.equation}, never below zero;"
            f" {parameters.engine.both_bodies}."
        ),
        "Duration and restitution at the speed above are met.",
        *(f"  {name} = {_describe_value(value)}" for name, value in parameters.values.items()),
        "",
        "What this law does not hold:",
        (
            f"  peak force {own.peak_force:.4g} N,"
            f" {format_difference(own.peak_force, contact.peak_force, 1)} % of the measured one"
        ),
    ]
    if not math.isclose(law.exponent, contact.exponent):
        lines.append(f"  exponent {law.exponent:g} in place of {contact.exponent:.4g}")
    for ratio in OTHER_SPEEDS:
        speed = ratio * contact.speed
        there, wanted = parameters.compute_pulse(speed), contact.at_speed(speed)
        lines.append(
            f"  at {1e3 * speed:.4g} mm/s it gives {there.duration * MICRO:.1f} µs and"
            f" e = {there.restitution:.4f}; the contact law: {wanted.duration * MICRO:.1f} µs and"
            f" e = {wanted.restitution:.4f}"
        )
    return lines


def _format(value: float, expanded: float, scale: float) -> str:
    return format_uncertain(scale * value, scale * expanded, 4)


def _describe_value(value: Value) -> str:
    text = f"{value.value:.6g}"
    if value.expanded > 0.0:
        text += f" ± {value.expanded:.2g}"
    text = f"{text} {value.unit}".rstrip()
    if value.highest > value.lowest:
        text += f", {value.lowest:.4g} to {value.highest:.4g} over the measured speeds"
    return text


def _format_number(value: float) -> str:
    return f"{value:.10g}"


def _comment_xml(lines: Sequence[str]) -> str:
    # Two hyphens would end the comment: a sample may be called so.
    body = _comment(lines, " ").replace("--", "==")
    return f"<!--\n{body}-->\n"


def _comment(lines: Sequence[str], mark: str) -> str:
    """Return lines as comments, long ones wrapped under their own beginning."""
    wrapped: list[str] = []
    for line in map(_make_printable, lines):
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        wrapped += textwrap.wrap(line, WIDTH, subsequent_indent=indent) or [""]
    return "".join(f"{mark} {line}".rstrip() + "\n" for line in wrapped)


def _make_printable(text: str) -> str:
    """Return a text that no file takes for more than a comment: samples may be called anything."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _write_mujoco(parameters: Parameters, lines: Sequence[str]) -> str:
    stiffness, damping, d0, width, power = _format_values(parameters).values()
    contact = parameters.contact
    more = [
        "",
        (
            "MuJoCo's contacts know no mass: for other bodies multiply stiffness and damping by"
            f" {contact.equivalent_mass:.5g} kg and divide them by m1 m2 / (m1 + m2) of these. Use"
            " the class on both geoms that touch."
        ),
    ]
    bodies = "".join(
        f"""    <body name="{name}" pos="{place} 0 0">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom class="impact"/>
    </body>
"""
        for name, place, mass, inertia in _place_bodies(contact)
    )
    return f"""<?xml version="1.0"?>
{_comment_xml([*lines, *more])}<mujoco model="impact">
  <option timestep="1e-6" gravity="0 0 0"/>
  <default>
    <default class="impact">
      <geom type="sphere" size="{SPHERE_RADIUS}" condim="1"
            solref="-{stiffness} -{damping}"
            solimp="{d0} {IMPEDANCE} {width} 0 {power}"/>
    </default>
  </default>
  <worldbody>
{bodies}  </worldbody>
</mujoco>
"""


def _format_values(parameters: Parameters) -> dict[str, str]:
    return {name: _format_number(value.value) for name, value in parameters.values.items()}


def _place_bodies(contact: Contact) -> list[tuple[str, str, str, str]]:
    """Return name, place [m], mass [kg] and moment of inertia [kg m^2] of two touching spheres."""
    found = []
    for name, place, mass in (
        ("hammer", 0.0, contact.hammer_mass),
        ("sample", 2.0 * SPHERE_RADIUS, contact.sample_mass),
    ):
        inertia = 0.4 * mass * SPHERE_RADIUS**2
        found.append((name, _format_number(place), _format_number(mass), _format_number(inertia)))
    return found


def _write_sdf_world(
    contact: Contact, lines: Sequence[str], tags: str, of_world: str = "", namespace: str = ""
) -> str:
    """Return SDFormat's world of both bodies, `tags` in their collisions."""
    models = "".join(
        f"""    <model name="{name}">
      <pose>{place} 0 0 0 0 0</pose>
      <link name="body">
        <inertial>
          <mass>{mass}</mass>
          <inertia><ixx>{inertia}</ixx><iyy>{inertia}</iyy><izz>{inertia}</izz></inertia>
        </inertial>
        <collision name="contact">
          <geometry><sphere><radius>{SPHERE_RADIUS}</radius></sphere></geometry>
{tags}        </collision>
      </link>
    </model>
"""
        for name, place, mass, inertia in _place_bodies(contact)
    )
    return f"""<?xml version="1.0"?>
{_comment_xml(lines)}<sdf version="1.7"{namespace}>
  <world name="impact">
{of_world}{models}  </world>
</sdf>
"""


_DRAKE_NOTES = (
    "",
    (
        "The discrete contact approximations lagged, similar and tamsi have this law; SAP and"
        " hydroelastic contact have not. Friction is left to you."
    ),
)


def _write_drake_sdf(parameters: Parameters, lines: Sequence[str]) -> str:
    values = {**_format_values(parameters), "mu_dynamic": "0", "mu_static": "0"}
    tags = "".join(
        f"            <drake:{name}>{value}</drake:{name}>\n" for name, value in values.items()
    )
    return _write_sdf_world(
        parameters.contact,
        [*lines, *_DRAKE_NOTES],
        f"          <drake:proximity_properties>\n{tags}          </drake:proximity_properties>\n",
        namespace=' xmlns:drake="drake.mit.edu"',
    )


def _write_drake_urdf(parameters: Parameters, lines: Sequence[str]) -> str:
    _, _, mass, inertia = _place_bodies(parameters.contact)[1]
    tags = "".join(
        f'        <drake:{name} value="{value}"/>\n'
        for name, value in _format_values(parameters).items()
    )
    return f"""<?xml version="1.0"?>
{_comment_xml([*lines, *_DRAKE_NOTES])}<robot name="sample" xmlns:drake="http://drake.mit.edu">
  <link name="body">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <geometry><sphere radius="{SPHERE_RADIUS}"/></geometry>
      <drake:proximity_properties>
{tags}      </drake:proximity_properties>
    </collision>
  </link>
</robot>
"""


def _write_drake_yaml(parameters: Parameters, lines: Sequence[str]) -> str:
    stiffness, dissipation = _format_values(parameters).values()
    more = [*_DRAKE_NOTES, "A SceneGraphConfig: for all geometry that says nothing itself."]
    return f"""{_comment([*lines, *more], "#")}default_proximity_properties:
  point_stiffness: {stiffness}
  hunt_crossley_dissipation: {dissipation}
"""


_STEP_NOTE = (
    "The engine takes its step h implicitly, which acts as a further damping of stiffness times h."
    " At steps longer than the contact use its coefficient of restitution instead, {:.4g}, which"
    " knows no duration."
)


def _write_sdf(parameters: Parameters, lines: Sequence[str]) -> str:
    tags = "".join(
        f"                <{name}>{value}</{name}>\n"
        for name, value in _format_values(parameters).items()
    )
    tags = f"""          <surface>
            <contact>
              <ode>
{tags}                <max_vel>{FASTEST_CORRECTION:g}</max_vel>
                <min_depth>0</min_depth>
              </ode>
            </contact>
            <friction><ode><mu>0</mu><mu2>0</mu2></ode></friction>
          </surface>
"""
    world = """    <gravity>0 0 0</gravity>
    <physics name="impact" type="ode">
      <max_step_size>1e-07</max_step_size>
      <real_time_factor>0</real_time_factor>
    </physics>
"""
    more = [
        "",
        "For engines that read <ode>, as Gazebo Classic's does; max_vel must stay, since its"
        " default cuts the spring's push. " + _STEP_NOTE.format(parameters.contact.restitution),
    ]
    return _write_sdf_world(parameters.contact, [*lines, *more], tags, world)


def _write_pybullet(parameters: Parameters, lines: Sequence[str]) -> str:
    values = "".join(
        f'    "{name}": {value},\n' for name, value in _format_values(parameters).items()
    )
    more = [
        "",
        "For both bodies: pybullet.changeDynamics(body, link, **CONTACT), and once"
        " pybullet.setPhysicsEngineParameter(contactSlop=0): bodies sink in by 10 um otherwise"
        " before they touch. " + _STEP_NOTE.format(parameters.contact.restitution),
    ]
    return f"{_comment([*lines, *more], '#')}\nCONTACT = {{\n{values}}}\n"


def _write_chrono(parameters: Parameters, lines: Sequence[str]) -> str:
    model = "Hooke" if parameters.law.exponent == 1.0 else "PlainCoulomb"
    kn, gn = _format_values(parameters).values()
    more = ["", "For PyChrono; C++ has the same calls. Tangential forces are left to you."]
    return f"""{_comment([*lines, *more], "#")}
import pychrono


def make_contact(system: pychrono.ChSystemSMC) -> pychrono.ChContactMaterialSMC:
    system.UseMaterialProperties(False)
    system.SetContactForceModel(pychrono.ChSystemSMC.{model})
    material = pychrono.ChContactMaterialSMC()
    material.SetKn({kn})
    material.SetGn({gn})
    material.SetKt(0.0)
    material.SetGt(0.0)
    return material
"""


def _write_adams(parameters: Parameters, lines: Sequence[str]) -> str:
    k, e, cmax, d = _format_values(parameters).values()
    more = [
        "",
        (
            "The model's units are mm, kg, N and s; put your IGEOM and JGEOM. MotionSolve has the"
            " same as stiffness, exponent, damping and dmax. As a function of two markers i and j:"
        ),
        f"IMPACT(DX(i,j,j), VX(i,j,j,j), x1, {k}, {e}, {cmax}, {d})",
    ]
    return f"""{_comment([*lines, *more], "!")}CONTACT/1, IGEOM=1, JGEOM=2
, IMPACT
, STIFFNESS={k}
, EXPONENT={e}
, DAMPING={cmax}
, DMAX={d}
"""


_FORMATS: Mapping[tuple[str, str], Callable[[Parameters, Sequence[str]], str]] = {
    ("mujoco", ".xml"): _write_mujoco,
    ("drake", ".sdf"): _write_drake_sdf,
    ("drake", ".urdf"): _write_drake_urdf,
    ("drake", ".yaml"): _write_drake_yaml,
    ("sdf", ".sdf"): _write_sdf,
    ("pybullet", ".py"): _write_pybullet,
    ("chrono", ".py"): _write_chrono,
    ("adams", ".adm"): _write_adams,
}
SUFFIXES = {
    engine: tuple(suffix for name, suffix in _FORMATS if name == engine)
    for engine in dict.fromkeys(name for name, _ in _FORMATS)
}
"""Of the files of each engine, the first where nothing is said."""
