"""A run: all its recordings as one, read without ROS, decoded by the schemas in the files."""

from collections.abc import Callable, Collection, Iterable, Iterator
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from impact_rig.core.given.errors import FileError, RigError
from impact_rig.core.given.records import Block, HitLabel, Truth
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.overrules import NO_OVERRULES, Overrules
from impact_rig.core.hit.stream import StreamCutter
from impact_rig.recordings.campaigns import CampaignWatch
from impact_rig.recordings.hits import HIT_TYPES, VERDICT_TYPE
from impact_rig.recordings.messages import (
    BLOCK_TYPE,
    CONVERSION_ERRORS,
    OVERRULE_TYPE,
    SETUP_TYPE,
    STREAM_TYPE,
    VIRTUAL_IMPACT_TYPE,
    block_from_msg,
    campaign_id_from_msg,
    label_from_msg,
    overrule_from_msg,
    setup_from_msg,
    truth_from_msg,
)
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.scan import Report, Scan
from impact_rig.recordings.schemas import decode_message
from impact_rig.recordings.source import RUN_NAME, find_recordings

_T = TypeVar("_T")


class Run:
    """A run of one rig: one recording, or all of a run that was resumed.

    To make one only finds its files; each reading passes over them again, and holds nothing in
    memory.

    Parameters
    ----------
    path : Path
        As `find_recordings` takes it. A file that belongs to a run stands for all of it.
    namespace : str, optional
        Of the rig, where the recordings hold several; None: there is only one.

    Raises
    ------
    FileError
        If there is no such recording. So does all that reads: if a file is damaged or no recording
        of ROS 2, or holds several rigs of which none is chosen.

    Examples
    --------
    >>> run = Run(Path("runs/2026-11-25T21-28-43"))  # doctest: +SKIP
    >>> for event in run.events():  # doctest: +SKIP
    ...     print(type(event).__name__)
    """

    hammer_unit: str | None = None  # the set-up says in what the hammer's channel is
    has_scale = True  # its numbers make accelerations

    def __init__(self, path: Path, namespace: str | None = None) -> None:
        self.path = Path(path)  # as a person named it
        self.files = find_recordings(self.path)  # in the order of their recording
        self.size = sum(file.stat().st_size for file in self.files)  # [byte]
        # The rig that was chosen; None: the only one.
        self.wanted = None if namespace is None else "/" + namespace.strip("/")

    @property
    def name(self) -> Path:
        """Its one file; of several their folder."""
        return self.files[0] if len(self.files) == 1 else self.folder

    @property
    def folder(self) -> Path:
        """Where its recordings are."""
        return self.files[0].parent

    @property
    def is_of_recorder(self) -> bool:
        """Whether its name is the recorder's, so that its results lie beside it."""
        return self.files[0].stem == RUN_NAME

    @property
    def title(self) -> str:
        """Its name: the folder of a run, else the file."""
        first = self.files[0].absolute()
        return first.parent.name if self.is_of_recorder else first.stem

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user, as far as they are known before it is read."""
        part = self.describe_part()
        warnings = (warning for scan in self.scans for warning in scan.warnings)
        return (*([part] if part is not None else []), *warnings)

    def describe_part(self) -> str | None:
        """Return that the file that was named is not the whole run; None: it is all there is."""
        if len(self.files) == 1 or self.path.is_dir():
            return None
        names = ", ".join(file.name for file in self.files)
        return f"{self.path} is part of a run that was resumed: all of it is read, {names}"

    @cached_property
    def scans(self) -> tuple[Scan, ...]:
        """Its files, opened by a reader that raises at the first damage."""
        return tuple(Scan(file, by_time=True) for file in self.files)

    @cached_property
    def namespaces(self) -> tuple[str, ...]:
        """Namespaces of all rigs in its files, by their set-ups and blocks."""
        channels = [channel for scan in self.scans for channel in scan.read_channels()]
        return list_namespaces(channels)

    @cached_property
    def namespace(self) -> str:
        """Namespace of its rig, "/" for none."""
        return choose_namespace(self.path, self.namespaces, self.wanted)

    @cached_property
    def setup(self) -> RigSetup:
        """The first set-up."""
        return self.first[0]

    @cached_property
    def first(self) -> tuple[RigSetup, bytes]:
        """The first set-up, and the id of its campaign."""
        for raw in self.read_messages({SETUP_TYPE}):
            return self.convert(raw, _read_setup)
        raise FileError(
            f"{self.path} holds no set-up of a rig (topic 'setup', {SETUP_TYPE}): without masses"
            " and settings its blocks cannot be evaluated"
        )

    def events(self, report: Report = lambda _: None) -> "RunReading":
        """Return one reading of all set-ups and blocks.

        Parameters
        ----------
        report : callable, optional
            Gets now and then how much was read [byte].
        """
        return RunReading(self, report)

    def read_messages(self, types: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some types as `read_files`."""
        for _, messages in self.read_files(lambda _: types):
            yield from messages

    def read_files(
        self,
        choose_types: Callable[[Scan], Collection[str]],
        report: Report = lambda _: None,
        watch: CampaignWatch | None = None,
    ) -> Iterator[tuple[Scan, Iterator[RawMessage]]]:
        """Yield each file with its messages, to be read before the next file.

        Of the set-ups there are those that begin a campaign; blocks that are there twice, byte by
        byte, come once. Of trial hits there is nothing.

        Parameters
        ----------
        choose_types : callable
            Returns the types of the messages that are wanted of a file.
        report : callable, optional
            Gets now and then how much was read [byte].
        watch : CampaignWatch, optional
            Counts what came twice.
        """
        watch, before = watch or CampaignWatch(), 0
        for scan in self.scans:
            types = choose_types(scan)
            wanted = partial(self.is_wanted, types)
            messages = scan.read_messages(wanted, partial(report_from, report, before))
            yield scan, (raw for raw in messages if self._is_new(watch, raw))
            before += scan.size

    def is_wanted(self, types: Collection[str], channel: Channel) -> bool:
        """Return whether a topic of some types is of this run's rig."""
        is_ours = find_owner(channel.topic, self.namespaces) == self.namespace
        return channel.type_name in types and is_ours

    def _is_new(self, watch: CampaignWatch, raw: RawMessage) -> bool:
        """Return whether a message is new: no set-up or block that came before."""
        if raw.channel.type_name == SETUP_TYPE:
            return self.convert(raw, watch.add_setup)
        if raw.channel.type_name in (BLOCK_TYPE, STREAM_TYPE):
            return watch.add_block(raw.data)
        return not watch.is_trial or raw.channel.type_name not in HIT_TYPES

    def convert(self, raw: RawMessage, convert: Callable[[Any], _T]) -> _T:
        """Return a message as a core type.

        Parameters
        ----------
        raw : RawMessage
            Of this run.
        convert : callable
            From the decoded message to the core type.

        Raises
        ------
        FileError
            If the message does not have the fields of this version, or they cannot be meant.
        """
        try:
            return convert(decode_message(raw))
        except FileError as error:  # it names the topic
            raise FileError(f"{self.path}: {error}") from None
        except RigError as error:
            raise FileError(f"{self.path}: {raw.channel.topic}: {error}") from None
        except CONVERSION_ERRORS as error:
            raise FileError(
                f"{self.path}: {raw.channel.type_name} on {raw.channel.topic} was recorded with"
                f" another version of the interfaces: {error}"
            ) from None


