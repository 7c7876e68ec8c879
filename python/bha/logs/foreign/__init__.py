"""Logs in formats that name their columns in ways of their own: ROS bags, MCAP, MATLAB, HDF5, exports.

A mapping file says what of such a file is which channel of a log. ``mapping.py`` reads it. ``kinds.py`` tells formats
by their first bytes; ``bags.py`` with ``messages.py``, ``matlab.py`` and ``hdf5.py`` with ``arrays_of.py`` list what a
file has and read what is mapped; ``series.py`` is what they give back; ``merge.py`` makes one table of series with
clocks of their own; ``skeleton.py`` proposes a mapping; ``read.py`` is the way through all of them.
"""
