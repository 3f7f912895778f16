"""The files, read by parsers that are not ours."""

import ast
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from impact_rig.core.errors import ParameterError
from impact_rig.simulators.parameters import ENGINES, IMPEDANCE
from impact_rig.simulators.texts import SUFFIXES, choose_suffix, format_text

from .conftest import make_contact

FORMATS = [(engine, suffix) for engine, suffixes in SUFFIXES.items() for suffix in suffixes]
HOSTILE = "a --> b\n\x00'''\"</sdf>&"


def read_tags(text, *names):
    root = ET.fromstring(text)
    return [float(item.text or item.get("value")) for name in names for item in root.iter(name)]


def read_xml(engine, suffix, text):
    if engine == "mujoco":
        geom = ET.fromstring(text).find("default/default/geom")
        d0, dwidth, width, midpoint, power = map(float, geom.get("solimp").split())
        assert (dwidth, midpoint) == (IMPEDANCE, 0.0)
        return [*(-float(part) for part in geom.get("solref").split()), d0, width, power]
    prefix = "{drake.mit.edu}" if suffix == ".sdf" else "{http://drake.mit.edu}"
    names = {
        "sdf": ("kp", "kd"),
        "drake": (f"{prefix}point_contact_stiffness", f"{prefix}hunt_crossley_dissipation"),
    }[engine]
    found = read_tags(text, *names)
    return found[:: len(found) // 2]  # both bodies of a world


def read_python(engine, text):
    tree = ast.parse(text)
    if engine == "pybullet":
        return list(ast.literal_eval(tree.body[-1].value).values())
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [
        call.args[0].value
        for name in ("SetKn", "SetGn")
        for call in calls
        if call.func.attr == name
    ]


def read_numbers(engine, suffix, text):
    if suffix in {".xml", ".sdf", ".urdf"}:
        return read_xml(engine, suffix, text)
    if suffix == ".py":
        return read_python(engine, text)
    if suffix == ".yaml":
        return list(yaml.safe_load(text)["default_proximity_properties"].values())
    names = ("STIFFNESS", "EXPONENT", "DAMPING", "DMAX")
    return [float(re.search(rf"^, {name}=(\S+)$", text, re.MULTILINE)[1]) for name in names]


@pytest.mark.parametrize(("engine", "suffix"), FORMATS)
def test_a_file_holds_the_parameters_what_was_measured_and_what_its_law_does_not_hold(
    find, engine, suffix
):
    contact = make_contact(duration_expanded=0.85e-6, restitution_expanded=0.0016)
    parameters = find(engine, replace(contact, sample=HOSTILE))
    text = format_text(parameters, suffix)
    wanted = [value.value for value in parameters.values.values()]
    assert read_numbers(engine, suffix, text) == pytest.approx(wanted, rel=1e-9)
    lines = text.splitlines()
    assert max(map(len, lines)) < 100
    text = " ".join(" ".join(line.lstrip("#! ") for line in lines).split())
    assert "contact duration 211.02 ± 0.85 µs" in text
    assert "restitution 0.9001 ± 0.0016" in text
    assert "Measured at 81.90 mm/s" in text
    assert "at 40.95 mm/s it gives" in text
    is_spring = engine in {"drake", "sdf", "pybullet"}
    assert ("exponent 1 in place of 1.5" in text) is is_spring


def test_a_contact_that_seems_to_gain_energy_is_said_to_be_elastic(find):
    contact = make_contact(damping=-0.2)
    assert contact.restitution == 1.0
    text = format_text(find("pybullet", contact), ".py")
    assert "a is below zero, which no contact of free bodies has" in text
    assert '"contactDamping": 0,' in text


def test_mujoco_loads_its_model(find, contact, need):
    need("mujoco")
    import mujoco

    model = mujoco.MjModel.from_xml_string(format_text(find("mujoco", contact), ".xml"))
    assert [model.body(name).mass[0] for name in ("hammer", "sample")] == [0.1, 0.10538]


def test_drake_loads_its_files(find, contact, need):
    need("drake")
    from pydrake.common.yaml import yaml_load_typed
    from pydrake.geometry import SceneGraphConfig
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    parameters = find("drake", contact)
    wanted = [value.value for value in parameters.values.values()]
    plant, scene = AddMultibodyPlantSceneGraph(DiagramBuilder(), 1e-3)
    (model,) = Parser(plant).AddModelsFromString(format_text(parameters, ".urdf"), "urdf")
    (shape,) = plant.GetCollisionGeometriesForBody(plant.GetBodyByName("body", model))
    properties = scene.model_inspector().GetProximityProperties(shape)
    names = ("point_contact_stiffness", "hunt_crossley_dissipation")
    found = [properties.GetProperty("material", name) for name in names]
    assert found == pytest.approx(wanted, rel=1e-9)
    config = yaml_load_typed(schema=SceneGraphConfig, data=format_text(parameters, ".yaml"))
    defaults = config.default_proximity_properties
    found = [defaults.point_stiffness, defaults.hunt_crossley_dissipation]
    assert found == pytest.approx(wanted, rel=1e-9)


def test_the_suffix_chooses_the_form():
    assert choose_suffix("drake", Path("x.YAML")) == ".yaml"
    with pytest.raises(ParameterError, match=r"x\.xml is no file of drake.*\.sdf or \.urdf"):
        choose_suffix("drake", Path("x.xml"))
    assert set(SUFFIXES) == set(ENGINES)
