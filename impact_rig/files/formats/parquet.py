"""Apache Parquet, by pyarrow."""

from pathlib import Path

from impact_rig.files.formats.arrays import NamedArray, make_measurement
from impact_rig.files.formats.bounds import check_size
from impact_rig.files.measurement import (
    Measurement,
    make_unique,
    read_described,
    write_described,
)

CHANNELS = b"channels"
"""Ours, in the metadata of the table: names, units, rates, starts and dates, as JSON."""
UNITS = (b"unit", b"units")
"""In the metadata of a column."""


def read_parquet(path: Path) -> Measurement:
    """Read all columns of numbers; a column of times gives the others their rate and start.

    Raises
    ------
    FileError
        If the file is no Parquet, or has no column of real numbers.
    """
    import pyarrow as pa
    from pyarrow import parquet

    # pyarrow's own pool asks for far more memory than it needs.
    pa.set_memory_pool(pa.system_memory_pool())
    heading = parquet.read_metadata(path)
    groups = map(heading.row_group, range(heading.num_row_groups))
    size = 8 * heading.num_rows * heading.num_columns  # bytes of a number, at most
    check_size(path, size + sum(group.total_byte_size for group in groups))
    table = parquet.read_table(
        path, use_threads=False, pre_buffer=False, page_checksum_verification=True
    )
    text = (table.schema.metadata or {}).get(CHANNELS)
    if text:
        names = table.column_names
        variables = {name: table[name].drop_null().to_numpy() for name in names}
        return read_described(path, text.decode(), variables)
    arrays = []
    for field, column in zip(table.schema, table.columns, strict=True):
        metadata = field.metadata or {}
        unit = next((metadata[key].decode() for key in UNITS if key in metadata), "")
        arrays.append(NamedArray(field.name, column.to_numpy(), {"unit": unit}))
    return make_measurement(path, arrays)


def write_parquet(path: Path, measurement: Measurement) -> None:
    """Write each channel as a column, and what is known of them as JSON.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        What to write; shorter channels end in nulls.
    """
    import pyarrow as pa
    from pyarrow import parquet

    channels = measurement.channels
    longest = max(channel.values.size for channel in channels)
    names = make_unique([channel.name for channel in channels], str)
    fields = [
        pa.field(
            name,
            pa.from_numpy_dtype(channel.values.dtype),
            metadata={UNITS[0]: channel.unit} if channel.unit else None,
        )
        for name, channel in zip(names, channels, strict=True)
    ]
    schema = pa.schema(fields, metadata={CHANNELS: write_described(channels, names)})
    columns = [
        pa.chunked_array([channel.values, pa.nulls(longest - channel.values.size, field.type)])
        for channel, field in zip(channels, fields, strict=True)
    ]
    parquet.write_table(pa.table(columns, schema=schema), path, write_page_checksum=True)
