"""The rig as a Python library; `impact_rig` hands its names on.

Quantities that are given are texts with a unit, like "20 kHz", as in a rig file, or numbers in SI
units. What is wrong with any of them raises `RigError`, in one sentence.
"""

from __future__ import annotations

import json
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.analysis.analyze import ByHand, HitSource, analyze
from impact_rig.analysis.hits import Hit, read_campaigns
from impact_rig.analysis.sources import (
    RunSource,
    choose_campaign,
    find_run,
    list_files,
    list_items,
    read_runs,
)
from impact_rig.configuration.processes import compute_alone
from impact_rig.configuration.rig_file import add_samples, load_rig_file, read_settings
from impact_rig.configuration.units import Given
from impact_rig.core.given.errors import (
    FileError,
    ParameterError,
    RigError,
    SignalError,
    check_count,
    check_name,
)
from impact_rig.core.given.records import HitLabel, Truth
from impact_rig.devices.source_table import read_source_keys, read_virtual_settings
from impact_rig.devices.virtual.choices import SourceKeys
from impact_rig.devices.virtual.rig import VirtualRig as Simulation
from impact_rig.devices.virtual.truth import VirtualCampaign, make_truth
from impact_rig.present.printed import Number  # noqa: F401 - public
from impact_rig.present.printed_results import Comparison, Results, SampleResults
from impact_rig.recordings.messages import BLOCK_TYPE, SETUP_TYPE
from impact_rig.recordings.records import RawMessage
from impact_rig.recordings.run import Run as RecordedRun
from impact_rig.recordings.source import find_bag
from impact_rig.results.batch import BatchCampaign, tabulate_changes
from impact_rig.results.campaign import HitResults
from impact_rig.results.results_file import read_path

Chosen = str | int | Hit | Iterable[str | int | Hit]
"""Hits, each as itself, by name, or by the number of its record."""


class Settings(TypedDict, total=False):
    """Fields of `AnalysisSettings`, by keyword; those of a time or frequency with their unit."""

    cutoff: Given  # of the low-pass: "20 kHz", or in Hz; "off", or 0: none
    pulse_factor: float
    pre_trigger: Given
    record_duration: Given
    detection_level: float
    minimum_peak: float
    maximum_peak: float
    double_hit_level: float
    contact_exponent: float


class ArrayOptions(Settings, total=False):
    """What is known of arrays beside their numbers, all of it optional."""

    accelerometer_mass: Given  # with a unit, or in kg
    hammer_stiffness: Given  # k1 from an earlier experiment, in place of a control sample
    hammer_sensitivity: str | None  # of channels in V: "10 mV/g", "2.25 mV/N"
    specimen_sensitivity: str | None
    sensitivity_uncertainty: float  # of both, standard, relative: a line of the budgets


class FileOptions(TypedDict, total=False):
    """What files may leave open: quantities with a unit, or in Hz, kg and s."""

    rate: Given
    hammer_mass: Given
    sample_mass: Given
    cutoff: Given
    record_duration: Given
    hammer_unit: str | None
    hammer_channel: str | int | None  # by its name, or its number from 1
    sample_channel: str | int | None
    sample: str | None
    channels: str | Path | None  # a file that describes them
    rig_file: str | Path | None


_OPTION = re.compile(r"`[^`]*`|--([a-z][a-z-]+)(?: (\"[^\"]*\"|\d[\w.]*|g\b))?")
"""An option of the command line in a sentence, with its value; or a whole command."""


def _say_in_python(text: str) -> str:
    """Return a sentence that advises keywords in place of options of the command line."""

    def replace(found: re.Match[str]) -> str:
        option, value = found.groups()
        if option is None:
            return found[0]
        quoted = json.dumps(value.strip('"')) if value else ""
        return "=".join(filter(None, (option.replace("-", "_"), quoted)))

    return _OPTION.sub(replace, text)


@contextmanager
def _speaking_python() -> Iterator[None]:
    """Let errors of the block advise keywords."""
    try:
        yield
    except RigError as error:
        error.args = (_say_in_python(str(error)),)
        raise


class _Hits(dict[str, tuple[Hit, ...]]):
    """Hits by sample."""

    def __missing__(self, name: str) -> Any:
        """Refuse the name."""
        check_name("sample", name, self)


