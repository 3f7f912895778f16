"""`impact-rig calibrate`: a sensor's sensitivity from hits, in a new rig file."""

import contextlib
import dataclasses
import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from impact_rig.configuration.rig_file import RigFile, parse_rig_file, read_rig_file, read_today
from impact_rig.configuration.sheet_change import change_sheet, name_new_file
from impact_rig.core.calibration import (
    FEWEST_HITS,
    Calibration,
    CalibrationMethod,
    HitFit,
    TraceFit,
    estimate_sensitivity,
    fit_hit,
)
from impact_rig.core.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.core.hits import JudgedHit, describe_label
from impact_rig.core.records import Block, HitLabel
from impact_rig.core.sensors import CHANNELS, Sensor, compute_scale
from impact_rig.core.session import Session
from impact_rig.core.setup import RigSetup
from impact_rig.devices.protocols import AccelerationSource, HammerlessSource
from impact_rig.devices.source_table import make_source
from impact_rig.present.terminal.console import (
    ALARM,
    GOOD,
    make_console,
    print_table,
    print_text,
    print_warning,
)
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.reader import read_recording
from impact_rig.results.numbers import format_number
from impact_rig.results.results_file import format_json
from impact_rig.results.tables import Column
from impact_rig.results.wire import to_json

HitSeries = tuple[RigSetup, list[JudgedHit]]
"""Masses and sensors with which hits were measured, and the hits in their order."""


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
    sessions: list[Session] = []
    hits: list[JudgedHit] = []
    for event in read_recording(path).events():
        if not isinstance(event, Block):
            sessions.append(Session(event))
        elif not sample or event.label.sample == sample:
            hits += sessions[-1].feed(event)
    if not hits:
        struck = f" on {sample!r}" if sample else ""
        raise FileError(f"{path} holds no hit{struck}")
    setups = [session.setup for session in sessions]
    if len({(setup.hammer_mass, _describe(setup)) for setup in setups}) > 1:
        raise FileError(
            f"{path} holds campaigns with different hammers or sensors: give one that holds one"
        )
    return setups[-1], hits


