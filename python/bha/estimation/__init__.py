"""Estimation: from records of logs to parameters; what identification and diagnosis both stand on.

Records (logs as residuals see them), free parameters, predictions of many parameter sets over many windows, least
squares over parameters and initial states, the joint fit with how well it is known; held poses and steady stretches.
"""

from bha.support.extras import import_extra

# Said once, here: all rooms above that compute with SciPy import this one first.
import_extra("scipy", extra="identify", purpose="Checking logs, identification and diagnosis")