class Run:
    """Hits with their set-up: of a recording, of files, of the virtual rig.

    Examples
    --------
    >>> run = VirtualRig(seed=7).run(["steel small"], 2)
    >>> run.hits["steel small"][1]
    steel small/2.1: 4956 points of hammer and specimen at 2500 kHz, accepted
    """

    def __init__(self, source: HitSource, name: str, campaign: int | None = None) -> None:
        self.name = name
        self._source = source
        self._campaign = campaign

    @cached_property
    @compute_alone()
    def hits(self) -> dict[str, tuple[Hit, ...]]:
        """All hits in their order, by sample, each with its verdict.

        Raises
        ------
        RigError
            If they cannot be read. A sample that is not there is a `KeyError`, too.
        """
        found = _Hits()
        for hit in choose_campaign(
            self.name, read_campaigns(self._source.events()), self._campaign
        ).list_hits():
            found[hit.sample] = *found.get(hit.sample, ()), hit
        return found

    @compute_alone()
    def analyze(
        self, *, accept: Chosen = (), reject: Chosen = (), **settings: Unpack[Settings]
    ) -> Results:
        """Judge every hit and estimate, as ``impact-rig analyze`` does.

        Parameters
        ----------
        accept, reject : str, int, Hit or sequence of them
            Hits to take into the mean or to leave out: "steel small/3", the record's number, or
            one of `hits`.
        **settings
            See `Settings`: ``cutoff="20 kHz"``, ``pulse_factor=1.9``. Others are as recorded.

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
        by_hand = ByHand(self._name_hits(accept), self._name_hits(reject))
        chosen = read_settings({**settings})
        with _speaking_python():
            found = analyze(self._source, chosen, by_hand, keep_traces=True)
        campaign = choose_campaign(self.name, found.campaigns, self._campaign)
        return Results(campaign, self.name, [*map(_say_in_python, found.warnings)])

    def sweep(self, **settings: Iterable[Given]) -> dict[Given, Results]:
        """Analyze with each value of one setting.

        Parameters
        ----------
        **settings
            One of those of `analyze`, with its values.

        Raises
        ------
        RigError
            As `analyze`, or if it is not one setting.

        Examples
        --------
        >>> run = VirtualRig(seed=7).run(["steel small"], 4)
        >>> for cutoff, results in run.sweep(cutoff=["20 kHz", "50 kHz"]).items():
        ...     print(cutoff, results["steel small"].contact_time)
        20 kHz 17... ± ... µs
        50 kHz 17... ± ... µs
        """
        if len(settings) != 1:
            raise ParameterError(f"sweep changes one setting, not {len(settings)}")
        ((name, values),) = settings.items()
        return {value: self.analyze(**{name: value}) for value in list_items(values)}

    def _name_hits(self, chosen: Chosen) -> list[str]:
        """Return hits by name; raises `ParameterError` for one of another run."""
        names = []
        for item in list_items(chosen):
            if isinstance(item, Hit):
                same = [hit for hit in self.hits.get(item.sample, ()) if hit.name == item.name]
                if same and not any(np.array_equal(hit.hammer, item.hammer) for hit in same):
                    raise ParameterError(f"hit {item.name} is of another run than {self.name}")
            names.append(item.name if isinstance(item, Hit) else str(item))
        return names

    def __repr__(self) -> str:
        """Return its name."""
        return f"run {self.name}"


_OF_ARRAYS = (
    "accelerometer_mass", "hammer_stiffness", "hammer_sensitivity", "specimen_sensitivity",
    "sensitivity_uncertainty",
)  # fmt: skip
"""Keys of `ArrayOptions` that are no settings."""


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
        Of the rig, where a recording holds those of several.

    Raises
    ------
    RigError
        If there is no such run, or it cannot be read.

    Examples
    --------
    >>> open_run("nowhere.mcap")
    Traceback (most recent call last):
    impact_rig.core.given.errors.FileError: there is no file nowhere.mcap
    """
    if campaign is not None:
        check_count("campaign", campaign, 1)
    source = find_run(find_bag(read_path("path", path)), namespace)
    if source.run is None:
        return _StoredRun(source)
    _ = source.run.namespace  # raises an error at once
    if campaign is not None:
        choose_campaign(source.title, _list_struck(source.run), campaign)
    return Run(source.run, source.title, campaign)


def _list_struck(run: RecordedRun) -> list[RawMessage]:
    """Return the set-ups of a recording that are followed by a hit."""
    struck: list[RawMessage] = []
    begun = None
    for message in run.read_messages({SETUP_TYPE, BLOCK_TYPE}):
        if message.channel.type_name == SETUP_TYPE:
            begun = message
        elif begun is not None:
            struck.append(begun)
            begun = None
    return struck


