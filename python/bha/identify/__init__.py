"""Identification: from measured logs to the parameters of an arm, with how well they are known."""

from bha.identify.free import FreeParameter, default_free
from bha.identify.records import Record, frozen_spans, record
from bha.identify.refine import Refinement, Settings, refine

__all__ = ["FreeParameter", "Record", "Refinement", "Settings", "default_free", "frozen_spans", "record", "refine"]
