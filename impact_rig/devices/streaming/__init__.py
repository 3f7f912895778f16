"""What drivers share whose device streams all the time: the trigger is in software."""
