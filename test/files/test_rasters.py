"""Text whose rows are not the points of one trace, or whose words are easily misread."""

from pathlib import Path

import numpy as np
import pytest
from pyuff import UFF

from impact_rig.core.given.sensors import STANDARD_GRAVITY
from impact_rig.files.channels import map_channels
from impact_rig.files.formats.registry import read_measurement
from impact_rig.files.plan import ChannelPlan

from .formats.foreign import make_function
from .test_strangers import FORCE, MOVED, RIGHT, TIME, read

SHORT = slice(0, 1024)
ROWS = np.column_stack((TIME, FORCE, MOVED))[SHORT]
HEADING = "time [s],hammer [N],acc [g]"


def write(path: Path, rows, heading=HEADING, delimiter=","):
    np.savetxt(path, rows, "%.9f", delimiter, header=heading, comments="")
    return path


def read_block(path, hammer_mass=0.1):
    """Return the remarks of a file with one hit, and its block."""
    hits = map_channels(read_measurement(path), ChannelPlan(), hammer_mass)
    return [remark for hit in hits for remark in hit.remarks], [hit.block for hit in hits]


def test_records_one_below_the_other_are_a_hit_each_also_with_their_headings_again(tmp_path):
    path = write(tmp_path / "hit.csv", np.vstack((ROWS, ROWS)))
    found, taken = read(path)
    assert found == pytest.approx([RIGHT, RIGHT], rel=1e-3)
    assert taken.endswith("sample 'acc (segment 1)' [g] (and 1 hit alike)")
    text = write(tmp_path / "one.csv", ROWS).read_text()
    path.write_text(f"{text}\n{text}")
    assert read(path)[0] == found


@pytest.mark.parametrize("often", [2, 4])
def test_values_that_are_held_are_taken_once(tmp_path, often):
    rows = np.repeat(ROWS, often, axis=0)[1:]  # the first one stands once less
    rows[:, 0] = TIME[0] + np.arange(len(rows)) / (51200.0 * often)
    (found,), _ = read(write(tmp_path / "hit.csv", rows))
    assert found == pytest.approx(RIGHT, rel=1e-3)


def test_values_that_are_held_unequally_are_refused_as_that(tmp_path):
    rows = ROWS[(np.arange(2560) / 2.5).astype(int)]
    rows[:, 0] = np.arange(2560) / 128e3
    with pytest.raises(ValueError, match="exported onto another raster than it was measured on"):
        read(write(tmp_path / "hit.csv", rows))
    # Counts of a slow signal stand for several points, too, and are measured.
    smooth = np.round(20.0 * np.sin(np.linspace(0.0, np.pi, 1024)) ** 8)
    rows = np.column_stack((TIME[SHORT] / 10.0, smooth))
    assert len(read(write(tmp_path / "counts.csv", rows, "time [s],hammer [N]"))[0]) == 1


@pytest.mark.parametrize(("is_envelope", "told"), [(True, "envelope"), (False, "give --rate")])
def test_pairs_of_equal_times_are_an_envelope_if_the_lower_value_is_always_first(
    tmp_path, is_envelope, told
):
    rows = ROWS.copy()
    rows[:, 0] = np.repeat(TIME[:1024:2], 2)
    if is_envelope:
        rows[:, 1] = np.sort(rows[:, 1].reshape(-1, 2), axis=1).ravel()
    with pytest.raises(ValueError, match=told) as refusal:
        read(write(tmp_path / "hit.csv", rows))
    assert ("--rate" in str(refusal.value)) is not is_envelope


@pytest.mark.parametrize(
    ("scale", "delay", "is_read"),
    [(1.0, 0.0, True), (1.0, 0.9e-6, True), (1.0, 1.1e-6, False), (2.0, 0.0, False)],
)
def test_two_columns_of_times_are_those_of_one_trace_or_refused(tmp_path, scale, delay, is_read):
    rows = np.column_stack((ROWS[:, :2], scale * ROWS[:, 0] + delay, ROWS[:, 2]))
    path = write(tmp_path / "hit.csv", rows, "X1 (s),Hammer (N),X2 (s),Acc (g)")
    if is_read:
        assert read(path)[0] == pytest.approx([RIGHT], rel=1e-3)
        return
    with pytest.raises(ValueError, match="has times in 'X1' and others in 'X2'"):
        read(path)


def test_times_of_the_day_may_stand_beside_those_of_the_record(tmp_path):
    rows = np.column_stack((ROWS[:, 0], ROWS[:, 0] + 1e4, ROWS[:, 1:]))
    path = write(tmp_path / "hit.csv", rows, "time [s],clock [s],hammer [N],acc [g]")
    assert read(path)[0] == pytest.approx([RIGHT], rel=1e-3)


@pytest.mark.parametrize(
    ("width", "is_read"), [(2.1e-6, True), (1.9e-6, False)], ids=["possible", "too short"]
)
def test_a_unit_of_time_that_cannot_be_is_named_with_the_file(tmp_path, width, is_read):
    # The half-sine is 34 or 35 points wide at half its height.
    rows = ROWS.copy()
    rows[:, 0] = 1e6 * np.arange(1024) * width / 34.5
    path = write(tmp_path / "hit.csv", rows, "time (us),hammer (N),acc (g)")
    if is_read:
        assert len(read(path)[0]) == 1
        return
    with pytest.raises(ValueError, match=r"hit.csv: its times are in us.* no contact is that"):
        read(path)


