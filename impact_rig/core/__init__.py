"""Impact physics and estimation: numpy, scipy and GTC, no clock, no ROS.

The method is that of "An evaluation of a simple dynamical model for impacts between rigid
objects": equations and tables are numbered as there.
"""
