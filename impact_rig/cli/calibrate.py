"""`impact-rig calibrate`: a sensor's sensitivity from hits, as lines for a rig file."""

import contextlib
import itertools
import math
from collections.abc import Generator, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import click
from rich.text import Text

from impact_rig.analysis.analyze import judge
from impact_rig.configuration.rig_file import RigFile, read_rig_file, read_today
from impact_rig.core.estimates.calibration import (
    FEWEST_HITS,
    Calibration,
    CalibrationMethod,
    HitFit,
    estimate_sensitivity,
    fit_hit,
)
from impact_rig.core.given.errors import DeviceError, FileError, ParameterError
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.session import Session
from impact_rig.devices.source_table import make_source
from impact_rig.present.console import (
    GOOD,
    make_console,
    print_item,
    print_table,
    print_text,
    print_warning,
)
from impact_rig.recordings.run import Run
from impact_rig.results.numbers import format_rounded, format_uncertain, is_dated
from impact_rig.results.tables import tabulate_budget

PERCENT = 100.0
MILLIVOLT = 1e3
MOST_DIGITS = 6  # decimals of a sensitivity whose uncertainty is 0 [-]
REVERSED = (
    "the traces have opposite signs: one of the sensors looks the other way; the sign of the"
    " sensitivity is kept"
)
LARGE_CHANGE = 0.03
"""Change of a sensitivity above which it is asked for the cause first [-], our choice: a sensor
drifts by a per cent or two in a year."""
READ_TIMEOUT = 0.5  # [s] of one read: so soon Ctrl-C works

HitSeries = tuple[RigSetup, list[JudgedHit]]
"""Masses and sensors with which hits were measured, and the hits in their order."""


def read_hits(path: Path, sample: str = "") -> HitSeries:
    """Read the hits of a recording, all or those on one sample.

    Raises
    ------
    FileError
        If it is no recording of a rig, holds no such hit, or was made with several set-ups.
    """
    setups: set[RigSetup] = set()
    hits: list[JudgedHit] = []
    for session, _, found in judge(Run(path).events()):
        setups.add(session.setup)
        hits += [hit for _, hit in found if not sample or hit.label.sample == sample]
    if not hits:
        struck = f" on {sample!r}" if sample else ""
        raise FileError(f"{path} holds no hit{struck}")
    if len(setups) > 1:
        raise FileError(
            f"{path} holds campaigns with different set-ups: name a recording with one set-up"
        )
    return setups.pop(), hits


def find_tested_sensor(setup: RigSetup, sheet: Sensor) -> Sensor:
    """Return the sensor that the hits were measured with, by default that of the rig file."""
    used = {sensor.channel: sensor for sensor in setup.sensors}.get(sheet.channel)
    if used is None or math.isnan(used.sensitivity):
        print_warning("the recording states no sensitivity: that of the rig file is taken")
        return sheet
    recorded, given = (
        f"{sensor.sensitivity * MILLIVOLT:.6g} mV per {sensor.unit}" for sensor in (used, sheet)
    )
    if recorded != given:
        print_warning(f"the hits were measured with {recorded}, and the rig file says {given}")
    return used


def strike_hits(rig: RigFile) -> Generator[JudgedHit]:
    """Yield hit after hit from the source of a rig; closing the generator closes the source.

    Raises
    ------
    RigError
        If the source cannot be opened, or is lost.
    """
    source, plan = make_source(rig.source, rig.setup)
    session = Session(rig.setup)
    name = rig.setup.samples.names[0]
    with contextlib.closing(source):
        source.configure(plan)
        for record in itertools.count(1):
            label = HitLabel(name, record, record)
            source.arm()
            is_whole = False
            while not is_whole:
                block = source.read(READ_TIMEOUT)
                if block is not None:  # else there was no hit yet
                    yield from session.feed(replace(block, label=label))
                    is_whole = block.last


def describe_fit(item: HitFit) -> str:
    """Return a hit's ratio and misfit, or why it is not used."""
    if item.flaw:
        return f"not used: {item.flaw}"
    return f"ratio {item.ratio:.5f}, misfit {PERCENT * item.misfit:.2g} %"


def describe_sensitivity(calibration: Calibration) -> str:
    """Return the new sensitivity with its expanded uncertainty, and what has changed."""
    sensor, ratio = calibration.sensor, calibration.ratio
    new, old = (value * MILLIVOLT for value in (calibration.sensitivity, sensor.sensitivity))
    shown = format_uncertain(new, abs(old) * ratio.expanded, MOST_DIGITS)
    change = format_uncertain(PERCENT * (ratio.value - 1.0), PERCENT * ratio.expanded, MOST_DIGITS)
    return f"{sensor.channel} sensor: {shown} mV per {sensor.unit} (95 %), {change} % on {old:.6g}"