UNITS = {
    "mg": 1e3 / STANDARD_GRAVITY, "µg": 1e6 / STANDARD_GRAVITY, "in/s²": 1 / 0.0254, "Gal": 100.0,
    "ft/s^2": 1 / 0.3048, "cm/sec^2": 100.0, "mm/s2": 1e3,
}  # fmt: skip


@pytest.mark.parametrize(("unit", "scale"), UNITS.items())
def test_accelerations_are_read_in_any_unit_of_them(tmp_path, unit, scale):
    path = write(tmp_path / "hit.csv", ROWS, f"time [s],hammer [N],acc [{unit}]")
    _, (hit,) = read_block(path)
    assert hit.specimen.scale * scale == pytest.approx(1.0)


@pytest.mark.parametrize(("unit", "newton"), [("dyn", 1e-5), ("ozf", 0.2780138509), ("mN", 1e-3)])
def test_forces_are_read_in_any_unit_of_them(tmp_path, unit, newton):
    path = write(tmp_path / "hit.csv", ROWS, f"time [s],hammer [{unit}],acc [g]")
    _, (hit,) = read_block(path, hammer_mass=0.1)
    assert hit.hammer.scale == pytest.approx(10.0 * newton)


def test_what_is_left_out_for_its_unit_is_named(tmp_path):
    path = write(tmp_path / "hit.csv", ROWS, "time [s],hammer [N],sample [mm]")
    remarks, _ = read_block(path)
    assert "left out for their units: 'sample' [mm]" in remarks


COMMENTS = [
    "# column 1: time (s)\n# column 2: Acc (g)\n# column 3: Force (N)",
    "# 0: time (s)\n# 1: Acc (g)\n# 2: Force (N)",
    "# names: time, acc, force\n# units: s, g, N",
    "# time [s]  acc [g]  force [N]",
    "# columns: time [s], acc [g], force [N]",
]


@pytest.mark.parametrize("heading", COMMENTS)
def test_comments_above_a_table_may_hold_its_names_and_units(tmp_path, heading):
    path = write(tmp_path / "hit.txt", ROWS[:, [0, 2, 1]], heading, delimiter=" ")
    (found,), taken = read(path)
    assert found == pytest.approx(RIGHT, rel=1e-3)
    assert taken.lower() == "hammer 'force' [n], sample 'acc' [g]"


def test_a_comma_that_is_decimal_and_parts_columns_is_told_as_that(tmp_path):
    path = write(tmp_path / "hit.csv", ROWS)
    path.write_text(path.read_text().replace(".", ","))
    with pytest.raises(ValueError, match="has 3 names and 6 cells in a row: its decimal sign"):
        read(path)


@pytest.mark.parametrize("delimiter", [",", "\t"])
def test_commas_between_thousands_are_no_decimal_commas(tmp_path, delimiter):
    quote = '"' if delimiter == "," else ""
    rows = (
        delimiter.join(f"{quote}{value:,.3f}{quote}" for value in row)
        for row in (ROWS * [1e6, 1e3, 1.0]).tolist()
    )
    path = tmp_path / "hit.csv"
    path.write_text("\n".join([HEADING.replace("[s]", "[us]").replace(",", delimiter), *rows]))
    assert read(path)[0] == pytest.approx([RIGHT], rel=1e-3)


def test_counts_of_an_oscilloscope_are_volts_by_the_scale_in_its_heading(tmp_path):
    counts = "".join(f"{round(value)},\n" for value in FORCE[SHORT])
    head = "Vertical Units,V\n{}Horizontal Units,S\nSampling Period,1.953125E-05\n"
    path = tmp_path / "hit.csv"
    path.write_text(head.format("Vertical Scale,5.000E-01\n") + "Waveform Data,\n" + counts)
    found, taken = read(path)
    assert found == pytest.approx([RIGHT], rel=2e-2)
    assert taken.startswith("hammer 'Waveform Data' [V]")
    assert read_block(path)[1][0].hammer.output.max() == pytest.approx(100 / 25 * 0.5)
    path.write_text(head.format("") + "Waveform Data,\n" + counts)
    assert read(path)[1].startswith("hammer 'Waveform Data' [unit not stated]")


@pytest.mark.parametrize(
    ("name", "begins", "told"),
    [
        ("hit.dat", b"|CF,2,1,1;", "imc FAMOS"),
        ("hit.raw", b"anything", "imc FAMOS"),
        ("hit.bin", (5012).to_bytes(2, "little"), "HBM catman"),
        ("hit.dat", b"MDF     4.10", "asammdf"),
    ],
)
def test_formats_with_a_home_elsewhere_are_refused_by_name_with_the_way(
    tmp_path, name, begins, told
):
    (tmp_path / name).write_bytes(begins + bytes(100))
    with pytest.raises(ValueError, match=f"cannot be read here: .*{told}"):
        read(tmp_path / name)


@pytest.mark.parametrize(("fill", "is_read"), [("0.00000E+00", True), ("1.00000E+00", False)])
def test_the_last_line_of_a_universal_file_may_be_filled_up(tmp_path, fill, is_read):
    path = tmp_path / "hit.uff"
    UFF(str(path)).write_sets(
        [make_function(id1="hammer", data=FORCE[:1023], x=TIME[:1023], binary=0)]
    )
    lines = path.read_text().splitlines()
    width = len(lines[-2]) // 3  # of the cells of the last line, which has three of four or six
    lines[-2] += fill.rjust(width) * (len(lines[-3]) // width - 3)
    path.write_text("\n".join(lines) + "\n")
    if is_read:
        assert read(path)[0] == pytest.approx([RIGHT], rel=1e-3)
        return
    with pytest.raises(ValueError, match="'hammer' should have 1023 points, it has 102"):
        read(path)
