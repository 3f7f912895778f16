"""What the command line and the file of channels say of measured files, together."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.analysis.settings_changes import SettingsChanges
from impact_rig.configuration.import_file import ImportFile, read_import_file
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.calibration import Sensitivity
from impact_rig.core.setup.channel_plan import ChannelPlan, ChannelUse
from impact_rig.core.setup.paper import IMPACT_SPEED
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.settings import AnalysisSettings

DEFAULT_NAME = "sample"
MASSES = ("hammer_mass", "sample_mass", "accelerometer_mass")


@dataclass(frozen=True)
class TraceOptions:
    """The options of measured files as given; None: not given.

    Attributes
    ----------
    channels : Path or None
        File that holds all of this, and goes after it.
    hammer, specimen : str or None
        Names or numbers of the channels.
    columns : str or None
        Roles, separated by commas.
    rate : float or None
        Sampling rate [Hz].
    hammer_unit, sample_unit : str or None
        Of the channels.
    hammer_sensitivity, sample_sensitivity : Sensitivity or None
        Of channels in V.
    hammer_full_scale, sample_full_scale : tuple of float and str, or None
        Largest value, with its unit.
    sample : str or None
        Name of the struck sample.
    rig_file : Path or None
        Masses and settings.
    hammer_mass, sample_mass, accelerometer_mass : float or None
        [kg]
    hammer_stiffness : float or None
        k1 [N/m].
    control : bool
        Hammer and sample are alike.
    """

    channels: Path | None = None
    hammer: str | None = None
    specimen: str | None = None
    columns: str | None = None
    rate: float | None = None
    hammer_unit: str | None = None
    sample_unit: str | None = None
    hammer_sensitivity: Sensitivity | None = None
    sample_sensitivity: Sensitivity | None = None
    hammer_full_scale: tuple[float, str] | None = None
    sample_full_scale: tuple[float, str] | None = None
    sample: str | None = None
    rig_file: Path | None = None
    hammer_mass: float | None = None
    sample_mass: float | None = None
    accelerometer_mass: float | None = None
    hammer_stiffness: float | None = None
    control: bool = False

    def make_series(self, changes: SettingsChanges) -> "TraceSeries":
        """Return what the files are taken for.

        Raises
        ------
        ParameterError
            If options contradict each other, or a value cannot be meant.
        FileError
            If the rig file or the file of channels cannot be used.
        """
        file = ImportFile() if self.channels is None else read_import_file(self.channels)
        name = self.sample or file.sample
        setup = (
            self._make_setup(file, name or DEFAULT_NAME)
            if self.rig_file is None
            else self._read_setup(self.rig_file, file, name)
        )
        stiffness = file.hammer_stiffness
        if self.hammer_stiffness is not None:
            stiffness = self.hammer_stiffness
            check_positive("--hammer-stiffness", stiffness, "N/m")
        if not math.isnan(stiffness) and (self.control or file.control):
            raise ParameterError("--hammer-stiffness and --control both give k1: choose one")
        analysis = changes.apply(replace(setup.analysis, **file.settings))
        return TraceSeries(
            name or DEFAULT_NAME,
            self._make_plan(file.plan),
            replace(setup, hammer_stiffness=stiffness, analysis=analysis),
            has_window="pre_trigger" in file.settings or "record_duration" in file.settings,
        )

    def _make_plan(self, plan: ChannelPlan) -> ChannelPlan:
        """Return what the file of channels says, changed by the options."""
        columns, uses = plan.columns, (plan.hammer, plan.specimen)
        if self.columns is not None:
            columns = tuple(role.strip() for role in self.columns.split(","))
            uses = (replace(plan.hammer, channel=""), replace(plan.specimen, channel=""))
        elif self.hammer is not None:
            columns = None
        hammer = _change_use(
            uses[0],
            self.hammer,
            self.hammer_unit,
            self.hammer_sensitivity,
            self.hammer_full_scale,
        )
        specimen = _change_use(
            uses[1],
            self.specimen,
            self.sample_unit,
            self.sample_sensitivity,
            self.sample_full_scale,
        )
        rate = plan.sampling_rate if self.rate is None else self.rate
        return ChannelPlan(hammer, specimen, columns, rate)

    def _read_setup(self, path: Path, file: ImportFile, name: str) -> RigSetup:
        masses = [getattr(source, mass) for source in (self, file) for mass in MASSES]
        given = any(mass is not None and not math.isnan(mass) for mass in masses)
        if given or self.control or file.control:
            raise ParameterError(
                "--rig-file gives the masses and the control sample: leave out --hammer-mass,"
                " --sample-mass, --accelerometer-mass and --control"
            )
        setup = read_rig_file(path).setup
        if not name:
            names = ", ".join(map(repr, setup.samples.names))
            raise ParameterError(f"--rig-file needs --sample, one of {names}")
        setup.samples.find(name)
        return setup

    def _make_setup(self, file: ImportFile, name: str) -> RigSetup:
        """Return the set-up that the masses make, NaN where they are not known."""
        hammer_mass, sample_mass, accelerometer_mass = (
            getattr(file, mass) if getattr(self, mass) is None else getattr(self, mass)
            for mass in MASSES
        )
        control = self.control or file.control
        if control and math.isnan(hammer_mass + sample_mass):
            raise ParameterError("--control needs both masses: --hammer-mass and --sample-mass")
        samples = SampleSet(
            (Sample(name, sample_mass),),
            control_sample=name if control else "",
            accelerometer_mass=0.0 if math.isnan(accelerometer_mass) else accelerometer_mass,
        )
        # Only the printed model depends on the impact speed, and only with a control sample.
        return RigSetup(
            samples, hammer_mass, IMPACT_SPEED, AnalysisSettings(), description=file.description
        )


@dataclass(frozen=True)
class TraceSeries:
    """What measured files are taken for: hits of one sample.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    plan : ChannelPlan
        Which channel is what.
    setup : RigSetup
        Masses and settings.
    has_window : bool
        Pre-trigger and duration of the records are given; False: each file is a record, whole.
    is_filter_optional : bool
        The low-pass is left out where the sampling is too slow for it; False: such a file is
        refused.
    """

    sample: str
    plan: ChannelPlan
    setup: RigSetup
    has_window: bool = False
    is_filter_optional: bool = False


def _change_use(
    use: ChannelUse,
    channel: str | None,
    unit: str | None,
    sensitivity: Sensitivity | None,
    full_scale: tuple[float, str] | None,
) -> ChannelUse:
    largest, largest_unit = full_scale or (use.full_scale, use.full_scale_unit)
    return ChannelUse(
        use.channel if channel is None else channel,
        use.unit if unit is None else unit,
        sensitivity or use.sensitivity,
        largest,
        largest_unit,
    )
