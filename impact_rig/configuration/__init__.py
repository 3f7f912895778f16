"""What a rig consists of: the rig file of its owner, and the list of its processes."""
