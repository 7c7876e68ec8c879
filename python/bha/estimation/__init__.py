"""Estimation: from records of logs to parameters; what identification and diagnosis both stand on.

Records (logs as residuals see them), free parameters, predictions of many parameter sets over many windows, least
squares over parameters and initial states, the joint fit with how well it is known; held poses and steady stretches.
"""
