"""The end of a run: its tasks by how they ended."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from .outcome import NOT_USABLE

FAILED = 1
INTERRUPTED = 130
# Last lines of a log that are shown.
MAX_LOG_LINES = 10


@dataclass(frozen=True)
class Retry:
    """An attempt that was repeated."""

    task: str
    cause: str
    message: str


@dataclass(frozen=True)
class Failure:
    """A task that failed for good."""

    task: str
    exit_code: int | None
    """None if it was not the program that failed."""
    message: str
    log: str
    """Last lines of its log."""
    log_file: str
    """The log, in the folder of the job."""


@dataclass(frozen=True)
class Skip:
    """A task that was not run since another failed, or may not be used."""

    task: str
    because_of: str


@dataclass
class Summary:
    """Tasks by how they ended; each is in one list besides `retried`."""

    job: str
    done: list[str] = field(default_factory=list)
    up_to_date: list[str] = field(default_factory=list)
    not_usable: list[str] = field(default_factory=list)
    """Done, but the result may not be used (exit code 4)."""
    failed: list[Failure] = field(default_factory=list)
    skipped: list[Skip] = field(default_factory=list)
    unfinished: list[str] = field(default_factory=list)
    """Neither done nor failed when the run was cancelled, or the cluster lost."""
    retried: list[Retry] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def exit_code(self) -> int:
        """0, 1 after failures, 4 with results that may not be used, 130 with unfinished tasks."""
        if self.unfinished:
            return INTERRUPTED
        if self.failed:
            return FAILED
        return NOT_USABLE if self.not_usable else 0

    def to_json(self, exit_code: int) -> str:
        """The summary as one JSON document, with the exit code of the client."""
        return json.dumps({**asdict(self), "exit_code": exit_code}, indent=2)

    def to_text(self) -> str:
        """The summary as lines."""
        lines = [f"{self.job}: {self.seconds:.1f} s"]
        for name, count in (
            ("done", len(self.done)),
            ("up to date", len(self.up_to_date)),
            ("not usable", len(self.not_usable)),
            ("failed", len(self.failed)),
            ("skipped", len(self.skipped)),
            ("unfinished", len(self.unfinished)),
            ("retries", len(self.retried)),
        ):
            if count:
                lines.append(f"  {name:<12}{count}")
        lines += [f"retried {retry.task}: {retry.message or retry.cause}" for retry in self.retried]
        lines += [f"not usable {task}" for task in self.not_usable]
        for failure in self.failed:
            lines.append(f"failed {failure.task}: {failure.message}")
            shown = failure.log.splitlines()[-MAX_LOG_LINES:]
            lines += [f"  | {line}" for line in shown]
            if shown:
                lines.append(f"  {failure.log_file}")
        lines += [f"skipped {skip.task}: comes after {skip.because_of}" for skip in self.skipped]
        return "\n".join(lines)
