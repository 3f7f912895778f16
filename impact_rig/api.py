"""The rig as a Python library; `impact_rig` hands its names on.

Quantities that are given are texts with a unit, like "20 kHz", as in a rig file, or numbers in SI
units. What is wrong with any of them raises `RigError`, in one sentence.
"""

import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.analysis.analyze import HitSource, analyze
from impact_rig.analysis.exporting import ExportedHit, read_campaigns
from impact_rig.analysis.sources import RunSource, find_run, read_runs
from impact_rig.configuration.processes import limit_threads
from impact_rig.configuration.rig_file import read_rig_file, read_settings
from impact_rig.configuration.units import Given, read_given
from impact_rig.core.errors import (
    FileError,
    ParameterError,
    RigError,  # noqa: F401 - public
    check_count,
    check_name,
)
from impact_rig.core.records import Block, FloatArray, HitLabel
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRigSettings
from impact_rig.devices.virtual.rig import VirtualRig as Simulation
from impact_rig.devices.virtual.truth import Truth, VirtualCampaign, make_truth
from impact_rig.present.printed import Number  # noqa: F401 - public
from impact_rig.present.printed_results import Comparison, Results, SampleResults
from impact_rig.recordings.source import find_bag
from impact_rig.results.batch import BatchCampaign, tabulate_changes
from impact_rig.results.numbers import format_count
from impact_rig.results.traces import AlignedHit, align_hit


@dataclass(frozen=True, eq=False, repr=False)
class Hit:
    """One hit as arrays.

    Examples
    --------
    >>> hit = VirtualRig(seed=7).strike("steel small")
    >>> hit
    steel small/1.1: 5000 points of hammer and specimen at 2500 kHz
    >>> hit.hammer.shape, float(hit.time[-1])
    ((5000,), 0.0019996)
    """

    sample: str
    impact: int  # of the sample's series, from 1
    attempt: int  # at this impact, from 1
    record: int  # from 1
    rate: float  # [Hz]
    hammer: FloatArray  # shape (n,), as recorded, calibrated [m/s^2]
    specimen: FloatArray | None  # the same of the sample; None: not measured
    accepted: bool | None = None  # the hit is in the mean; None: not judged yet
    reasons: tuple[str, ...] = ()  # every reason against it
    truth: Truth | None = None  # of the virtual rig; None: not known
    filtered: AlignedHit | None = None  # `.time`, `.traces`: after baseline and low-pass

    @property
    def name(self) -> str:
        """As `Run.analyze` takes it: "steel small/1.1"."""
        return f"{self.sample}/{self.impact}.{self.attempt}"

    @property
    def time(self) -> FloatArray:
        """From the first point [s], shape (n,)."""
        return np.arange(self.hammer.size) / self.rate

    def __repr__(self) -> str:
        """Return its name, and what was recorded."""
        bodies = "hammer" if self.specimen is None else "hammer and specimen"
        verdict = {None: "", True: ", accepted", False: f", rejected: {'; '.join(self.reasons)}"}
        return (
            f"{self.name}: {self.hammer.size} points of {bodies} at {self.rate / 1e3:g} kHz"
            f"{verdict[self.accepted]}"
        )


def _make_hit(block: Block, truth: Truth | None, judged: ExportedHit | None = None) -> Hit:
    label, (hammer, *others) = block.label, [item.acceleration for item in block.channels]
    hit = Hit(
        label.sample,
        label.impact,
        label.attempt,
        label.record,
        block.sampling_rate,
        hammer,
        others[0] if others else None,
        truth=truth,
    )
    if judged is None:
        return hit
    filtered, reasons = judged.judged.filtered, tuple(map(str, judged.judged.rejections))
    aligned = None if filtered is None else align_hit(label, filtered)
    return replace(hit, accepted=judged.accepted, reasons=reasons, filtered=aligned)


Chosen = str | int | Hit | Iterable[str | int | Hit]
"""Hits, each as itself, by name, or by the number of its record."""