def find_tested_sensor(setup: RigSetup, sheet: Sensor) -> tuple[Sensor, str]:
    """Return the sensor under test as the hits were measured with it, in the unit of its sheet.

    Parameters
    ----------
    setup : RigSetup
        Of the hits.
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
    known = {sensor.channel: sensor for sensor in setup.sensors}
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
    scale = compute_scale(sheet.unit, 1.0) / compute_scale(used.unit, 1.0)
    sensor = replace(sheet, sensitivity=used.sensitivity * scale)
    if math.isclose(sensor.sensitivity, sheet.sensitivity, rel_tol=1e-9):
        return sheet, ""
    return sensor, (
        f"the hits were measured with {sensor.sensitivity * 1e3:.6g} mV per {sheet.unit}, and the"
        f" rig file says {sheet.sensitivity * 1e3:.6g}"
    )


def _describe(setup: RigSetup) -> tuple[str, ...]:
    return tuple(sensor.describe() for sensor in setup.sensors)


LOOK_PERIOD = 0.5
"""Period of checks for an interruption while waiting for a hit [s], our choice."""


def strike_hits(rig: RigFile) -> Generator[JudgedHit]:
    """Yield hit after hit; closing the generator closes the source.

    Parameters
    ----------
    rig : RigFile
        Its source is opened, its holder is not.

    Raises
    ------
    RigError
        If the source cannot be opened, or is lost.
    """
    source, plan = make_source(rig.source, rig.setup)
    session = Session(rig.setup)
    name, record = rig.setup.samples.names[0], 0
    try:
        source.configure(plan)
        if isinstance(source, HammerlessSource):
            source.take_setup(rig.setup)
        while True:
            record += 1
            label = HitLabel(name, record, record)
            source.arm()
            if isinstance(source, HammerlessSource):
                source.strike(label, 0.0)
            for block in _read_record(source, label):
                yield from session.feed(block)
    finally:
        source.close()


def _read_record(source: AccelerationSource, label: HitLabel) -> Iterator[Block]:
    """Yield the blocks of one record; waits for the hit without a time limit."""
    while True:
        block = source.read(LOOK_PERIOD)
        if block is None:
            continue
        yield replace(block, label=label)
        if block.last:
            return


PERCENT = 100.0
MILLIVOLT = 1e3
NO_FIT = TraceFit(math.nan, math.nan, math.nan)
EXPLANATION = (
    "Ratio: of the trace under test over what it should be. Misfit: RMS of what the line leaves,"
    " of the trace. Linearity: the largest deviation, of the peak."
)


def describe_fit(item: HitFit) -> str:
    """Return in a few words what a hit has given."""
    if item.flaw or item.fit is None:
        return f"not used: {item.flaw}"
    return f"ratio {item.fit.ratio:.5f}, misfit {PERCENT * item.fit.misfit:.2g} %"


def describe_sensitivity(calibration: Calibration) -> str:
    """Return the new sensitivity with its expanded uncertainty, and what has changed."""
    sensor, ratio = calibration.sensor, calibration.ratio
    new, old = (value * MILLIVOLT for value in (calibration.sensitivity, sensor.sensitivity))
    return (
        f"{sensor.channel} sensor: {new:.6g} mV per {sensor.unit}"
        f" ± {abs(old) * ratio.expanded:.2g} (95 %), {PERCENT * (ratio.value - 1.0):+.3g} % on"
        f" {old:.6g}"
    )


def print_calibration(
    console: Console, calibration: Calibration, fits: Sequence[HitFit], remarks: Sequence[str]
) -> None:
    """Print the result first, then the hits, then where the uncertainty comes from."""
    console.print(Text(describe_sensitivity(calibration), style=GOOD))
    console.print()
    _print_hits(console, fits)
    budget = calibration.ratio.budget
    columns = [
        Column("Source", [line.source for line in budget], is_text=True),
        Column("Type", [line.kind for line in budget], is_text=True),
        Column("u [%]", [f"{PERCENT * line.contribution:.2g}" for line in budget]),
        Column("Share [%]", [f"{PERCENT * line.share:.1f}" for line in budget]),
    ]
    print_table(console, "Where its uncertainty comes from", columns)
    for text in remarks:
        print_text(console, Text.assemble(("warning: ", ALARM), text))


def _print_hits(console: Console, fits: Sequence[HitFit]) -> None:
    values = [item.fit or NO_FIT for item in fits]
    columns = [
        Column("Hit", [describe_label(item.label) for item in fits], is_text=True),
        Column("Ratio", [format_number(fit.ratio, 5) for fit in values]),
        Column("Misfit [%]", [format_number(PERCENT * fit.misfit, 2) for fit in values]),
        Column("Linearity [%]", [format_number(PERCENT * fit.linearity, 2) for fit in values]),
    ]
    if any(item.flaw for item in fits):
        columns.append(Column("Not used", [item.flaw for item in fits], is_text=True))
    print_table(console, f"Hits: {len(fits)}", columns, [EXPLANATION])


def calibration_to_json(
    calibration: Calibration, fits: Sequence[HitFit], remarks: Sequence[str], file: str
) -> dict[str, Any]:
    """Return the same as plain values."""
    return {
        "file": file,
        "channel": calibration.sensor.channel,
        "unit": calibration.sensor.unit,
        "sensitivity_v_per_unit": calibration.sensitivity,
        "sensitivity_before_v_per_unit": calibration.sensor.sensitivity,
        "ratio": calibration.ratio.value,
        "uncertainty_of_ratio": {
            name: value for name, value in to_json(calibration.ratio).items() if name != "value"
        },
        "hits_used": calibration.hits,
        "hits": [
            {
                "hit": describe_label(item.label),
                **(dataclasses.asdict(item.fit) if item.fit else {}),
                "flaw": item.flaw,
            }
            for item in fits
        ],
        "warnings": list(remarks),
    }


EARLIEST_STAMP = 631_152_000_000_000_000
"""1990-01-01 [ns since the epoch], our choice: what is older comes from a file without a date."""
REVERSED = (
    "the traces have opposite signs: one of the sensors looks the other way; the sign of the"
    " sensitivity is left as it was"
)


def _find_sheet(rig: RigFile, path: Path, channel: str) -> Sensor:
    for sensor in rig.setup.sensors:
        if sensor.channel == channel and not math.isnan(sensor.sensitivity):
            return sensor
    raise FileError(
        f"rig file {path}: [source.{channel}] has no sensitivity: give the one that was used so"
        ' far, for example sensitivity = "10 mV/g"'
    )


def _strike(rig: RigFile, method: CalibrationMethod, wanted: int) -> list[HitFit]:
    """Let the operator strike until enough hits can be used; what ends it before keeps them."""
    fits: list[HitFit] = []
    used = 0
    click.echo(f"Strike {wanted} times; Ctrl-C ends before.", err=True)
    with contextlib.closing(strike_hits(rig)) as struck, contextlib.suppress(KeyboardInterrupt):
        try:
            for hit in struck:
                fits += _fit((rig.setup, [hit]), method)
                used = sum(not item.flaw for item in fits)
                click.echo(f"{used} of {wanted}: {describe_fit(fits[-1])}", err=True)
                if used >= wanted:
                    break
        except DeviceError as error:
            if used < FEWEST_HITS:
                raise
            print_warning(f"{error}; the {used} hits before that are kept")
    return fits


def _fit(series: HitSeries, method: CalibrationMethod) -> list[HitFit]:
    setup, hits = series
    factor = method.compute_factor(setup)
    return [fit_hit(hit, method.channel, factor) for hit in hits]


def _compute_day(fits: Sequence[HitFit]) -> str:
    """Return the day on which the hits were struck, here."""
    stamp = min((item.stamp for item in fits), default=0)
    if stamp < EARLIEST_STAMP:
        return read_today()
    return datetime.fromtimestamp(stamp * 1e-9).astimezone().date().isoformat()


def _write(old: Path, path: Path, text: str) -> None:
    """Write the new file, which a rig must be able to read, in the old one's encoding."""
    try:
        parse_rig_file(text.replace("\r\n", "\n"))
    except RigError as error:
        raise FileError(f"the new rig file could not be read again: {error}") from None
    mark = b"\xef\xbb\xbf" if old.read_bytes().startswith(b"\xef\xbb\xbf") else b""
    with write_new_file(path) as part:
        part.write_bytes(mark + text.encode("utf-8"))


