"""What all tests share: generated input that is the same each time."""

import hypothesis

from impact_rig.configuration.threads import use_one_thread

use_one_thread()
hypothesis.settings.register_profile("rig", derandomize=True, deadline=None)
hypothesis.settings.load_profile("rig")
