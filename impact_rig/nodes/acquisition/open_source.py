"""The source that a rig file names, opened as the node's parameters say."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from impact_rig.configuration.calibration_warnings import find_rig_warnings
from impact_rig.configuration.rig_file import RigFile
from impact_rig.core.errors import FileError, RigError
from impact_rig.devices.acceleration_source import (
    AccelerationSource,
    Acquisition,
    AcquisitionPlan,
    SimulatedSource,
)
from impact_rig.devices.drivers import SOURCES, VIRTUAL, make_device, read_driver_name
from impact_rig.devices.source_table import make_plan
from impact_rig.devices.virtual.source import VirtualSource, make_virtual_plan
from impact_rig.nodes.acquisition.block_output import BlockOutput
from impact_rig.nodes.acquisition.hit_blocks import HitBlocks
from impact_rig.nodes.acquisition.running_stream import RunningStream
from impact_rig.nodes.acquisition.virtual_rig_parameters import read_virtual_rig
from impact_rig.nodes.device_node import DeviceNode


@dataclass(frozen=True)
class OpenSource:
    """A configured source.

    Attributes
    ----------
    source : AccelerationSource
        Of whichever driver.
    plan : AcquisitionPlan
        What it was asked to do.
    acquisition : Acquisition
        What it is, and does.
    """

    source: AccelerationSource
    plan: AcquisitionPlan
    acquisition: Acquisition

    @property
    def simulated(self) -> SimulatedSource | None:
        """The source, if it must be told when a hammer would strike."""
        return self.source if isinstance(self.source, SimulatedSource) else None

    def make_output(self, publisher: Any) -> BlockOutput:
        """Return what publishes its blocks."""
        rate, plan = self.acquisition.sampling_rate, self.plan
        if plan.continuous:
            return RunningStream(publisher, rate, plan.block_size)
        return HitBlocks(publisher, rate, plan.block_size, round(rate * plan.record_duration))


def open_source(node: DeviceNode, *, continuous: bool) -> OpenSource:
    """Open the source of the node's rig file; without one, the virtual rig.

    Parameters
    ----------
    node : DeviceNode
        The accelerometers', whose parameters describe the stream and the virtual rig.
    continuous : bool
        Without a trigger.

    Raises
    ------
    RigError
        If the rig file cannot be read or meant, or the device does not do what it says.
    ModuleNotFoundError
        If the vendor's library is missing.
    """
    file = node.read_rig_file()
    for warning in find_rig_warnings(file.setup):
        node.get_logger().warning(warning)
    with _name_file(node.get_value("rig_file")):
        source, plan = _make_source(node, file, continuous=continuous)
        try:
            acquisition = source.configure(plan)
        except BaseException:
            source.close()
            raise
    return OpenSource(source, plan, acquisition)


def _make_source(
    node: DeviceNode, file: RigFile, *, continuous: bool
) -> tuple[AccelerationSource, AcquisitionPlan]:
    stream: dict[str, Any] = {
        "continuous": continuous,
        "block_size": node.get_value("stream_block_size" if continuous else "block_size"),
        "depth": node.get_value("stream_depth"),
    }
    table, settings = file.source, read_virtual_rig(node)
    if read_driver_name(table) == VIRTUAL:
        source: AccelerationSource = VirtualSource(table.without("driver"), settings)
    else:
        source = make_device(SOURCES, table)
    if isinstance(source, SimulatedSource):
        # It has no sensors that the file could describe.
        return source, make_virtual_plan(settings.digitizer, **stream)
    return source, make_plan(table, file.setup, **stream)


@contextlib.contextmanager
def _name_file(path: str) -> Iterator[None]:
    """Let errors that name a line name the rig file, too."""
    try:
        yield
    except RigError as error:
        if path and str(error).startswith("line "):
            raise FileError(f"rig file {path}: {error}") from None
        raise
