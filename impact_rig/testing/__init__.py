"""For authors of drivers: the contract of drivers as tests, and peers in place of instruments."""

import sys

if "pytest" in sys.modules:
    # Assertions of the contract show their values, as those of a test module do.
    sys.modules["pytest"].register_assert_rewrite(f"{__name__}.contract")