def format_sheet(calibration: Calibration, day: str) -> str:
    """Return the lines of a rig file that state a calibration."""
    sensor, ratio = calibration.sensor, calibration.ratio
    unit = f"({sensor.unit})" if "/" in sensor.unit else sensor.unit
    expanded = abs(sensor.sensitivity) * ratio.expanded
    found = Quantity(calibration.sensitivity, expanded=expanded)
    rounded = format_rounded(found, MOST_DIGITS, MILLIVOLT)
    uncertainty = ratio.standard / abs(ratio.value)
    return (
        f"[source.{sensor.channel}]\n"
        f'sensitivity = "{rounded} mV/{unit}"\n'
        f"sensitivity_uncertainty = {uncertainty:.2g}\n"
        f"calibration_date = {day}\n"
    )


def question_change(calibration: Calibration, method: CalibrationMethod) -> str | None:
    """Return what to check before a large change is believed; None: it is small."""
    change = calibration.ratio.value - 1.0
    if abs(change) <= LARGE_CHANGE:
        return None
    checks = ["is the mount tight", f"is it the {calibration.sensor.channel} sensor that changed"]
    if method.has_known_mass:
        mass = 1e3 * method.known_mass
        checks.insert(0, f"is the known mass {mass:.6g} g with all that moves with it")
    return (
        f"a change of {PERCENT * change:+.2g} % is more than the {PERCENT * LARGE_CHANGE:g} % that"
        f" a sensor drifts by in a year: {', '.join(checks)}?"
    )


def print_calibration(
    calibration: Calibration, fits: Sequence[HitFit], sheet: str, question: str | None
) -> None:
    """Print the result first, then the hits, then the budget and the lines for the rig file."""
    console = make_console()
    console.print(Text(describe_sensitivity(calibration), style=GOOD))
    console.print()
    for fit in fits:
        print_item(console, f"{fit.label}: {describe_fit(fit)}")
    console.print()
    caption = "Uncertainty of the sensitivity"
    print_table(console, tabulate_budget(caption, calibration.ratio.budget, "%", PERCENT))
    condition = " only when that is settled" * (question is not None)
    print_text(console, f"Replace these lines of the rig file{condition}")
    console.print(sheet)


def _find_sheet(rig: RigFile, path: Path, channel: str) -> Sensor:
    for sensor in rig.setup.sensors:
        if sensor.channel == channel and not math.isnan(sensor.sensitivity):
            return sensor
    raise FileError(
        f"rig file {path}: [source.{channel}] has no sensitivity: give the one used so far,"
        ' for example sensitivity = "10 mV/g"'
    )


def _strike(rig: RigFile, method: CalibrationMethod, wanted: int) -> list[HitFit]:
    """Wait for enough good hits; Ctrl-C or a lost device ends the series and keeps its hits."""
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
    """Return the local date of the first hit."""
    stamp = min((item.stamp for item in fits), default=0)
    if not is_dated(stamp):
        return read_today()
    return datetime.fromtimestamp(stamp * 1e-9).astimezone().date().isoformat()


def run(
    rig_file: Path,
    known_mass: float | None,
    channel: str | None,
    reference_uncertainty: float,
    mass_uncertainty: float,
    recording: Path | None,
    sample: str,
    hits: int,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if mass_uncertainty and known_mass is None:
        raise ParameterError("--mass-uncertainty is for --known-mass")
    if sample and recording is None:
        raise ParameterError("--sample is for --recording")
    if channel is None:
        if known_mass is None:
            raise ParameterError("back to back, name the sensor under test with --sensor")
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
        if len(names) > 1:
            raise ParameterError(
                f"{recording} holds hits on {', '.join(names)}: choose by --sample the body of"
                " known mass, or that on which both sensors were mounted"
            )
        fits = _fit((setup, found), method)
    result = estimate_sensitivity(fits, method, setup, find_tested_sensor(setup, sheet))
    question = question_change(result, method)
    reversed_ = REVERSED if result.is_reversed else None
    for remark in filter(None, (question, reversed_, *result.remarks)):
        print_warning(remark)
    print_calibration(result, fits, format_sheet(result, _compute_day(fits)), question)
