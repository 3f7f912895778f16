"""Drivers of devices as the command line shows and tries them."""
