"""From measured logs into the model, through one door.

``Recording(arm, log)`` decides once, for every command, what drives the arm, what was measured of it and where, and
what each sample is worth; ``docs/reference/recordings.md`` explains it.
"""

from bha.recordings.outputs import Observation, Output
from bha.recordings.pressures import PressureChoice, PressureSort
from bha.recordings.recording import Recording, recordings
from bha.recordings.samples import ChannelFacts

__all__ = ["ChannelFacts", "Observation", "Output", "PressureChoice", "PressureSort", "Recording", "recordings"]
