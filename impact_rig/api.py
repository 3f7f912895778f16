"""The rig as a Python library; `impact_rig` hands its names on.

Quantities that are given are texts with a unit, like "20 kHz", as in a rig file, or numbers in SI
units. What is wrong with any of them raises `RigError`, in one sentence.
"""

import io
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from glob import glob, has_magic
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.analysis.analyze import HitSource, analyze
from impact_rig.analysis.exporting import ExportedHit, read_campaigns
from impact_rig.analysis.measured_files import (
    MeasuredFiles,
    MeasuredHits,
    TraceSeries,
    make_series,
)
from impact_rig.analysis.sources import RunSource, find_run, read_runs
from impact_rig.configuration.rig_file import read_rig_file, read_settings
from impact_rig.configuration.units import Given, read_given
from impact_rig.core.errors import FileError, ParameterError, RigError, SignalError
from impact_rig.core.hits import NO_OVERRULES
from impact_rig.core.records import IMPORTED, Block, FloatArray, HitLabel, Origin
from impact_rig.core.setup import PAPER_SETUP, RigSetup, Sample, SampleSet
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import FaultPlan, VirtualHit, VirtualRigSettings
from impact_rig.devices.virtual.rig import VirtualRig as Simulation
from impact_rig.files.channels import map_channels
from impact_rig.files.import_file import MeasurementOptions
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.plan import ChannelPlan
from impact_rig.present.printed import Number, Printed, View
from impact_rig.present.sample_figures import draw_sample
from impact_rig.recordings.source import find_bag
from impact_rig.results.batch import BatchCampaign, tabulate_changes
from impact_rig.results.campaign import Results as CampaignResults
from impact_rig.results.numbers import format_count
from impact_rig.results.remarks import gather_remarks, gather_sample_remarks
from impact_rig.results.results_file import format_results_table, write_results
from impact_rig.results.tables import Table, tabulate_summary
from impact_rig.results.traces import (
    AlignedHit,
    SampleTraces,
    TracedCampaign,
    align_hit,
    compute_law_curves,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAN = math.nan
BLOCK_POINTS = 1000
"""Of a block of the virtual rig: a fault loses one of several."""


def _read_mass(what: str, value: Given) -> float:
    found = read_given(what, value, "kg", "100 g")
    return NAN if found is None else found


@contextmanager
def _use_one_thread() -> Iterator[None]:
    """Let linear algebra use one thread: several take four times as long, and round otherwise."""
    if find_spec("threadpoolctl") is None:
        yield
        return
    import scipy.linalg  # noqa: F401 - it has a library of its own, which must be there to be asked
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield


@dataclass(frozen=True)
class Truth:
    """What the virtual rig did; NaN: its plant has no such thing."""

    contact_time: float  # [s]; on the plant "contact" from first touch to separation
    peak_force: float  # [N]
    impact_speed: float  # [m/s]
    stiffness: float  # k2 of the sample [N/m]
    damping_coefficient: float  # c2 of the sample [N s/m]
    exponent: float  # n of the contact law [-]
    restitution: float  # e of the contact law [-]
    faults: tuple[str, ...]  # that were injected


def _make_truth(hit: VirtualHit) -> Truth:
    model, contact = hit.model, hit.contact
    return Truth(
        model.contact_time,
        model.peak_force,
        float(model.impact_speed),
        stiffness=model.specimen.stiffness if contact is None else NAN,
        damping_coefficient=model.specimen.damping_coefficient if contact is None else NAN,
        exponent=NAN if contact is None else contact.exponent,
        restitution=NAN if contact is None else contact.restitution,
        faults=tuple(fault.value for fault in hit.faults),
    )


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
    accepted: bool | None = None  # the hit is in the mean; None: nobody has judged it
    reasons: tuple[str, ...] = ()  # every reason against it
    truth: Truth | None = None  # of the virtual rig; None: not known
    filtered: AlignedHit | None = None  # `.time`, `.traces`: after baseline and low-pass

    @property
    def time(self) -> FloatArray:
        """From the first point [s], shape (n,)."""
        return np.arange(self.hammer.size) / self.rate

    def __repr__(self) -> str:
        """Return its name, and what was recorded."""
        bodies = "hammer" if self.specimen is None else "hammer and specimen"
        verdict = {None: "", True: ", accepted", False: f", rejected: {'; '.join(self.reasons)}"}
        return (
            f"{self.sample}/{self.impact}.{self.attempt}: {self.hammer.size} points of {bodies} at"
            f" {self.rate / 1e3:g} kHz{verdict[self.accepted]}"
        )


def _make_hit(block: Block, **known: Any) -> Hit:
    label, traces = block.label, [channel.acceleration for channel in block.channels]
    specimen = traces[1] if len(traces) > 1 else None
    place = label.sample, label.impact, label.attempt, label.record
    return Hit(*place, block.sampling_rate, traces[0], specimen, **known)


def _show_hit(hit: ExportedHit, truths: Mapping[HitLabel, Truth]) -> Hit:
    label, filtered = hit.record.label, hit.judged.filtered
    return _make_hit(
        hit.record,
        accepted=hit.accepted,
        reasons=tuple(map(str, hit.judged.rejections)),
        truth=truths.get(label),
        filtered=None if filtered is None else align_hit(label, filtered),
    )


class SampleResults(View):
    """What was found of one sample.

    Beside the quantities below it has all fields of the estimate: `contact_law`, `pulse_shape`,
    `free_decay`, `checks`, `half_amplitude_width`, `warnings`, `notes` …; `numbers` lists those
    that are determined.

    Examples
    --------
    >>> results = VirtualRig(seed=7).run(["steel small", "aluminium large"], 3).analyze()
    >>> steel = results["steel small"]
    >>> print(steel.contact_time, steel.impacts_accepted)
    170... ± ... µs 3
    >>> steel.stiffness.budget[0].source
    'mass of the accelerometer'
    """

    contact_time: Number  # tau_p [s]
    stiffness: Number  # k2 [N/m]
    damping_coefficient: Number  # c2 [N s/m]
    damping_ratio: Number  # zeta [-]
    equivalent_stiffness: Number  # k_eq [N/m]
    peak_force: Number  # [N]
    impacts_accepted: int
    impacts_rejected: int

    def __init__(self, name: str, campaign: TracedCampaign) -> None:
        found = {item.name: item for item in campaign.results.samples}
        if name not in found:
            known = ", ".join(map(repr, found))
            raise ParameterError(f"there is no sample {name!r}: there are {known}")
        super().__init__(found[name], name)
        self._campaign = campaign

    @property
    def remarks(self) -> list[str]:
        """What needs attention of it, a sentence each."""
        return [remark.text for remark in gather_sample_remarks(self.record)]

    @property
    def traces(self) -> SampleTraces:
        """The mean hit and the models, as arrays.

        `time` [s] and `mean` [m/s^2], shapes (n,) and (channels, n); `models`, each with `model`
        and `traces`; `compute_residual(model)`.

        Raises
        ------
        SignalError
            If no hit was accepted, or these are results alone, without their recording.
        """
        for item in self._campaign.samples:
            if item.name == self.name:
                return item
        raise SignalError(f"there are no traces of {self.name!r}: no hit of it was accepted, or"
                          " these are results without their recording")  # fmt: skip

    def plot(self) -> "Figure":
        """Draw hits, mean, models and residuals, and the contact's law.

        Returns
        -------
        matplotlib.figure.Figure
            A figure of pyplot: a notebook shows it, `savefig` writes it.

        Raises
        ------
        SignalError
            As `traces`.
        """
        traces, results = self.traces, self._campaign.results
        hits = [
            hit.aligned
            for hit in self._campaign.hits
            if hit.aligned is not None and hit.result.accepted and hit.result.sample == self.name
        ]
        curves = compute_law_curves(self.record.contact_law, traces, results.setup)
        return draw_sample(traces, hits, curves)


class Results(Printed, Mapping[str, SampleResults]):
    """What a campaign found, by sample; `print` shows it as the command line does.

    Examples
    --------
    >>> results = VirtualRig(seed=7).run(["aluminium large"], 3).analyze()
    >>> results
    1 sample, 3 hits accepted, 0 rejected; simulated (virtual rig, plant published)
    >>> list(results), results.hammer.stiffness.unit
    (['aluminium large'], 'MN/m')
    """

    def __init__(
        self, campaign: TracedCampaign, name: str = "results", warnings: Sequence[str] = ()
    ) -> None:
        self.record: CampaignResults = campaign.results
        self.name = name
        self._campaign = campaign
        self._warnings = tuple(warnings)

    def __getitem__(self, sample: str) -> SampleResults:
        """Return what was found of a sample; raises `ParameterError` for an unknown one."""
        return SampleResults(sample, self._campaign)

    def __contains__(self, sample: object) -> bool:
        """Return whether there is a sample of this name."""
        return any(item.name == sample for item in self.record.samples)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the samples."""
        return (item.name for item in self.record.samples)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.record.samples)

    def __repr__(self) -> str:
        """Return how much there is."""
        rejected = len(self.record.rejections)
        accepted = format_count(len(self.record.hits) - rejected, "hit")
        samples = format_count(len(self), "sample")
        return f"{samples}, {accepted} accepted, {rejected} rejected; {self.record.origin}"

    @property
    def hammer(self) -> View:
        """What the control sample says of the hammer: `stiffness` k1, `damping_coefficient` c1."""
        return View(self.record.hammer, "hammer")

    @property
    def warnings(self) -> list[str]:
        """What needs attention, a sentence each."""
        remarks = gather_remarks(self.record, self._warnings)
        return [f"{item.about}: {item.text}" if item.about else item.text for item in remarks]

    def list_tables(self) -> list[Table]:
        """Return what is printed."""
        return tabulate_summary(self.record)

    def to_dataframe(self) -> Any:
        """Return a row for each sample, with columns as in the CSV export, units in their names.

        Returns
        -------
        pandas.DataFrame or polars.DataFrame
            Of pandas if it is installed.

        Raises
        ------
        RigError
            If neither is installed.
        """
        text = io.StringIO(format_results_table([self.record]))
        for name in ("pandas", "polars"):
            if find_spec(name) is not None:
                return import_module(name).read_csv(text)
        raise RigError("to_dataframe needs pandas or polars: pip install pandas")

    def save(self, path: str | Path) -> None:
        """Write them as results.json; raises `FileError` if that cannot be written."""
        write_results(Path(path), self.record)


def use_results(record: CampaignResults, name: str) -> Results:
    """Return results without their recording, as they print themselves."""
    return Results(TracedCampaign(record), name)


class Run:
    """Hits with their set-up: of a recording, of files, of the virtual rig."""

    def __init__(
        self,
        source: HitSource,
        name: str,
        campaign: int | None = None,
        truths: Mapping[HitLabel, Truth] | None = None,
    ) -> None:
        self.name = name
        self._source = source
        self._campaign = campaign
        self._truths = truths or {}

    def _choose(self, campaigns: Sequence[Any]) -> Any:
        """Return the campaign that is meant."""
        if not campaigns:
            raise FileError(f"{self.name} holds no complete hit")
        number = self._campaign
        if number is None and len(campaigns) == 1:
            return campaigns[0]
        if number is None or not 1 <= number <= len(campaigns):
            raise ParameterError(
                f"{self.name} holds {format_count(len(campaigns), 'campaign')}: choose one with"
                f" campaign=1 to {len(campaigns)}"
            )
        return campaigns[number - 1]

    @cached_property
    @_use_one_thread()
    def hits(self) -> dict[str, tuple[Hit, ...]]:
        """All hits in their order, by sample, each with its verdict.

        Raises
        ------
        RigError
            If they cannot be read.
        """
        found: dict[str, list[Hit]] = {}
        for hit in self._choose(read_campaigns(self._source)).list_hits():
            found.setdefault(hit.record.label.sample, []).append(_show_hit(hit, self._truths))
        return {name: tuple(hits) for name, hits in found.items()}

    @_use_one_thread()
    def analyze(
        self,
        *,
        cutoff: Given = None,
        accept: str | Sequence[str] = (),
        reject: str | Sequence[str] = (),
        **settings: Given,
    ) -> Results:
        """Judge every hit and estimate, as ``impact-rig analyze`` does.

        Parameters
        ----------
        cutoff : str or float, optional
            Of the low-pass: "20 kHz", or a number in Hz; "off", or 0: none. As recorded.
        accept, reject : str or sequence of str
            Hits to take into the mean or to leave out: "steel small/3", or the record's number.
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
        accept, reject = ([item] if isinstance(item, str) else item for item in (accept, reject))
        chosen = read_settings({"cutoff_frequency": cutoff, **settings})
        found = analyze(self._source, chosen, accept, reject, keep_traces=True)
        return Results(self._choose(found.campaigns), self.name, found.warnings)

    def __repr__(self) -> str:
        """Return its name."""
        return f"run {self.name}"


class _StoredRun(Run):
    """Results alone, without the hits behind them."""

    def __init__(self, source: RunSource) -> None:
        self.name = source.title
        self._results = source

    @cached_property
    def hits(self) -> dict[str, tuple[Hit, ...]]:
        """Nothing of them is left."""
        raise FileError(f"{self._results.results} holds results alone: hits are in a recording")

    def analyze(self, **settings: Any) -> Results:
        """Return the results."""
        if settings:
            raise ParameterError(
                f"{', '.join(settings)} does not change {self._results.results}, a results file:"
                " open its recording"
            )
        (found,) = read_runs(self._results)
        return Results(found.campaign, self.name, found.warnings)


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
        If there is no such run.

    Examples
    --------
    >>> open_run("nowhere.mcap")
    Traceback (most recent call last):
    impact_rig.core.errors.FileError: nowhere.mcap does not exist
    """
    source = find_run(find_bag(Path(path)), namespace)
    if source.run is None:
        return _StoredRun(source)
    return Run(source.run, source.title, campaign)


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
        If a file is no hit, or does not say what is needed; the sentence says what would.
    """
    named = [files] if isinstance(files, str | Path) else list(files)
    paths = [Path(place) for item in named for place in _expand(str(item))]
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
    if source.errors:
        raise FileError("; ".join(source.errors))
    return Run(source, str(paths[0]) if len(paths) == 1 else f"{paths[0]} and others")


def _expand(name: str) -> list[str]:
    """Return the files that a name with wildcards means, or the name."""
    found = sorted(glob(name, recursive=True)) if has_magic(name) else [name]  # noqa: PTH207
    if not found:
        raise FileError(f"no file is called like {name}")
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
        chosen = read_settings({"cutoff_frequency": cutoff, **settings})
        if (samples is None) == (rig_file is None):
            raise ParameterError("a session needs either samples with their masses or a rig_file")
        if rig_file is not None:
            setup = read_rig_file(Path(rig_file)).setup
        else:
            masses = (Sample(name, _read_mass(f"mass of {name}", mass))
                      for name, mass in (samples or {}).items())  # fmt: skip
            known = read_given("hammer_stiffness", hammer_stiffness, "N/m", "22.5 MN/m")
            carried = read_given("accelerometer_mass", accelerometer_mass, "kg", "3 g") or 0.0
            setup = RigSetup(
                SampleSet(tuple(masses), control, carried),
                _read_mass("hammer_mass", hammer_mass),
                NAN,
                clock_uncertainty=0.0,
                hammer_stiffness=NAN if known is None else known,
            )
        setup = replace(setup, analysis=replace(setup.analysis, **chosen))
        self._start(TraceSeries("", ChannelPlan(), setup, is_filter_optional=cutoff is None))

    def _start(self, series: TraceSeries) -> None:
        self._series = _Arrays(Path("arrays"), series)
        super().__init__(self._series, "session")

    def add(
        self,
        hammer: ArrayLike,
        specimen: ArrayLike | None = None,
        *,
        rate: Given,
        on: str,
        unit: str = "m/s^2",
    ) -> None:
        """Take a hit.

        Parameters
        ----------
        hammer, specimen : array_like, shape (n,)
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
            If the arrays are no hit, or cannot be averaged with those before.
        """
        series = self._series.series
        series.setup.samples.find(on)
        number = len(self._series.hits) + 1
        counts = Counter(hit.block.label.sample for hit in self._series.hits)
        sampling_rate = read_given("rate", rate, "Hz", "2.5 MHz")
        bodies = {"hammer": (hammer, unit)}
        if specimen is not None:
            bodies["specimen"] = (specimen, "m/s^2" if unit == "N" else unit)
        channels = tuple(
            MeasuredChannel(name, _take_array(name, values), sampling_rate or NAN, of)
            for name, (values, of) in bodies.items()
        )
        (found,) = map_channels(
            Measurement(Path(f"hit {number}"), channels),
            series.plan,
            series.setup.hammer_mass,
            needs_scale=True,
        )
        label = HitLabel(on, number, counts[on] + 1)
        block = replace(
            found.block, label=label, origin=Origin(IMPORTED, "arrays"), last=True, first_sample=0
        )
        self._series.add(replace(found, block=block))
        self.__dict__.pop("hits", None)
        self.__dict__.pop("results", None)

    @cached_property
    def results(self) -> Results:
        """What all hits so far say; raises `RigError` if there are none."""
        return self.analyze()


class _Arrays(MeasuredHits):
    """Hits that come as arrays, of several samples."""

    @property
    def hammer_unit(self) -> None:
        """No hit is described by itself."""


def _take_array(name: str, values: ArrayLike) -> FloatArray:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} is {values!r:.40}: it must be an array of numbers") from None


