"""One driver's search for devices: ``python -m impact_rig.cli.device_search GROUP NAME``.

In a process of its own, since a vendor's library may hang or crash. Prints one JSON object.
"""

import contextlib
import json
import sys
from typing import Any

from impact_rig.core.errors import RigError
from impact_rig.devices.drivers import find_driver


def search(group: str, name: str) -> dict[str, Any]:
    """Return what a driver says of itself, what it finds, and what keeps it from searching."""
    answer: dict[str, Any] = {
        "description": "", "example": "", "devices": [], "trouble": "", "missing": "",
    }  # fmt: skip
    try:
        driver = find_driver(group, name).load()
        answer["description"], answer["example"] = str(driver.description), str(driver.example)
        answer["devices"] = [
            (str(device.address), str(device.identity)) for device in driver.find_devices()
        ]
    except ModuleNotFoundError as error:
        answer["missing"] = error.name or ""
        answer["trouble"] = f"the Python package {error.name!r} is not installed"
    except RigError as error:
        answer["trouble"] = str(error)
    except Exception as error:  # noqa: BLE001 - a driver of others may raise anything
        answer["trouble"] = f"its search for devices failed: {type(error).__name__}: {error}"
    return answer


def main() -> None:
    """Search, and print what was found as JSON; what the driver prints goes elsewhere."""
    with contextlib.redirect_stdout(sys.stderr):
        answer = search(sys.argv[1], sys.argv[2])
    print(json.dumps(answer))  # the answer to the process that asked


if __name__ == "__main__":
    main()
