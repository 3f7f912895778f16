"""The command line ``impact-rig``."""
