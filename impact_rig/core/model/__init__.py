"""Force pulses and the two-body model in closed form."""