def run(
    rig_file: Path,
    back_to_back: bool,
    known_mass: float | None,
    channel: str | None,
    reference_uncertainty: float,
    mass_uncertainty: float,
    recording: Path | None,
    sample: str,
    hits: int,
    output: Path | None,
    as_json: bool,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if back_to_back == (known_mass is not None):
        raise ParameterError("choose one of --back-to-back and --known-mass MASS")
    if mass_uncertainty and known_mass is None:
        raise ParameterError("--mass-uncertainty is for --known-mass")
    if sample and recording is None:
        raise ParameterError("--sample is for --recording")
    if channel is None:
        if back_to_back:
            raise ParameterError("--back-to-back needs --sensor: the one under test")
        channel = CHANNELS[0]
    mass = math.nan if known_mass is None else known_mass
    method = CalibrationMethod(channel, mass, mass_uncertainty, reference_uncertainty)
    rig = read_rig_file(rig_file)
    setup, sheet = rig.setup, _find_sheet(rig, rig_file, channel)
    if recording is None:
        fits = _strike(rig, method, hits)
    else:
        setup, found = read_hits(recording, sample)
        names = dict.fromkeys(hit.label.sample for hit in found)
        if method.has_known_mass and len(names) > 1:
            raise ParameterError(
                f"{recording} holds hits on {', '.join(names)}: choose the body of known mass by"
                " --sample"
            )
        fits = _fit((setup, found), method)
    sensor, remark = find_tested_sensor(setup, sheet)
    result = estimate_sensitivity(fits, method, setup, sensor)
    day = _compute_day(fits)
    path = output or name_new_file(rig_file, day)
    text = rig_file.read_bytes().decode("utf-8-sig")
    _write(rig_file, path, change_sheet(text, sheet.channel, result.sensitivity, day))
    remarks = [text for text in (remark, REVERSED if result.is_reversed else "") if text]
    remarks += result.remarks
    if as_json:
        content = calibration_to_json(result, fits, remarks, str(path))
        click.echo(format_json(content), nl=False)
        return
    print_calibration(make_console(), result, fits, remarks)
    click.echo(f"written: {path}")
