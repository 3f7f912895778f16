"""Analysis settings that the command line gives in place of others."""

from dataclasses import asdict, dataclass, replace

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
    double_hit_level : float or None
        Second pulse that makes a double hit, part of the first [-].
    keep_hits : int or None
        How many hits of a sample are averaged at most [-]; 0: all.
    """

    cutoff_frequency: float | None = None
    pulse_factor: float | None = None
    double_hit_level: float | None = None
    keep_hits: int | None = None

    def apply(self, settings: AnalysisSettings) -> AnalysisSettings:
        """Return the changed settings; raises `ParameterError` for impossible ones."""
        given = {name: value for name, value in asdict(self).items() if value is not None}
        return replace(settings, **given)
