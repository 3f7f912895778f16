"""From hits to a new rig file."""

import contextlib
import math
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import click

from impact_rig.cli.calibration.calibration_view import (
    calibration_to_json,
    describe_fit,
    print_calibration,
)
from impact_rig.cli.calibration.live_hits import strike_hits
from impact_rig.cli.calibration.recorded_hits import (
    HitSeries,
    check_one_body,
    find_tested_sensor,
    read_hits,
)
from impact_rig.configuration.calibration_warnings import find_today
from impact_rig.configuration.rig_file import RigFile, parse_rig_file, read_rig_file
from impact_rig.configuration.sheet_change import change_sheet, name_new_file
from impact_rig.core.calibration.sensitivity import (
    FEWEST_HITS,
    CalibrationMethod,
    estimate_sensitivity,
)
from impact_rig.core.calibration.trace_fit import HitFit, fit_hit
from impact_rig.core.errors import DeviceError, FileError, RigError
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.setup.sensors import Sensor
from impact_rig.recording.writing.new_file import write_new_file
from impact_rig.reporting.terminal.console import make_console, print_warning
from impact_rig.results.results_file import format_json

EARLIEST_STAMP = 631_152_000_000_000_000
"""1990-01-01 [ns since the epoch], our choice: what is older comes from a file without a date."""
REVERSED = (
    "the traces have opposite signs: one of the sensors looks the other way; the sign of the"
    " sensitivity is left as it was"
)


def calibrate(
    rig_file: Path,
    method: CalibrationMethod,
    *,
    recording: Path | None,
    sample: str,
    wanted: int,
    output: Path | None,
    as_json: bool,
) -> None:
    """Take hits, estimate, write the new rig file, and tell.

    Parameters
    ----------
    rig_file : Path
        The old one.
    method : CalibrationMethod
        What is compared with what.
    recording : Path, optional
        Where the hits are; None: they are struck now.
    sample : str
        Only the recording's hits on this sample; empty: all.
    wanted : int
        How many hits are struck.
    output : Path, optional
        The new file; None: beside the old one, with the day in its name.
    as_json : bool
        Tell in JSON.

    Raises
    ------
    RigError
        If a file cannot be read or written, the source fails, or the hits do not determine it.
    """
    rig = read_rig_file(rig_file)
    sheet = _find_sheet(rig, rig_file, method.channel)
    if recording is None:
        series, fits = _strike(rig, method, wanted)
    else:
        series = read_hits(recording, sample)
        if method.has_known_mass:
            check_one_body(series, recording)
        fits = _fit(series.hits, method, series)
    sensor, remark = find_tested_sensor(series, sheet)
    found = estimate_sensitivity(fits, method, series.setup, sensor)
    day = _find_day(fits)
    path = output or name_new_file(rig_file, day)
    _write(rig_file, path, change_sheet(_read(rig_file), sheet.channel, found.sensitivity, day))
    remarks = [text for text in (remark, REVERSED if found.is_reversed else "") if text]
    remarks += found.remarks
    if as_json:
        content = calibration_to_json(found, fits, remarks, str(path))
        click.echo(format_json(content), nl=False)
        return
    print_calibration(make_console(), found, fits, remarks)
    click.echo(f"written: {path}")


def _find_sheet(rig: RigFile, path: Path, channel: str) -> Sensor:
    for sensor in rig.setup.sensors:
        if sensor.channel == channel and not math.isnan(sensor.sensitivity):
            return sensor
    raise FileError(
        f"rig file {path}: [source.{channel}] has no sensitivity: give the one that was used so"
        ' far, for example sensitivity = "10 mV/g"'
    )


def _strike(
    rig: RigFile, method: CalibrationMethod, wanted: int
) -> tuple[HitSeries, list[HitFit]]:
    """Let the operator strike until enough hits can be used; what ends it before keeps them."""
    hits: list[JudgedHit] = []
    fits: list[HitFit] = []
    used = 0
    click.echo(f"Strike {wanted} times; Ctrl-C ends before.", err=True)
    with contextlib.closing(strike_hits(rig)) as struck, contextlib.suppress(KeyboardInterrupt):
        try:
            for hit in struck:
                hits.append(hit)
                fits += _fit([hit], method, HitSeries(rig.setup, ()))
                used = sum(not item.flaw for item in fits)
                click.echo(f"{used} of {wanted}: {describe_fit(fits[-1])}", err=True)
                if used >= wanted:
                    break
        except DeviceError as error:
            if used < FEWEST_HITS:
                raise
            print_warning(f"{error}; the {used} hits before that are kept")
    return HitSeries(rig.setup, tuple(hits)), fits


def _fit(hits: Sequence[JudgedHit], method: CalibrationMethod, series: HitSeries) -> list[HitFit]:
    factor = method.find_factor(series.setup)
    return [fit_hit(hit, method.channel, factor) for hit in hits]


def _find_day(fits: Sequence[HitFit]) -> str:
    """Return the day on which the hits were struck, here."""
    stamp = min((item.stamp for item in fits), default=0)
    if stamp < EARLIEST_STAMP:
        return find_today()
    return datetime.fromtimestamp(stamp * 1e-9).astimezone().date().isoformat()


def _read(path: Path) -> str:
    return path.read_bytes().decode("utf-8-sig")


def _write(old: Path, path: Path, text: str) -> None:
    """Write the new file, which a rig must be able to read, in the old one's encoding."""
    try:
        parse_rig_file(text.replace("\r\n", "\n"))
    except RigError as error:
        raise FileError(f"the new rig file could not be read again: {error}") from None
    mark = b"\xef\xbb\xbf" if old.read_bytes().startswith(b"\xef\xbb\xbf") else b""
    with write_new_file(path) as part:
        part.write_bytes(mark + text.encode("utf-8"))
