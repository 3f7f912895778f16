"""What every driver does, whatever its device is for, as tests; see the package's docstring."""

from typing import ClassVar

import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.devices.contract.benches import Bench
from impact_rig.devices.drivers import COMMON_KEYS

PATIENCE = 20.0
"""How long a device may take for what it should do at once, before a test fails [s]."""
LATE = 3.0
"""How much later than its time-out a call may return on a busy computer [s]."""
CYCLES = 20
"""How often a device is unplugged and comes back."""


class DriverContract:
    """Tests of one driver.

    Attributes
    ----------
    group : str
        Its entry point group.
    table : str
        Of the rig file.
    """

    group: ClassVar[str]
    table: ClassVar[str]

    def test_it_says_what_it_is_for_and_gives_an_example_that_it_takes(self, bench: Bench) -> None:
        driver = bench.get_driver()
        assert driver.description
        table = parse_toml_table(driver.example).take_table(self.table)
        assert table["driver"]
        driver(table.without(*COMMON_KEYS[self.group]))

    def test_a_key_that_it_does_not_know_is_refused_by_name(self, bench: Bench) -> None:
        with pytest.raises(ParameterError, match="colour"):
            bench.get_driver()(TomlTable({"colour": "red"}, f"[{self.table}]"))

    def test_a_search_finds_devices_or_says_what_is_missing(self, bench: Bench) -> None:
        try:
            devices = bench.get_driver().find_devices()
        except (DeviceError, ModuleNotFoundError) as error:
            check_sentence(error)
        else:
            assert all(device.address for device in devices)


def check_sentence(error: BaseException) -> None:
    """Require one sentence for people."""
    text = str(error)
    assert text
    assert "\n" not in text
    assert "Traceback" not in text
