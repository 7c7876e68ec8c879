"""Simulate, identify, diagnose and control pneumatic bellows arms (Falkenhahn et al., IEEE T-RO 31(6), 2015)."""
