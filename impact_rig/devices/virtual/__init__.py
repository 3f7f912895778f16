"""The virtual rig: what stands in for hammer, sample, sensors and digitizer."""
