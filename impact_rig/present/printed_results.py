"""Results of a campaign as a Python shell or a notebook shows them."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impact_rig.core.estimates.checks import Checks
from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.pulse_shape import PulseShapeEstimate
from impact_rig.core.estimates.ringing import FreeDecayEstimate
from impact_rig.core.estimates.uncertainty import compute_covariances
from impact_rig.core.given.errors import ParameterError, RigError, SignalError, check_name
from impact_rig.core.given.findings import Note
from impact_rig.present.printed import Number, Printed, View, make_frame, tabulate_numbers
from impact_rig.present.sample_figures import draw_into, draw_sample
from impact_rig.results.campaign import HitResults
from impact_rig.results.campaign import Results as CampaignResults
from impact_rig.results.numbers import ONE_HIT, format_count
from impact_rig.results.remarks import NO_RESULT, gather_remarks, gather_sample_remarks
from impact_rig.results.results_file import format_results_table, read_path, write_results
from impact_rig.results.table import Table
from impact_rig.results.tables import tabulate_summary
from impact_rig.results.traces import SampleTraces, TracedCampaign, compute_law_curves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class LawResults(View, of=ContactLaw):
    """The contact law of one sample, F = k δⁿ + c δᵐ δ'."""

    exponent: Number  # n [-]
    stiffness: Number  # k [N/m^n]
    damping: Number
    impact_speed: Number  # v, by the law [m/s]
    duration: Number  # from first touch to separation [s]
    restitution: Number  # e [-]
    peak_force: Number  # [N]
    peak_indentation: Number  # [m]
    impulse: Number  # [N s]
    energy_loss: Number
    equivalent_stiffness: Number  # [N/m]
    form: str
    loss: float
    pull: float
    residual_percent: float
    notes: tuple[Note, ...]


class DecayResults(View, of=FreeDecayEstimate):
    """The free decay of one sample behind the contact."""

    stiffness: Number  # [N/m]
    damping_ratio: Number  # [-]
    damping_coefficient: Number  # [N s/m]
    frequency: float  # [Hz]
    periods: float
    r_squared: float
    residual_over_noise: float
    hold: str


class ShapeResults(View, of=PulseShapeEstimate):
    """The shape of one sample's pulse."""

    best_shape: str
    is_clear: bool
    fall_over_rise: float
    fits: tuple[Any, ...]


class ChecksResults(View, of=Checks):
    """What the momenta of one sample's hits say of sensors and masses."""

    momentum_ratio: Number
    impulse: Number  # [N s]
    impact_speed: Number  # [m/s]
    stated_restitution: Number
    separation_restitution: Number
    traced_mass: Number  # [kg]
    stated_mass: float  # [kg]
    persistence: float
    hold: str


class HammerResults(View, of=HammerEstimate):
    """The hammer, from the control sample."""

    stiffness: Number  # k1 [N/m]
    damping_ratio: Number
    damping_coefficient: Number  # c1 [N s/m]
    log_decrement: float
    notes: tuple[Note, ...]
    control_sample: str


class SampleResults(View):
    """Results of one sample.

    It has all fields of the estimate; `numbers` lists those that are determined.

    Examples
    --------
    >>> import impact_rig as ir
    >>> results = ir.VirtualRig(seed=7).run(["steel small", "aluminium large"], 3).analyze()
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
    half_amplitude_width: Number  # w50 [s]
    base_width: Number  # [s]
    impacts_accepted: int
    impacts_rejected: int
    contact_time_spread: float  # standard deviation from hit to hit [s]
    width_ratio: float
    rise_time: float  # [s]
    log_decrement: float
    hammer_peak: float  # of the mean traces [m/s^2]
    specimen_peak: float
    hammer_peak_spread_percent: float
    mse_hammer_percent: float
    mse_sample_percent: float
    contact_law: LawResults
    free_decay: DecayResults
    pulse_shape: ShapeResults
    checks: ChecksResults
    warnings: tuple[Note, ...]
    notes: tuple[Note, ...]

    def __init__(self, name: str, campaign: TracedCampaign) -> None:
        found = {item.name: item for item in campaign.results.samples}
        check_name("sample", name, found)
        super().__init__(found[name], name, ONE_HIT * (found[name].impacts_accepted == 1))
        self._campaign = campaign

    @property
    def remarks(self) -> list[str]:
        """Its remarks, a sentence each, then the reasons of its rejected hits."""
        rejected = (
            f"hit {hit.impact}.{hit.attempt} is rejected: {'; '.join(map(str, hit.reasons))}"
            for hit in self._campaign.results.rejections
            if hit.sample == self.name
        )
        return [*(remark.text for remark in gather_sample_remarks(self.record)), *rejected]

    def list_tables(self) -> list[Table]:
        """Return its quantities, the contact law's among them, with its remarks."""
        law = {f"contact_law.{key}": item for key, item in self.contact_law.numbers.items()}
        return [tabulate_numbers(self.name, self.numbers | law, self.remarks)]

    def as_results(self) -> "Results":
        """Return it as results of one sample."""
        record = replace(self._campaign.results, samples=(self.record,))
        return Results(replace(self._campaign, results=record), self.name)

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
        found = self._campaign.find_traces(self.name)
        if found is None:
            raise SignalError(
                f"there are no traces of {self.name!r}: no hit of it was accepted, or these are"
                " results without their recording"
            )
        return found

    def plot(self, ax: "Axes | None" = None) -> "Figure":
        """Draw hits, mean, models and residuals, and the contact's law.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Of a figure of yours: the hammer's traces alone are drawn into it.

        Returns
        -------
        matplotlib.figure.Figure
            A figure of pyplot: a notebook shows it, `savefig` writes it.

        Raises
        ------
        SignalError
            As `traces`.
        """
        traces = self.traces
        curves = compute_law_curves(self.record.contact_law, traces, self._campaign.results.setup)
        hits = self._campaign.list_aligned(self.name)
        if ax is not None:
            return draw_into(ax, traces, hits, curves)
        return draw_sample(traces, hits, curves)


