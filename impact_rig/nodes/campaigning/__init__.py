"""What a campaign is made of: a rig that is ready, pauses, one hit after the other."""
