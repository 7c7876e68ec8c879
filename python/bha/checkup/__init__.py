"""Whether logs and an arm's file belong together: ``bha.check(arm, logs)``; ``docs/guides/check.md`` explains it."""

from bha.checkup.checkup import Checkup, check, check_recordings, checked, repaired
from bha.checkup.finding import Explanation, Finding

__all__ = ["Checkup", "Explanation", "Finding", "check", "check_recordings", "checked", "repaired"]
