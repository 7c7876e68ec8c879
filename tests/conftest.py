"""Property tests follow a fixed profile: the same examples everywhere, and no clock judges them.

``HYPOTHESIS_PROFILE=long`` tries many more examples, drawn anew each time.
"""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("fixed", deadline=None, derandomize=True)
settings.register_profile("long", deadline=None, derandomize=False, max_examples=20_000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))
