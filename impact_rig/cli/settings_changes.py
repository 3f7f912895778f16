"""Analysis settings that the command line gives in place of others."""

from dataclasses import dataclass, replace

from impact_rig.core.setup.settings import AnalysisSettings


@dataclass(frozen=True)
class SettingsChanges:
    """Settings to use instead of the recorded or the default ones; None: keep those.

    Attributes
    ----------
    cutoff_frequency : float or None
        [Hz]; 0: no filter.
    pulse_factor : float or None
        F in tau_p = F * w50 [-].
    """

    cutoff_frequency: float | None = None
    pulse_factor: float | None = None

    def apply(self, settings: AnalysisSettings) -> AnalysisSettings:
        """Return the changed settings; raises `ParameterError` for impossible ones."""
        if self.cutoff_frequency is not None:
            settings = replace(settings, cutoff_frequency=self.cutoff_frequency)
        if self.pulse_factor is not None:
            settings = replace(settings, pulse_factor=self.pulse_factor)
        return settings