class Results(Printed, Mapping[str, SampleResults]):
    """Results of a campaign, by sample; `print` shows them as the command line does.

    Examples
    --------
    >>> import impact_rig as ir
    >>> results = ir.VirtualRig(seed=7).run(["aluminium large"], 3).analyze()
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
        """Return the results of a sample; `RigError`, also a `KeyError`, if unknown."""
        return SampleResults(sample, self._campaign)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the samples."""
        return (item.name for item in self.record.samples)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.record.samples)

    def __repr__(self) -> str:
        """Return how much there is."""
        samples = format_count(len(self), "sample")
        return f"{samples}, {self.record.count_hits()}; {self.record.origin}"

    @property
    def hammer(self) -> HammerResults:
        """The hammer, from the control sample: `stiffness` k1, `damping_coefficient` c1."""
        return HammerResults(self.record.hammer, "hammer")

    @property
    def warnings(self) -> list[str]:
        """The remarks, a sentence each."""
        return [str(remark) for remark in gather_remarks(self.record, self._warnings)]

    def list_tables(self) -> list[Table]:
        """Return the printed tables, with the reasons where a sample has no accepted hit."""
        remarks = gather_remarks(self.record)
        missing = [str(remark) for remark in remarks if remark.effect == NO_RESULT]
        tables = tabulate_summary(self.record)
        return [replace(table, notes=(*table.notes, *missing)) for table in tables]

    def to_dataframe(self) -> Any:
        """Return a row for each sample, with columns as in the CSV export, units in their names.

        Returns
        -------
        pandas.DataFrame or polars.DataFrame
            Of pandas if it is installed: its rows are found by the name of the sample.

        Raises
        ------
        RigError
            If neither is installed.
        """
        rows = csv.DictReader(io.StringIO(format_results_table([self.record])))
        return make_frame([*rows], "name")

    def hits_to_dataframe(self) -> Any:
        """Return a row for each hit, in SI units, with its reasons if it is rejected; as above."""
        return make_frame([_describe_hit(hit) for hit in self.record.hits], "sample")

    def to_uncertainties(self) -> dict[str, dict[str, Any]]:
        """Return what can be calculated with as numbers of the library uncertainties, by sample.

        Their correlations are kept, also those between samples. The hammer's are there, too.

        Raises
        ------
        RigError
            If that library is not installed.
        """
        if find_spec("uncertainties") is None:
            raise RigError("to_uncertainties needs uncertainties: pip install uncertainties")
        bodies: dict[str, View] = {**self, "hammer": self.hammer}
        known = {
            (body, name): number
            for body, view in bodies.items()
            for name, number in view.numbers.items()
            if number.number is not None
        }
        numbers = [number.uncertain for number in known.values()]
        covariance = compute_covariances(numbers)
        values = [float(number.x) for number in numbers]
        made = import_module("uncertainties").correlated_values(values, covariance)
        found: dict[str, dict[str, Any]] = {}
        for (body, name), number in zip(known, made, strict=True):
            found.setdefault(body, {})[name] = number
        return found

    def save(self, path: str | Path) -> None:
        """Write them as results.json, or as the table of the CSV export, by the path's suffix.

        Raises
        ------
        RigError
            If it has another suffix, or cannot be written.
        """
        place = read_path("path", path)
        if place.suffix not in (".json", ".csv"):
            raise ParameterError(f"results are saved as .json or .csv, not as {place}")
        write_results(place, self.record)


def _describe_hit(hit: HitResults) -> dict[str, Any]:
    """Return a hit's columns, those with a number or a text."""
    plain = {
        key: value for key, value in vars(hit).items() if isinstance(value, float | int | str)
    }
    return {**plain, "reasons": "; ".join(map(str, hit.reasons))}


class Comparison(Printed):
    """Changes from one run to another."""

    def __init__(self, tables: list[Table]) -> None:
        self._tables = tables

    def list_tables(self) -> list[Table]:
        """Return the printed tables."""
        return self._tables

    @property
    def changed(self) -> list[tuple[str, str]]:
        """Body and quantity of what changed beyond its uncertainty."""
        return [
            (table.rows[place][0], table.rows[place][1])
            for table in self._tables
            for place in sorted(table.marked)
        ]

    def to_dataframe(self) -> Any:
        """Return a row for each quantity, as printed; as `Results.to_dataframe`."""
        names = [column.header for table in self._tables[:1] for column in table.columns]
        rows = [dict(zip(names, row, strict=True)) for table in self._tables for row in table.rows]
        return make_frame(rows, "Body")

    def __repr__(self) -> str:
        """Return how much changed."""
        count = sum(len(table.rows) for table in self._tables)
        return f"{len(self.changed)} of {count} values changed beyond their uncertainty"
