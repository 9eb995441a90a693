"""The state of each task as the client sees it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from distributed import Future

from .job import Task


class Phase(Enum):
    """Phases of a task."""

    WAITING = "waiting"
    """Submitted, or for a task before it, or for its next attempt."""
    RUNNING = "running"
    DONE = "done"
    UP_TO_DATE = "up to date"
    NOT_USABLE = "not usable"
    FAILED = "failed"
    SKIPPED = "skipped"

    @property
    def is_open(self) -> bool:
        """True if the task may still run."""
        return self in (Phase.WAITING, Phase.RUNNING)


@dataclass
class TaskState:
    """A task, its present attempt and the failures of earlier ones."""

    task: Task
    memory_bytes: int
    """Memory that it asks for; grows with failures."""
    phase: Phase = Phase.WAITING
    attempt: int = 0
    future: Future[Any] | None = None
    worker: str = ""
    """The worker on which the present attempt started, if it did."""
    started_s: float = 0.0
    due_s: float | None = None
    """Time of the next attempt, if it waits for that."""
    busy_since_s: float | None = None
    """Time since which another client runs it."""
    retries: int = 0
    """Failures that count towards the largest number of retries."""
    failed_on: set[str] = field(default_factory=set)
    """Workers on which attempts have failed."""

    def end_attempt(self, due_s: float | None = None) -> None:
        """Ends the present attempt, so that nothing that it still tells counts."""
        self.release()
        self.attempt += 1
        self.phase, self.worker, self.due_s = Phase.WAITING, "", due_s

    def end(self, phase: Phase) -> None:
        """Ends the task."""
        self.release()
        self.phase, self.due_s = phase, None

    def is_due(self, now_s: float) -> bool:
        """True if the pause before the next attempt is over."""
        return self.due_s is not None and self.due_s <= now_s

    def release(self) -> None:
        """Tells the scheduler that the future is not needed any more."""
        if self.future is not None:
            self.future.release()
            self.future = None