def list_items(given: Any) -> list[Any]:
    """Return things as a list; one may be given by itself."""
    is_one = isinstance(given, str | Path) or not isinstance(given, Iterable)
    return [given] if is_one else [*given]


def _name_hits(chosen: Chosen) -> list[str]:
    return [item.name if isinstance(item, Hit) else str(item) for item in list_items(chosen)]


class _Hits(dict[str, tuple[Hit, ...]]):
    """Hits by sample."""

    def __missing__(self, name: str) -> Any:
        """Refuse the name."""
        check_name("sample", name, self)


class Run:
    """Hits with their set-up: of a recording, of files, of the virtual rig."""

    def __init__(
        self,
        source: HitSource,
        name: str,
        campaign: int | None = None,
        truths: Mapping[HitLabel, Truth] | None = None,
    ) -> None:
        if campaign is not None:
            check_count("campaign", campaign, 1)
        self.name = name
        self._source = source
        self._campaign = campaign
        self._truths = truths or {}

    def _choose(self, campaigns: Sequence[Any]) -> Any:
        """Return the campaign that is meant."""
        if not campaigns:
            raise FileError(f"{self.name} holds no complete hit")
        number = 1 if self._campaign is None and len(campaigns) == 1 else self._campaign
        if number is None or number > len(campaigns):
            raise ParameterError(
                f"{self.name} holds {format_count(len(campaigns), 'campaign')}: choose one with"
                f" campaign=1 to {len(campaigns)}"
            )
        return campaigns[number - 1]

    @cached_property
    @limit_threads()
    def hits(self) -> dict[str, tuple[Hit, ...]]:
        """All hits in their order, by sample, each with its verdict.

        Raises
        ------
        RigError
            If they cannot be read. A sample that is not there is a `KeyError`, too.
        """
        found = _Hits()
        for hit in self._choose(read_campaigns(self._source)).list_hits():
            label = hit.record.label
            shown = _make_hit(hit.record, self._truths.get(label), hit)
            found[label.sample] = *found.get(label.sample, ()), shown
        return found

    @limit_threads()
    def analyze(
        self,
        *,
        cutoff: Given = None,
        accept: Chosen = (),
        reject: Chosen = (),
        **settings: Given,
    ) -> Results:
        """Judge every hit and estimate, as ``impact-rig analyze`` does.

        Parameters
        ----------
        cutoff : str or float, optional
            Of the low-pass: "20 kHz", or a number in Hz; "off", or 0: none. As recorded.
        accept, reject : str, int, Hit or sequence of them
            Hits to take into the mean or to leave out: "steel small/3", the record's number, or
            one of `hits`.
        **settings
            Other fields of `AnalysisSettings`: ``pulse_factor=1.9``, ``pre_trigger="0.1 ms"``.

        Raises
        ------
        RigError
            If the hits cannot be read, a setting cannot be used, or a hit is not there.

        Examples
        --------
        >>> run = VirtualRig(seed=7).run(["steel small"], 4)
        >>> run.analyze(cutoff="20 kHz", reject="steel small/3")
        1 sample, 3 hits accepted, 1 rejected; simulated (virtual rig, plant published)
        """
        overruled = map(_name_hits, (accept, reject))
        chosen = read_settings({"cutoff": cutoff, **settings})
        found = analyze(self._source, chosen, *overruled, keep_traces=True)
        return Results(self._choose(found.campaigns), self.name, found.warnings)

    def __repr__(self) -> str:
        """Return its name."""
        return f"run {self.name}"


class _StoredRun(Run):
    """Results alone, without the hits behind them."""

    def __init__(self, source: RunSource) -> None:
        self.name = source.title
        self._path = source.results
        (self._found,) = read_runs(source)

    @cached_property
    def hits(self) -> dict[str, tuple[Hit, ...]]:
        """Nothing of them is left."""
        raise FileError(f"{self._path} holds results alone: hits are in a recording")

    def analyze(self, **settings: Any) -> Results:
        """Return the results."""
        if settings:
            raise ParameterError(
                f"{', '.join(settings)} does not change {self._path}, a results file:"
                " open its recording"
            )
        return Results(self._found.campaign, self.name, self._found.warnings)


