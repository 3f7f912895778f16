"""Devices of National Instruments: NI-DAQmx of this computer, or behind NI's gRPC server."""
