"""Files of other instruments: which channel is what, and recordings of them."""
