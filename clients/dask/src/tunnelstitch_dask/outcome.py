"""Ends of attempts to run a task, and their causes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum

DONE = 0
NOT_USABLE = 4
TEMPORARY = 75
INTERRUPTED = 130

# The place of the log may contain any word.
_LOG = re.compile(r"; see .*", re.DOTALL)
_PATTERNS = {
    "BUSY": re.compile(r"running already"),
    "TIME_LIMIT": re.compile(r"limit of [\d.]+ seconds|time limit"),
    "MEMORY": re.compile(r"\bmemory\b|\bsignal 9\b", re.IGNORECASE),
}


class Cause(str, Enum):
    """Reason of a failure that may not happen again."""

    BUSY = "running already"
    TIME_LIMIT = "time limit"
    MEMORY = "memory or signal 9"
    WORKER_LOST = "worker lost"
    OTHER = "other"


@dataclass(frozen=True)
class Outcome:
    """The end of an attempt, as a worker states it."""

    task: str
    code: int | None
    """Exit code of `run-task`; None if a task before it is not done."""
    message: str = ""
    """What `run-task` printed."""
    log: str = ""
    """Last lines of the task's log, if it failed."""
    has_run: bool = False
    """True if the command ran; False if the task was done before."""
    seconds: float = 0.0
    worker: str = ""

    @property
    def cause(self) -> Cause:
        """The cause of a temporary failure."""
        text = _LOG.sub("", self.message)
        for name, pattern in _PATTERNS.items():
            if pattern.search(text):
                return Cause[name]
        return Cause.OTHER