def read_files(files: str | Path | Iterable[str | Path], **options: Unpack[FileOptions]) -> Run:
    """Read files of any instrument as hits of one sample, as ``impact-rig analyze`` does.

    Parameters
    ----------
    files : str, Path or iterable of them
        Names may have wildcards: "bench/*.tdms".
    **options
        What the files leave open, see `FileOptions`: ``rate="2.5 MHz"``, ``hammer_mass="100 g"``.

    Raises
    ------
    RigError
        If no file is a hit, or something must be said of them, and by which option.

    Warns
    -----
    UserWarning
        Of each file that is left out, why.

    Examples
    --------
    >>> read_files("nowhere/*.tdms", hammer_mass="100 g")
    Traceback (most recent call last):
    impact_rig.core.given.errors.FileError: no file is called like nowhere/*.tdms
    """
    # Formats of files take a tenth of a second to load.
    from impact_rig.analysis.measured_files import MeasuredFiles, make_series
    from impact_rig.files.import_file import read_options

    paths = list_files(files)
    with _speaking_python():
        source = MeasuredFiles(paths, make_series(read_options(options)))
        if not source.hits:
            raise FileError("; ".join(source.errors))
    for text in source.errors:
        warnings.warn(f"left out: {_say_in_python(text)}", stacklevel=2)
    return Run(source, str(paths[0]) if len(paths) == 1 else f"{paths[0]} and others")


class Session(Run):
    """Hits as arrays, one by one, and what they say so far.

    Parameters
    ----------
    samples : mapping of str to mass
        Names, each with its mass without accelerometer; None: not known, k and c are not either.
    hammer_mass : str or float, optional
        With a unit, or in kg.
    control : str
        The sample that is alike to the hammer: it gives k1; empty: none.
    rig_file : str or Path, optional
        In place of samples, masses and sensors.
    **options
        See `ArrayOptions`: ``accelerometer_mass="3 g"``, ``hammer_sensitivity="10 mV/g"``, and
        those of `Settings`.

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
        control: str = "",
        rig_file: str | Path | None = None,
        **options: Unpack[ArrayOptions],
    ) -> None:
        from impact_rig.analysis.measured_arrays import MeasuredArrays, read_setup

        settings: dict[str, Any] = {**options}
        known = {name: settings.pop(name, None) for name in _OF_ARRAYS}
        setup = read_setup(samples, hammer_mass, control, rig_file, **known)
        self._arrays = MeasuredArrays(setup, read_settings(settings))
        super().__init__(self._arrays, "session")

    def add(
        self,
        hammer: ArrayLike,
        specimen: ArrayLike | None = None,
        *,
        rate: Given = None,
        on: str,
        unit: str | None = None,
    ) -> None:
        """Take a hit, or several: all of them or, if one is refused, none.

        Parameters
        ----------
        hammer, specimen : array_like, shape (n,) or (hits, n), or a list of arrays
            Both channels at the same instants, with some baseline before the pulse. Without the
            specimen's there are contact times alone.
        rate : str or float
            "2.5 MHz", or a number in Hz; may be left out where the arrays have times (pandas,
            xarray), which are held against it.
        on : str
            The sample.
        unit : str, optional
            Of the hammer's numbers: "m/s^2" without it, "g", "V" with the session's sensitivities,
            or "N" of a force hammer, which without its mass gives contact times alone. The
            specimen's are accelerations in the same unit, or in m/s^2. Arrays of pint and astropy
            are converted; xarray's attribute `units` is read.

        Raises
        ------
        RigError
            If the arrays are no hit, cannot be averaged with those before, or have no such
            sample or unit.

        Warns
        -----
        UserWarning
            If the hammer does what no hammer does: a unit or a mass may be another one.
        """
        before = self._arrays.doubts
        self._arrays.add_arrays(hammer, specimen, rate=rate, on=on, unit=unit)
        for text in self._arrays.doubts if not before else ():
            warnings.warn(text, stacklevel=2)
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
    rate: Given = None,
    hammer_mass: Given = None,
    sample_mass: Given = None,
    control: bool = False,
    sample: str = "sample",
    unit: str | None = None,
    **options: Unpack[ArrayOptions],
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
        As `Session.add`, if a quantity cannot be meant, or if every hit is rejected, with the
        reasons.

    Examples
    --------
    >>> hit = VirtualRig(seed=7).strike("steel small")
    >>> found = estimate(hit.hammer, hit.specimen, rate="2.5 MHz", hammer_mass="100 g")
    >>> print(found.contact_time)
    169.7... µs, one hit
    """
    session = Session(
        {sample: sample_mass},
        hammer_mass=hammer_mass,
        control=sample if control else "",
        **options,
    )
    session.add(hammer, specimen, rate=rate, on=sample, unit=unit)
    found = session.results[sample]
    if not found.impacts_accepted:
        raise SignalError(f"{sample}: {'; '.join(found.remarks)}")
    return found


