"""The rig file of a laboratory, and the processes of a rig."""
