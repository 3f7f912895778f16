"""The contract of drivers as tests, for pytest: who writes a driver runs them on it.

A test module of the driver holds a class of this package, subclassed, with a fixture `bench` that
says how the device is made, struck and unplugged::

    from impact_rig.devices.contract.source_contract import AccelerationSourceContract
    from impact_rig.devices.contract.benches import SourceBench

    class MyBench(SourceBench):
        ...

    class TestMyDigitizer(AccelerationSourceContract):
        @pytest.fixture
        def bench(self):
            with MyBench() as bench:
                yield bench

What a bench cannot do is skipped, and the skip says so.
"""

import pytest

pytest.register_assert_rewrite(
    *(f"{__name__}.{name}_contract" for name in ("driver", "source", "holder"))
)