class VirtualRig:
    """A rig whose truth is known: the same seed gives the same hits.

    Parameters
    ----------
    rig_file : str or Path, optional
        Masses, samples and virtual rig; those of the paper without it.
    samples : mapping of str to mapping, optional
        Samples beside those of the rig, by the keys of a rig file's [[sample]]:
        ``{"mine": {"mass": "60 g", "material": "steel"}}``.
    **source
        In place of keys of [source], see `SourceKeys`: ``seed``; ``plant``, the physics:
        "published" (the paper's tables), "dynamics", "dynamics_printed" (the model with known
        truth), "contact" (metal on metal, Hertz with loss); ``faults``, the probability of each,
        for each hit; ``draw``, true masses, gains and clock are drawn within their ±, once for a
        seed; ``noise``, ``bits``, ``restitution`` and others.

    Raises
    ------
    RigError
        If the rig file cannot be read, or a value cannot be meant.

    Examples
    --------
    >>> rig = VirtualRig(seed=7, plant="contact")
    >>> hit = rig.strike("steel small")
    >>> hit.truth.exponent, round(hit.truth.restitution, 3)
    (1.5, 0.95)

    Which ± a sample will have that is not machined yet:

    >>> mine = {"mine": {"mass": "60 g", "material": "bronze"}}
    >>> planned = VirtualRig(samples=mine, plant="contact", bits=16)
    >>> planned.run(["mine", "aluminium large"], 5).analyze()["mine"].contact_time
    18... ± ... µs
    """

    def __init__(
        self,
        *,
        rig_file: str | Path | None = None,
        samples: Mapping[str, Mapping[str, Given]] | None = None,
        **source: Unpack[SourceKeys],
    ) -> None:
        rig = load_rig_file(rig_file)
        self.setup = add_samples(rig.setup, samples or {})
        keys = read_source_keys(source)
        self._rig = Simulation(self.setup, read_virtual_settings(rig.source, self.setup, keys))
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
        return Hit(block, truth=make_truth(hit))

    def find_truth(self, hit: Hit | HitResults | HitLabel) -> Truth:
        """Return the truth of a hit by its label, which does not depend on earlier hits."""
        label = getattr(hit, "label", hit)
        if not isinstance(label, HitLabel):
            raise ParameterError(f"hit is {hit!r:.40}: it must be a hit, or its `label`")
        return make_truth(self._rig.strike(label))

    def run(self, samples: str | Iterable[str] = (), impacts: int = 10) -> Run:
        """Strike samples, each so many times, as a campaign does; without names all samples.

        Raises
        ------
        ParameterError
            If there is no such sample, or `impacts` is no number of hits.
        """
        names = list_items(samples) or self.samples
        return Run(VirtualCampaign(self._rig, self.setup, names, impacts), "virtual rig")


def compare(
    first: Results | SampleResults | Run, second: Results | SampleResults | Run
) -> Comparison:
    """Return the changes from one run to another, and whether they exceed their uncertainty.

    A value changed where |En| is above 1 (ISO 13528, 9.7); `print` shows all. Results of one
    sample, as of `estimate`, are compared with those of the same name.

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
    pair = [_read_results(item) for item in (first, second)]
    tables = tabulate_changes(*(BatchCampaign(Path(item.name), 1, item.record) for item in pair))
    if not tables:
        named = (f"{item.name} ({', '.join(item)})" for item in pair)
        raise ParameterError(f"{' and '.join(named)} have no quantity in common")
    return Comparison(tables)


def _read_results(item: Any) -> Results:
    if isinstance(item, SampleResults):
        return item.as_results()
    if isinstance(item, Results):
        return item
    if isinstance(item, Run):
        return item.analyze()
    raise ParameterError(f"{item!r:.40} is neither a run nor results: open it by open_run")
