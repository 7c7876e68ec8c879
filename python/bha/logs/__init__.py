"""Measured logs: files, arrays and tables as columns in SI units; ``docs/reference/logs.md`` describes them.

``log``: the class. ``headings``, ``columns`` and ``units``: what a heading means, and what is refused.
``content``: what a log holds. ``formats`` and ``arrays``: files and tables in memory.
"""

from bha.logs.log import Log

__all__ = ["Log"]