def open_run(
    path: str | Path, *, campaign: int | None = None, namespace: str | None = None
) -> Run:
    """Open a run.

    Parameters
    ----------
    path : str or Path
        The folder of a run, also one that was resumed, a recording, or a results.json, which has
        results but no hits.
    campaign : int, optional
        Which one, from 1, where a recording holds several.
    namespace : str, optional
        Of the rig, where a recording holds several.

    Raises
    ------
    RigError
        If there is no such run, or it cannot be read.

    Examples
    --------
    >>> open_run("nowhere.mcap")
    Traceback (most recent call last):
    impact_rig.core.errors.FileError: nowhere.mcap does not exist
    """
    source = find_run(find_bag(_read_path("path", path)), namespace)
    if source.run is None:
        return _StoredRun(source)
    _ = source.run.namespace  # raises an error at once
    return Run(source.run, source.title, campaign)


def _read_path(what: str, path: Any) -> Path:
    if isinstance(path, str | Path) and str(path):
        return Path(path)
    raise ParameterError(f"{what} is {path!r}: it must be the name of a file or a folder")


def read_files(
    files: str | Path | Iterable[str | Path],
    *,
    rate: Given = None,
    hammer_mass: Given = None,
    sample_mass: Given = None,
    hammer_unit: str | None = None,
    hammer_channel: str | None = None,
    sample_channel: str | None = None,
    sample: str | None = None,
    cutoff: Given = None,
    record_duration: Given = None,
    channels: str | Path | None = None,
    rig_file: str | Path | None = None,
) -> Run:
    """Read files of any instrument as hits of one sample, as ``impact-rig analyze`` does.

    Parameters
    ----------
    files : str, Path or iterable of them
        Names may have wildcards: "bench/*.tdms".
    rate, hammer_mass, sample_mass, cutoff, record_duration : str or float, optional
        As the options of ``impact-rig analyze``, with a unit or in Hz, kg and s.
    hammer_unit, hammer_channel, sample_channel, sample, channels, rig_file : optional
        As these options.

    Raises
    ------
    RigError
        If no file is a hit, or says what is needed; the sentence says what would.

    Warns
    -----
    UserWarning
        Of each file that is left out, why.
    """
    # Formats of files take a tenth of a second to load.
    from impact_rig.analysis.measured_files import MeasuredFiles, make_series
    from impact_rig.files.import_file import MeasurementOptions

    paths = [path for item in list_items(files) for path in _expand(_read_path("files", item))]
    if not paths:
        raise FileError("no file is given")
    options = MeasurementOptions(
        channels=None if channels is None else Path(channels),
        hammer_channel=hammer_channel,
        sample_channel=sample_channel,
        hammer_unit=hammer_unit,
        rate=read_given("rate", rate, "Hz", "25.6 kHz"),
        hammer_mass=read_given("hammer_mass", hammer_mass, "kg", "100 g"),
        sample_mass=read_given("sample_mass", sample_mass, "kg", "56.32 g"),
        rig_file=None if rig_file is None else Path(rig_file),
        sample=sample,
        cutoff=read_given("cutoff", cutoff, "Hz", "50 kHz"),
        record_duration=read_given("record_duration", record_duration, "s", "20 ms"),
    )
    source = MeasuredFiles(paths, make_series(options))
    if not source.hits:
        raise FileError("; ".join(source.errors))
    for text in source.errors:
        warnings.warn(f"left out: {text}", stacklevel=2)
    return Run(source, str(paths[0]) if len(paths) == 1 else f"{paths[0]} and others")


def _expand(path: Path) -> list[Path]:
    """Return the files that a name with wildcards means, or the name."""
    if not has_magic(str(path)):
        return [path]
    found = [Path(name) for name in sorted(glob(str(path), recursive=True))]  # noqa: PTH207
    if not found:
        raise FileError(f"no file is called like {path}")
    return found


