"""The rig of a run that is to go on: its rig file and its source, as its recordings have them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impact_rig.configuration.parameters import CONTINUOUS
from impact_rig.configuration.rig_file import RigFile, load_rig_file
from impact_rig.configuration.toml_table import parse_toml_table, read_toml_file
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.records import MEASURED
from impact_rig.recordings.messages import BLOCK_TYPE, origin_from_msg
from impact_rig.recordings.new_file import list_successors, write_new_file
from impact_rig.recordings.provenance import read_parameters
from impact_rig.recordings.records import Attachment, MetadataRecord, RawMessage
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan

ADVICE = "leave it out to go on with this rig, or begin a new run"


@dataclass(frozen=True)
class RunRig:
    """The rig with which a run was recorded, as far as it differs from the defaults."""

    rig: RigFile
    source: Mapping[str, Any]  # keys in place of those of the rig file's table [source]
    is_continuous: bool = False  # the accelerometers stream all the time


def find_rig_of_run(folder: Path, given: Path | None, source: Mapping[str, Any]) -> RunRig:
    """Return the rig with which a run is to go on: its own.

    Parameters
    ----------
    folder : Path
        Of the run. Its rig file is written there, if it is not there yet.
    given : Path or None
        The rig file that a person names: it must say what the run's says.
    source : mapping
        Keys of the table [source] that a person gives: they must be the run's; None: not given.

    Raises
    ------
    FileError
        If the recordings cannot be read, or do not say by which rig they were measured.
    ParameterError
        If another rig is given; the message names both.
    """
    run = Run(folder)
    attached, parameters = None, dict[str, Any]()
    for item in _read_items(run):
        if isinstance(item, Attachment) and item.name.endswith(".toml"):
            attached = attached or item
        elif isinstance(item, MetadataRecord):
            parameters |= read_parameters(item, "accelerometer")
    recorded = dict(parse_toml_table(str(parameters.get("source", ""))))
    rig = _choose_rig_file(folder, attached, given)
    first = next(run.read_messages({BLOCK_TYPE}), None)
    is_measured = first is not None and run.convert(first, origin_from_msg).kind == MEASURED
    if attached is None and "driver" not in recorded and is_measured:
        raise FileError(f"{folder} was measured, and does not say by which rig: begin a new run")
    for key, value in source.items():
        if value is not None and value != recorded.get(key, rig.source.get(key)):
            raise ParameterError(
                f"{folder} was recorded with"
                f" {key} = {recorded.get(key, rig.source.get(key, 'its default'))!r} of the"
                f" source, not {value!r}: {ADVICE}"
            )
    return RunRig(rig, recorded, parameters.get("mode") == CONTINUOUS)


def _read_items(run: Run) -> Iterator[Attachment | MetadataRecord]:
    """Yield the sound attachments and metadata of all files."""
    for path in run.files:
        for item in Scan(path, is_strict=False).read(lambda _: False):
            if not isinstance(item, RawMessage):
                yield item


def _choose_rig_file(folder: Path, attached: Attachment | None, given: Path | None) -> RigFile:
    """Return the run's rig file, from the path that was given or from the run's folder."""
    if attached is None:
        if given is not None:
            raise ParameterError(
                f"{folder} was recorded with the paper's virtual rig, not with the rig file"
                f" {given}: {ADVICE}"
            )
        return load_rig_file(None)
    kept = _keep_rig_file(folder, attached)
    if given is not None:
        then, now = (read_toml_file(path, "rig file", parse_toml_table) for path in (kept, given))
        if differing := [key for key in {**then, **now} if then.get(key) != now.get(key)]:
            raise ParameterError(
                f"{folder} was recorded with the rig file {kept}, and {given} says something else"
                f" of {', '.join(differing)}: {ADVICE}"
            )
    return load_rig_file(kept)


def _keep_rig_file(folder: Path, attached: Attachment) -> Path:
    """Return where the run's rig file is in its folder; it is written there if it is not."""
    for path in list_successors(folder / Path(attached.name).name):
        if not path.exists():
            with write_new_file(path) as part:
                part.write_bytes(attached.data)
        if path.read_bytes() == attached.data:
            return path
    raise AssertionError  # there are names without end
