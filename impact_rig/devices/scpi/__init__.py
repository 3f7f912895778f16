"""Digitizers that speak SCPI over TCP."""