class Session(Run):
    """Hits as arrays, one by one, and what they say so far.

    Parameters
    ----------
    samples : mapping of str to mass
        Names, each with its mass without accelerometer; None: not known, k and c are not either.
    hammer_mass, accelerometer_mass : str or float, optional
        With a unit, or in kg.
    control : str
        The sample that is alike to the hammer: it gives k1; empty: none.
    hammer_stiffness : str or float, optional
        k1 from an earlier experiment, in place of a control sample: "22.5 MN/m".
    rig_file : str or Path, optional
        In place of all these.
    cutoff, **settings
        As of `Run.analyze`.

    Examples
    --------
    >>> session = Session({"steel": "56.32 g"}, hammer_mass="100 g")
    >>> for hit in VirtualRig(seed=7).run(["steel small"], 3).hits["steel small"]:
    ...     session.add(hit.hammer, hit.specimen, rate=hit.rate, on="steel")
    >>> session.results["steel"].impacts_accepted, session.hits["steel"][-1].accepted
    (3, True)
    """

    def __init__(
        self,
        samples: Mapping[str, Given] | None = None,
        *,
        hammer_mass: Given = None,
        accelerometer_mass: Given = None,
        control: str = "",
        hammer_stiffness: Given = None,
        rig_file: str | Path | None = None,
        cutoff: Given = None,
        **settings: Given,
    ) -> None:
        from impact_rig.analysis.measured_arrays import MeasuredArrays, read_setup

        setup = read_setup(
            samples, hammer_mass, accelerometer_mass, control, hammer_stiffness, rig_file
        )
        self._arrays = MeasuredArrays(setup, read_settings({"cutoff": cutoff, **settings}))
        super().__init__(self._arrays, "session")

    def add(
        self,
        hammer: ArrayLike,
        specimen: ArrayLike | None = None,
        *,
        rate: Given,
        on: str,
        unit: str = "m/s^2",
    ) -> None:
        """Take a hit, or several: all of them or, if one is refused, none.

        Parameters
        ----------
        hammer, specimen : array_like, shape (n,) or (hits, n), or a list of arrays
            Both channels at the same instants, with some baseline before the pulse. Without the
            specimen's there are contact times alone.
        rate : str or float
            "2.5 MHz", or a number in Hz.
        on : str
            The sample.
        unit : str
            Of the hammer's numbers: "m/s^2", "g", or "N" of a force hammer. The specimen's are
            accelerations in the same unit, or in m/s^2.

        Raises
        ------
        RigError
            If the arrays are no hit, cannot be averaged with those before, or have no such
            sample or unit.
        """
        self._arrays.add_arrays(hammer, specimen, rate=rate, on=on, unit=unit)
        self.__dict__.pop("hits", None)
        self.__dict__.pop("results", None)

    @cached_property
    def results(self) -> Results:
        """The results of all hits so far; raises `RigError` if there are none."""
        return self.analyze()


def estimate(
    hammer: ArrayLike,
    specimen: ArrayLike | None = None,
    *,
    rate: Given,
    hammer_mass: Given = None,
    sample_mass: Given = None,
    control: bool = False,
    sample: str = "sample",
    unit: str = "m/s^2",
    **settings: Any,
) -> SampleResults:
    """Estimate contact time, stiffness and damping from arrays.

    Parameters
    ----------
    hammer, specimen, rate, unit
        As of `Session.add`; several hits are averaged.
    hammer_mass, sample_mass : str or float, optional
        With a unit, or in kg. Without both there are neither stiffness nor damping.
    control : bool
        The sample is alike to the hammer: it gives k1 by itself.
    sample : str
        What to call it.
    **settings
        `accelerometer_mass`, `hammer_stiffness`, `cutoff` and all others as of `Session`.

    Raises
    ------
    RigError
        As `Session.add`, or if a quantity cannot be meant.

    Examples
    --------
    >>> hit = VirtualRig(seed=7).strike("steel small")
    >>> found = estimate(hit.hammer, hit.specimen, rate="2.5 MHz", hammer_mass="100 g")
    >>> print(found.contact_time)
    169.7... µs
    """
    session = Session(
        {sample: sample_mass},
        hammer_mass=hammer_mass,
        control=sample if control else "",
        **settings,
    )
    session.add(hammer, specimen, rate=rate, on=sample, unit=unit)
    return session.results[sample]