class RunReading:
    """One reading of a run: set-ups and blocks in file order, the first set-up before all else.

    Impacts in a running stream are found now, if they were not found while it was recorded.

    Yields
    ------
    RigSetup or Block
        A set-up begins a campaign and holds for the blocks after it.

    Raises
    ------
    FileError
        As `Run`, also if a message has no field that is needed.
    """

    def __init__(self, run: Run, report: Report) -> None:
        self._run, self._report, self._watch = run, report, CampaignWatch()
        # Of the campaign that was come to, in mappings of its own: the virtual rig's hits, whether
        # each hit was accepted when it came; and persons' verdicts.
        self.truths: dict[HitLabel, Truth] = {}
        self.verdicts: dict[HitLabel, bool] = {}
        self.overrules = NO_OVERRULES

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user, with what was met so far."""
        repeated, path = self._watch.repeated, self._run.path
        twice = f"{path} holds {repeated} blocks twice: each is used once"
        return (*self._run.warnings, *([twice] if repeated else []))

    def __iter__(self) -> Iterator[RigSetup | Block]:
        """Read, once: the verdicts of persons first, since they hold for hits before them."""
        run = self._run
        is_ours = partial(run.is_wanted, {OVERRULE_TYPE})
        decided = read_overrules(run.scans, is_ours, run.convert)
        setup, campaign = run.first
        self.overrules = decided.get(campaign, NO_OVERRULES)
        yield setup
        is_ahead = True  # the files are still to come to the set-up that was yielded
        kinds = {scan: _find_kind(scan) for scan in run.scans}
        types = {SETUP_TYPE, VIRTUAL_IMPACT_TYPE, VERDICT_TYPE}
        files = run.read_files(lambda scan: {*types, kinds[scan]}, self._report, self._watch)
        for scan, messages in files:
            cutter = StreamCutter(setup.analysis) if kinds[scan] == STREAM_TYPE else None
            for raw in messages:
                kind = raw.channel.type_name
                if kind == VIRTUAL_IMPACT_TYPE:
                    label, truth = run.convert(raw, truth_from_msg)
                    self.truths[label] = truth
                elif kind == VERDICT_TYPE:
                    label, is_accepted = run.convert(raw, _read_verdict)
                    self.verdicts[label] = is_accepted
                elif kind != SETUP_TYPE:
                    block = run.convert(raw, block_from_msg)
                    yield from (block,) if cutter is None else cutter.feed(block)
                elif is_ahead:
                    is_ahead = False
                else:  # another campaign begins
                    setup, campaign = run.convert(raw, _read_setup)
                    self.truths, self.verdicts = {}, {}
                    self.overrules = decided.get(campaign, NO_OVERRULES)
                    yield setup
                    cutter = cutter and StreamCutter(setup.analysis)


def read_overrules(
    scans: Iterable[Scan],
    wanted: Callable[[Channel], bool],
    convert: Callable[[RawMessage, Callable[[Any], Any]], Any],
) -> dict[bytes, Overrules]:
    """Return the persons' verdicts that hold after all files, by campaign id.

    Parameters
    ----------
    scans : iterable of Scan
        The files of a run, in order.
    wanted : callable
        Whether a topic is the rig's, and of verdicts.
    convert : callable
        Decodes a message and calls its second argument with it.
    """
    found: dict[bytes, Overrules] = {}
    for scan in scans:
        # Most files have none, as their index tells: they are not read for it.
        for raw in () if scan.counts_none(wanted) else scan.read_messages(wanted):
            key, overrule = convert(raw, campaign_id_from_msg), convert(raw, overrule_from_msg)
            found[key] = found.get(key, NO_OVERRULES).add(overrule)
    return found


def _read_setup(message: Any) -> tuple[RigSetup, bytes]:
    return setup_from_msg(message), campaign_id_from_msg(message)


def _read_verdict(message: Any) -> tuple[HitLabel, bool]:
    return label_from_msg(message), bool(message.accepted)


def _find_kind(file: Scan) -> str:
    """Return the type of a recording's blocks: of a running stream where no impact was found."""
    channels = file.read_channels()
    if not any(channel.type_name == STREAM_TYPE for channel in channels):
        return BLOCK_TYPE
    has_impact = any(file.read_messages(lambda channel: channel.type_name == BLOCK_TYPE))
    return BLOCK_TYPE if has_impact else STREAM_TYPE


