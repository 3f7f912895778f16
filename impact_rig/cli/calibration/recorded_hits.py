"""The hits of a recording, for a calibration."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.setup.calibration import find_scale
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block
from impact_rig.recording.reading.mcap_reader import read_recording
from impact_rig.recording.reading.source import find_recording


@dataclass(frozen=True)
class HitSeries:
    """Hits, and with what they were measured.

    Attributes
    ----------
    setup : RigSetup
        Masses and sensors.
    hits : tuple of JudgedHit
        In their order.
    """

    setup: RigSetup
    hits: tuple[JudgedHit, ...]


def read_hits(path: Path, sample: str = "") -> HitSeries:
    """Read the hits of a recording.

    Parameters
    ----------
    path : Path
        A file, or the folder of a run.
    sample : str
        Only the hits on this sample; empty: all.

    Raises
    ------
    FileError
        If it is no recording of a rig, holds no such hit, or was made with several set-ups.
    """
    recording = read_recording(find_recording(path) if path.is_dir() else path)
    setups: list[RigSetup] = []
    hits: list[JudgedHit] = []
    for event in recording.events():
        if not isinstance(event, Block):
            setups.append(event)
            detector = ImpactDetector(event.analysis)
        elif not sample or event.label.sample == sample:
            hits += [judge_hit(record, setups[-1].analysis) for record in detector.feed(event)]
    if not hits:
        struck = f" on {sample!r}" if sample else ""
        raise FileError(f"{path} holds no hit{struck}")
    if len({(setup.hammer_mass, _describe(setup)) for setup in setups}) > 1:
        raise FileError(
            f"{path} holds campaigns with different hammers or sensors: give one that holds one"
        )
    return HitSeries(setups[-1], tuple(hits))


def check_one_body(series: HitSeries, path: Path) -> None:
    """Require hits on one sample, whose mass is known.

    Raises
    ------
    ParameterError
        If there are several.
    """
    names = dict.fromkeys(hit.label.sample for hit in series.hits)
    if len(names) > 1:
        raise ParameterError(
            f"{path} holds hits on {', '.join(names)}: choose the body of known mass by --sample"
        )


def find_tested_sensor(series: HitSeries, sheet: Sensor) -> tuple[Sensor, str]:
    """Return the sensor under test as the hits were measured with it, in the unit of its sheet.

    Parameters
    ----------
    series : HitSeries
        The hits.
    sheet : Sensor
        As the rig file has it.

    Returns
    -------
    sensor : Sensor
        With the sensitivity that the traces were made with.
    remark : str
        What is to be said of it; empty: nothing.

    Raises
    ------
    ParameterError
        If the hits were measured with a sensor of another quantity.
    """
    known = {sensor.channel: sensor for sensor in series.setup.sensors}
    used = known.get(sheet.channel)
    if used is None or math.isnan(used.sensitivity):
        return sheet, (
            "the recording does not say with which sensitivity it was made: that of the rig file"
            " is taken"
        )
    if used.quantity != sheet.quantity:
        raise ParameterError(
            f"the hits were measured with a sensor of {used.quantity}, and the rig file has one of"
            f" {sheet.quantity}: give the rig file that they were measured with"
        )
    # Of a force, the mass that it acts on cancels out.
    scale = find_scale(sheet.unit, 1.0) / find_scale(used.unit, 1.0)
    sensor = replace(sheet, sensitivity=used.sensitivity * scale)
    if math.isclose(sensor.sensitivity, sheet.sensitivity, rel_tol=1e-9):
        return sheet, ""
    return sensor, (
        f"the hits were measured with {sensor.sensitivity * 1e3:.6g} mV per {sheet.unit}, and the"
        f" rig file says {sheet.sensitivity * 1e3:.6g}"
    )


def _describe(setup: RigSetup) -> tuple[str, ...]:
    return tuple(sensor.describe() for sensor in setup.sensors)