class VirtualRig:
    """A rig whose truth is known: the same seed gives the same hits.

    Parameters
    ----------
    plant : str
        Physics: "published" (the paper's tables), "dynamics", "dynamics_printed" (the model with
        known truth), "contact" (metal on metal, Hertz with loss).
    faults : float
        Probability of each fault, for each hit.
    rig_file : str or Path, optional
        Masses and samples; those of the paper without it.

    Examples
    --------
    >>> rig = VirtualRig(seed=7, plant="contact")
    >>> hit = rig.strike("steel small")
    >>> hit.truth.exponent, round(hit.truth.restitution, 3)
    (1.5, 0.95)
    """

    def __init__(
        self,
        *,
        seed: int = 1,
        plant: str = "published",
        faults: float = 0.0,
        rig_file: str | Path | None = None,
    ) -> None:
        check_name("plant", plant, [item.value for item in Plant])
        self.setup = PAPER_SETUP if rig_file is None else read_rig_file(Path(rig_file)).setup
        settings = VirtualRigSettings(Plant(plant), seed=seed, faults=FaultPlan(faults))
        self._rig = Simulation(self.setup, settings)
        self._counts: Counter[str] = Counter()

    @property
    def samples(self) -> tuple[str, ...]:
        """Names of its samples."""
        return self.setup.samples.names

    def strike(self, sample: str) -> Hit:
        """Strike a sample once more, and return the hit with its truth, without a verdict.

        Raises
        ------
        ParameterError
            If there is no such sample.
        """
        self.setup.samples.find(sample)
        self._counts[sample] += 1
        hit = self._rig.strike(HitLabel(sample, self._counts.total(), self._counts[sample]))
        (block,) = hit.split(hit.hammer.output.size, 0)
        return _make_hit(block, make_truth(hit))

    def find_truth(self, label: HitLabel) -> Truth:
        """Return the truth of a hit of this name, which does not depend on earlier hits."""
        return make_truth(self._rig.strike(label))

    def run(self, samples: str | Iterable[str] = (), impacts: int = 10) -> Run:
        """Strike samples, each so many times, as a campaign does; without names all samples.

        Raises
        ------
        ParameterError
            If there is no such sample, or `impacts` is no number of hits.
        """
        names = list_items(samples) or self.samples
        campaign = VirtualCampaign(self._rig, self.setup, names, impacts)
        return Run(campaign, "virtual rig", truths=campaign.truths)


def compare(first: Results | Run, second: Results | Run) -> Comparison:
    """Return what changed from one run to another, and whether beyond its uncertainty.

    A value changed where |En| is above 1 (ISO 13528, 9.7); `print` shows all.

    Raises
    ------
    RigError
        If a run cannot be analysed, or they have nothing in common.

    Examples
    --------
    >>> rigs = [VirtualRig(seed=seed).run(["aluminium large"], 3) for seed in (1, 2)]
    >>> compare(*rigs)
    0 of 5 values changed beyond their uncertainty
    """
    for item in (first, second):
        if not isinstance(item, Run | Results):
            raise ParameterError(f"{item!r:.40} is neither a run nor results: open it by open_run")
    pair = [item.analyze() if isinstance(item, Run) else item for item in (first, second)]
    tables = tabulate_changes(*(BatchCampaign(Path(item.name), 1, item.record) for item in pair))
    if not tables:
        named = (f"{item.name} ({', '.join(item)})" for item in pair)
        raise ParameterError(f"{' and '.join(named)} have no quantity in common")
    return Comparison(tables)
