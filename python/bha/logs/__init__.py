"""Measured logs: files, arrays and tables as columns in SI units; ``docs/reference/logs.md`` describes them.

``log``: the class. ``headings``, ``columns`` and ``units``: what a heading means, and what is refused.
``content``: what a log holds. ``formats`` and ``arrays``: files and tables in memory. ``foreign``: formats that need a
mapping file. ``conversion``: from any of them to CSV or Parquet.
"""

from bha.logs.conversion import Converted, convert
from bha.logs.log import Log

__all__ = ["Converted", "Log", "convert"]
