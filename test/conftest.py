"""What all tests share: generated input that is the same each time."""

import hypothesis

hypothesis.settings.register_profile("rig", derandomize=True, deadline=None)
hypothesis.settings.load_profile("rig")
