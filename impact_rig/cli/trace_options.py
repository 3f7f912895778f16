"""What the command line says of plain traces, turned into a task."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.cli.settings_changes import SettingsChanges
from impact_rig.cli.trace_analysis import TraceTask
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.paper import IMPACT_SPEED
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.recording.traces import TraceFormat, find_scale

DEFAULT_NAME = "sample"


@dataclass(frozen=True)
class TraceOptions:
    """The options of plain traces as given; None: not given.

    Attributes
    ----------
    columns : str or None
        Roles, separated by commas.
    rate : float or None
        Sampling rate [Hz].
    hammer_unit, sample_unit : str
        Of the columns.
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
    accept, reject : tuple of str
        Files taken into the mean or left out by hand.
    """

    columns: str | None
    rate: float | None
    hammer_unit: str
    sample_unit: str
    sample: str | None
    rig_file: Path | None
    hammer_mass: float | None
    sample_mass: float | None
    accelerometer_mass: float | None
    hammer_stiffness: float | None
    control: bool
    accept: tuple[str, ...]
    reject: tuple[str, ...]

    def make_task(self, changes: SettingsChanges) -> TraceTask:
        """Return how to evaluate the traces.

        Raises
        ------
        ParameterError
            If options contradict each other, or a value cannot be meant.
        FileError
            If the rig file cannot be used.
        """
        if self.hammer_stiffness is not None:
            check_positive("--hammer-stiffness", self.hammer_stiffness, "N/m")
            if self.control:
                raise ParameterError("--hammer-stiffness and --control both give k1: choose one")
        setup = self._make_setup() if self.rig_file is None else self._read_setup(self.rig_file)
        settings = changes.apply(setup.analysis if setup else AnalysisSettings())
        mass = setup.hammer_mass if setup else self.hammer_mass
        # Widths do not depend on the scale: a force without a mass is good for contact times.
        has_scale = self.hammer_unit != "N" or mass is not None
        return TraceTask(
            sample=self.sample or DEFAULT_NAME,
            layout=TraceFormat(
                columns=self._split_columns(),
                sampling_rate=self.rate,
                hammer_scale=find_scale(self.hammer_unit, mass) if has_scale else 1.0,
                specimen_scale=find_scale(self.sample_unit),
            ),
            settings=settings,
            setup=replace(setup, analysis=settings) if setup else None,
            hammer_stiffness=math.nan if self.hammer_stiffness is None else self.hammer_stiffness,
            has_scale=has_scale,
            accept=self.accept,
            reject=self.reject,
        )

    def _split_columns(self) -> tuple[str, ...] | None:
        if self.columns is None:
            return None
        return tuple(role.strip() for role in self.columns.split(","))

    def _read_setup(self, path: Path) -> RigSetup:
        masses = (self.hammer_mass, self.sample_mass, self.accelerometer_mass)
        if any(mass is not None for mass in masses) or self.control:
            raise ParameterError(
                "--rig-file gives the masses and the control sample: leave out --hammer-mass,"
                " --sample-mass, --accelerometer-mass and --control"
            )
        setup = read_rig_file(path).setup
        if self.sample is None:
            names = ", ".join(map(repr, setup.samples.names))
            raise ParameterError(f"--rig-file needs --sample, one of {names}")
        setup.samples.find(self.sample)
        return setup

    def _make_setup(self) -> RigSetup | None:
        """Return the set-up that the masses make; None: they are not all given."""
        if self.hammer_mass is not None:
            check_positive("--hammer-mass", self.hammer_mass, "kg")
        if self.hammer_mass is None or self.sample_mass is None:
            if self.control:
                raise ParameterError(
                    "--control needs both masses: --hammer-mass and --sample-mass"
                )
            return None
        name = self.sample or DEFAULT_NAME
        samples = SampleSet(
            (Sample(name, self.sample_mass),),
            control_sample=name if self.control else "",
            accelerometer_mass=self.accelerometer_mass or 0.0,
        )
        # Only the printed model depends on the impact speed, and only with a control sample.
        return RigSetup(samples, self.hammer_mass, IMPACT_SPEED)
