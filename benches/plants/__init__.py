"""Plants that nobody here wrote, as users of ``bha`` would meet them: logs, a tape-measure file, and the truth apart.

``mujoco_arm``: soft-robotic-arm 0.4.2 (MuJoCo). ``pcs_arm``: soromox (piecewise constant strain, JAX). Both come from
PyPI (dependency group ``bench``). See ``benches/plants/README.md``.
"""
