"""Text as instruments write it: the same pulse, found in each of their ways to put it down.

Each file is written here line by line as the document says that is named with it: a manual, a file
that such an instrument saved and its user published (GitHub repository, path), or programs that
read them. Of these files the layout is taken, not the numbers.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.sensors import Sensitivity
from impact_rig.files.channels import map_channels
from impact_rig.files.formats.registry import read_measurement
from impact_rig.files.plan import ChannelPlan, ChannelUse

COUNT, RATE, START = 400, 1e6, -100e-6
TIME = START + np.arange(COUNT) / RATE
PULSE = np.round(2.5 * np.exp(-(((TIME - 80e-6) / 40e-6) ** 2)), 4)
Pairs = Sequence[tuple[float, float]]
PAIRS: Pairs = list(zip(TIME.tolist(), PULSE.tolist(), strict=True))


def write_tektronix_tds(pairs: Pairs) -> Iterator[str]:
    """TDS, TBS: settings beside the first rows.

    Mihai-Ziu/PHGN215_SP26, F0000CH1.CSV: TBS1052B-EDU.
    """
    beside = [
        "Record Length,2.500000e+03", f"Sample Interval,{1 / RATE:.6e}",
        "Trigger Point,1.240000000000e+03", ",", ",", ",", "Source,CH1", "Vertical Units,V",
        "Vertical Scale,5.000000e-01", "Vertical Offset,0.000000e+00", "Horizontal Units,s",
        "Horizontal Scale,5.000000e-05", "Pt Fmt,Y", "Yzero,0.000000e+00",
        "Probe Atten,1.000000e+00", "Model Number,TBS1052B-EDU", "Serial Number,C000000",
        "Firmware Version,FV:v4.06",
    ]  # fmt: skip
    for number, (time, value) in enumerate(pairs):
        yield f"{beside[number] if number < len(beside) else ','},,{time:016.12f},{value:10.5f},"


def write_tektronix_mso(pairs: Pairs) -> Iterator[str]:
    """MSO, DPO: settings above, names last.

    FractionalIntuition/BEE331_Lab_4, tek0000.csv: MSO3012.
    """
    yield from ("Model,MSO3012", "Firmware Version,2.40", "", "Waveform Type,ANALOG,")
    yield from ("Point Format,Y,", "Horizontal Units,s,", "Horizontal Scale,4e-05,")
    yield from ("Horizontal Delay,0,", f"Sample Interval,{1 / RATE:g},", f"Record Length,{COUNT},")
    yield from ("Gating,0.0% to 100.0%,", "Probe Attenuation,1,", "Vertical Units,V,")
    yield from ("Vertical Offset,0,", "Vertical Scale,0.5,", ",,", ",,", "Label,,", "TIME,CH1")
    yield from (f"{time:.4e},{value:.6g}" for time, value in pairs)


def write_rigol(pairs: Pairs) -> Iterator[str]:
    """DS1000Z, MSO1000Z: points are counted; start and increment stand in the heading.

    Quoted alike by many programs that read them, among them one for a DS1054Z.
    """
    yield from ("X,CH1,Start,Increment,", f"Sequence,Volt,{START:.6e},{1 / RATE:.6e}")
    yield from (f"{number},{value:.2e}," for number, (_, value) in enumerate(pairs))


def write_rigol_steps(pairs: Pairs) -> Iterator[str]:
    """DHO, MSO5000, "Save Memory": start and step beside the name, as a program quotes it."""
    yield f"CH1(V),t0 = {START}s, tInc = {1 / RATE}s,"
    yield from (f"{value:.5f}" for _, value in pairs)


def write_keysight(pairs: Pairs) -> Iterator[str]:
    """InfiniiVision: channels are called by numbers (HCui91/Scope_plot, scope_0.csv)."""
    yield from ("x-axis,1", "second,Volt")
    yield from (f"{time * 1e6:+.2f}E-06,{value * 1e3:+.5f}E-03" for time, value in pairs)


def write_lecroy(pairs: Pairs) -> Iterator[str]:
    """WaveRunner, HDO, MAUI: five lines without a unit, as programs quote them that read them."""
    yield from ("LECROYHDO9404,30152,Waveform", "Segments,1,SegmentSize,402")
    yield from ("Segment,TrigTime,TimeSinceSegment1", "#1,28-Dec-2020 13:34:10,0   ", "Time,Ampl")
    yield from (f"{time:.6g},{value}" for time, value in pairs)


def write_siglent(pairs: Pairs) -> Iterator[str]:
    """SDS1000X-E: settings by channel, a unit of times that is of the screen.

    evanmoring/siglent_utils, SDS00001.csv: SDS1202X-E.
    """
    yield from (f"Record Length,Analog:{COUNT}", f"Sample Interval,CH1:{1 / RATE:.13f}")
    yield from (
        "Vertical Units,CH1:V,,,",
        "Vertical Scale,CH1:0.50,,,",
        "Vertical Offset,CH1:0.00",
    )
    yield from ("Horizontal Units,us,,,", "Horizontal Scale,20000.0000000000,,,")
    yield from ("Model Number,SDS1202X-E,,,", "Software Version,1.3.26,,,", "Source,CH1")
    yield "Second,Volt"
    yield from (f"{time: .11f},{value:.5f}" for time, value in pairs)


def write_siglent_rate(pairs: Pairs) -> Iterator[str]:
    """SDS1104X-E of older software: a rate, no name (MartinCowen/SigFyCSV, README)."""
    yield from (f"Record Length,Analog:{COUNT}", f"Sample Rate,{RATE}", "Vertical Scale,CH1: 0.05")
    yield from ("Vertical Offset,CH1:0.00000", "Horizontal Scale, 0.000010000", "Second,Volt")
    yield from (f"{time:.11f},{value:.5f}" for time, value in pairs)


def write_rohde_schwarz(pairs: Pairs) -> Iterator[str]:
    """RTB, RTM: units and names in words (RTM20 user manual, "CSV"; programs quote it)."""
    yield "in s,C1 in V"
    yield from (f"{time:.7E},{value:.7E}" for time, value in pairs)


def write_picoscope(pairs: Pairs) -> Iterator[str]:
    """PicoScope 6: units in brackets, times in what suits them (User's Guide, "Text formats")."""
    yield from ("Time,Channel A", "(µs),(V)", "")
    yield from (f"{time * 1e6:.8f},{value:.8f}" for time, value in pairs)


def write_digilent(pairs: Pairs) -> Iterator[str]:
    """WaveForms: settings as comments, as the importer of ngscopeclient reads them."""
    yield from ("#Digilent WaveForms Oscilloscope Acquisition", "#Device Name: Discovery2")
    yield from ("#Serial Number: SN:000000000000", "#Date Time: 2026-09-28 00:00:00.000.000.000")
    yield from (f"#Sample rate: {RATE:g}Hz", f"#Samples: {COUNT}", "")
    yield "Time (s),Channel 1 (V)"
    yield from (f"{time:.9g},{value:.9g}" for time, value in pairs)


def write_quoted_rows(pairs: Pairs) -> Iterator[str]:
    """Every row in one pair of quotes, as spreadsheets do with what they took for one cell."""
    yield '"Time (s),Force (V)"'
    yield from (f'"{time:.7f},{value}"' for time, value in pairs)


def write_labview_without_header(pairs: Pairs) -> Iterator[str]:
    """LabVIEW, "Write Delimited Spreadsheet" into a file called .lvm: tabs and numbers alone."""
    yield from (f"{time:.6f}\t{value:.6f}" for time, value in pairs)


def write_dates(pairs: Pairs) -> Iterator[str]:
    """Loggers: a date and a clock before time and value."""
    yield "Date,Clock,Time (s),Force (V)"
    yield from (
        f"2026-11-22,16:37:{index % 60:02},{t:.7f},{v}" for index, (t, v) in enumerate(pairs)
    )


DIALECTS = {
    "tektronix_tds.csv": write_tektronix_tds,
    "tektronix_mso.csv": write_tektronix_mso,
    "rigol.csv": write_rigol,
    "rigol_steps.csv": write_rigol_steps,
    "keysight.csv": write_keysight,
    "lecroy.csv": write_lecroy,
    "siglent.csv": write_siglent,
    "siglent_rate.csv": write_siglent_rate,
    "rohde_schwarz.csv": write_rohde_schwarz,
    "picoscope.csv": write_picoscope,
    "digilent.csv": write_digilent,
    "quoted_rows.csv": write_quoted_rows,
    "labview.lvm": write_labview_without_header,
}
UNSTATED = ("lecroy.csv", "labview.lvm")
"""Files that do not state the unit."""
COARSE = {"rigol.csv": 0.005}
"""Files that give fewer digits [V]."""
SENSOR = ChannelUse(sensitivity=Sensitivity(0.01, "m/s^2"))


def save(folder: Path, name: str, lines: Iterator[str]) -> Path:
    path = folder / name
    path.write_text("\r\n".join(lines) + "\r\n", encoding="utf-8", newline="")
    return path


@pytest.mark.parametrize("name", DIALECTS)
def test_every_point_is_found_with_its_time_and_unit(tmp_path, name):
    file = read_measurement(save(tmp_path, name, DIALECTS[name](PAIRS)))
    assert file.channels[-1].unit == ("" if name in UNSTATED else "V")
    (found,) = map_channels(file, ChannelPlan(SENSOR))
    assert found.block.sampling_rate == pytest.approx(RATE, rel=1e-6)
    # 10 mV for a m/s².
    np.testing.assert_allclose(found.block.hammer.output, PULSE, atol=COARSE.get(name, 1e-5))
    assert found.block.hammer.scale == pytest.approx(100.0)


def test_columns_of_words_are_skipped(tmp_path):
    file = read_measurement(save(tmp_path, "logger.csv", write_dates(PAIRS)))
    assert [channel.name for channel in file.channels] == ["Date", "Clock", "Time", "Force"]
    skipped = ChannelPlan(SENSOR, columns=("skip", "skip", "time", "hammer"))
    np.testing.assert_allclose(
        map_channels(file, skipped)[0].block.hammer.output, PULSE, atol=1e-5
    )
    used = ChannelPlan(SENSOR, columns=("time", "skip", "skip", "hammer"))
    with pytest.raises(SignalError, match=r"line 2: '2026-11-22' is no number.*give --rate"):
        map_channels(file, used)


@pytest.mark.parametrize(
    ("stated", "rate"),
    [
        ("Abtastrate: 25,6 kHz", 25.6e3),
        ("Sampling rate [kS/s];51,2", 51.2e3),
        ("dt;1,953125E-05", 51.2e3),
        ("Sample rate;51200,0 Hz", 51.2e3),
        # Thousands or decimals: it is asked.
        ("Sample rate: 51,200 Hz", None),
        ("Sample rate: 51 200 Hz", None),
    ],
)
def test_a_stated_rate_is_read_whole_or_asked_for(tmp_path, stated, rate):
    path = tmp_path / "hit.csv"
    rows = [f"{number % 7},5;{number % 5},25" for number in range(60)]
    path.write_text("\n".join([stated, "Kraft [N];Beschl [g]", *rows]))
    (first, *_) = read_measurement(path).channels
    assert first.sampling_rate == pytest.approx(rate or np.nan, nan_ok=True)
