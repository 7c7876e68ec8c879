"""The wide blind world: arms, files, sensors, pressures, disturbances, programmes and hidden physics as users have
them.

One subject a file; see ``benches/blind/README.md``. Nothing here imports ``bha``.
"""