def estimate(
    hammer: ArrayLike,
    specimen: ArrayLike | None = None,
    *,
    rate: Given,
    hammer_mass: Given = None,
    sample_mass: Given = None,
    accelerometer_mass: Given = None,
    control: bool = False,
    hammer_stiffness: Given = None,
    sample: str = "sample",
    unit: str = "m/s^2",
    cutoff: Given = None,
    **settings: Given,
) -> SampleResults:
    """Estimate contact time, stiffness and damping from arrays.

    Parameters
    ----------
    hammer, specimen : array_like, shape (n,) or (hits, n)
        One hit, or several, which are averaged; both channels alike.
    control : bool
        The sample is alike to the hammer: it gives k1 by itself.
    rate, unit
        As of `Session.add`.
    hammer_mass, sample_mass, accelerometer_mass, hammer_stiffness, cutoff, **settings
        As of `Session`. What is not given leaves out what follows from it.

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
        accelerometer_mass=accelerometer_mass,
        control=sample if control else "",
        hammer_stiffness=hammer_stiffness,
        rig_file=None,
        cutoff=cutoff,
        **settings,
    )
    rows = [None if item is None else np.atleast_2d(_take_array(name, item))
            for name, item in (("hammer", hammer), ("specimen", specimen))]  # fmt: skip
    hammers, specimens = rows
    if hammers is None or (specimens is not None and len(specimens) != len(hammers)):
        raise ParameterError("hammer and specimen must have as many hits each")
    for place, row in enumerate(hammers):
        other = None if specimens is None else specimens[place]
        session.add(row, other, rate=rate, on=sample, unit=unit)
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
        plants = [item.value for item in Plant]
        if plant not in plants:
            raise ParameterError(f"there is no plant {plant!r}: there are {', '.join(plants)}")
        self.setup = PAPER_SETUP if rig_file is None else read_rig_file(Path(rig_file)).setup
        settings = VirtualRigSettings(Plant(plant), seed=seed, faults=FaultPlan(faults))
        self._rig = Simulation(self.setup, settings)
        self._counts: Counter[str] = Counter()

    @property
    def samples(self) -> tuple[str, ...]:
        """Names of its samples."""
        return self.setup.samples.names

    def strike(self, sample: str) -> Hit:
        """Strike a sample once more, and return the hit with its truth; nobody judges it.

        Raises
        ------
        ParameterError
            If there is no such sample.
        """
        self.setup.samples.find(sample)
        self._counts[sample] += 1
        hit = self._rig.strike(HitLabel(sample, self._counts.total(), self._counts[sample]))
        (block,) = hit.split(hit.hammer.output.size, 0)
        return _make_hit(block, truth=_make_truth(hit))

    def find_truth(self, label: HitLabel) -> Truth:
        """Return what happens at a hit of this name, however often it is struck."""
        return _make_truth(self._rig.strike(label))

    def run(self, samples: Iterable[str] | None = None, impacts: int = 10) -> Run:
        """Strike samples, each so many times, as a campaign does; None: all samples.

        Raises
        ------
        ParameterError
            If there is no such sample.
        """
        names = self.samples if samples is None else tuple(samples)
        source = _Campaign(self.setup)
        truths: dict[HitLabel, Truth] = {}
        for name in names:
            self.setup.samples.find(name)
            for impact in range(1, impacts + 1):
                label = HitLabel(name, len(truths) + 1, impact)
                hit = self._rig.strike(label)
                truths[label] = _make_truth(hit)
                source.faults[label] = truths[label].faults
                source.blocks += hit.split(BLOCK_POINTS, 0)
        return Run(source, "virtual rig", truths=truths)


class _Campaign:
    """Hits of the virtual rig, as they were struck."""

    path, size, has_scale = Path("virtual rig"), 0, True
    hammer_unit: str | None = None
    warnings: tuple[str, ...] = ()

    def __init__(self, setup: RigSetup) -> None:
        self.setup = setup
        self.blocks: list[Block] = []
        self.faults: dict[HitLabel, tuple[str, ...]] = {}
        self.overrules = NO_OVERRULES

    def events(self, _report: Any) -> Iterator[RigSetup | Block]:
        """Yield the set-up and the hits."""
        yield self.setup
        yield from self.blocks


class Comparison(Printed):
    """What changed from one run to another."""

    def __init__(self, tables: list[Table]) -> None:
        self._tables = tables

    def list_tables(self) -> list[Table]:
        """Return what is printed."""
        return self._tables

    @property
    def changed(self) -> list[tuple[str, str]]:
        """Body and quantity of what changed beyond its uncertainty."""
        return [
            table.rows[place][:2]  # type: ignore[misc]
            for table in self._tables
            for place in sorted(table.marked)
        ]

    def __repr__(self) -> str:
        """Return how much changed."""
        count = sum(len(table.rows) for table in self._tables)
        return f"{len(self.changed)} of {count} values changed beyond their uncertainty"


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
    pair = [item.analyze() if isinstance(item, Run) else item for item in (first, second)]
    tables = tabulate_changes(*(BatchCampaign(Path(item.name), 1, item.record) for item in pair))
    if not tables:
        raise ParameterError(f"{pair[0].name} and {pair[1].name} have no quantity in common")
    return Comparison(tables)