_USUAL_NAMES = {
    SETUP_TYPE: "setup",
    BLOCK_TYPE: "acceleration",
    STREAM_TYPE: "acceleration/stream",
}
"""Topics that show a rig, by their types; one that was remapped lies in its namespace."""


def list_namespaces(channels: Collection[Channel]) -> tuple[str, ...]:
    """Return the namespaces of the rigs in a recording, by the topics of set-ups and blocks."""
    found = (channel for channel in channels if channel.type_name in _USUAL_NAMES)
    return tuple(sorted({_name_parent(it.topic, _USUAL_NAMES[it.type_name]) for it in found}))


def _name_parent(topic: str, name: str) -> str:
    parent = topic[: -len(name)] if topic.endswith("/" + name) else topic.rpartition("/")[0]
    return parent.rstrip("/") or "/"


def find_owner(topic: str, namespaces: Collection[str]) -> str | None:
    """Return the namespace of the rig to which a topic belongs; None: to no rig.

    One rig may lie in the namespace of another, as all do in that of a rig without one.
    """
    around = (name for name in namespaces if topic.startswith(name.rstrip("/") + "/"))
    return max(around, key=len, default=None)


def choose_namespace(path: Path, found: Collection[str], wanted: str | None) -> str:
    """Return the namespace of the rig that is to be read.

    Parameters
    ----------
    path : Path
        Of the recording, for the message.
    found : collection of str
        What `list_namespaces` returns.
    wanted : str or None
        The one that a person chose; None: there should be only one.

    Raises
    ------
    FileError
        If there is no such rig, or there are several.
    """
    if wanted is not None and found and wanted not in found:
        raise FileError(f"{path} holds no rig in namespace {wanted}: it has {', '.join(found)}")
    if wanted is None and len(found) > 1:
        raise FileError(
            f"{path} holds several rigs, in the namespaces {', '.join(found)}: choose one of them"
            " with --namespace"
        )
    return wanted or next(iter(found), "/")


def report_from(report: Report, before: int, done: int) -> None:
    """Report how much was read of all files: those before, and this one [byte]."""
    report(before + done)


def find_runs(paths: Iterable[Path], namespace: str | None = None) -> tuple[list[Run], list[str]]:
    """Return the runs that paths mean, each once, and the errors of the others.

    Several recordings of a run, as `runs/*/*.mcap` names them, are that run.
    """
    runs: dict[Path, Run] = {}
    errors: list[str] = []
    for path in paths:
        try:
            run = Run(path, namespace)
        except FileError as error:
            errors.append(str(error))
            continue
        known = runs.setdefault(run.files[0].absolute(), run)
        if known is not run and (len(run.files) == 1 or path == known.path):
            errors.append(f"{path} is named twice: it is used once")
    return list(runs.values()), errors
