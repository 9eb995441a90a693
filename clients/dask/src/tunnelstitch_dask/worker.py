"""The part that runs on workers: one task in a process of its own."""

from __future__ import annotations

import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

from distributed import get_worker

from . import supervisor
from .job import JOB_FILE
from .outcome import DONE, INTERRUPTED, NOT_USABLE, TEMPORARY, Outcome

# Exit code of the program for bad input.
BAD_INPUT = 3
# Start of an address on storage.
STORAGE = re.compile(r"(s3|az|gs|file)://")
# What is kept of a log and of messages, bytes.
MAX_TAIL_BYTES = 4096
# Setting of the allocator that Dask makes for its workers; it takes a twentieth of the time of a
# task, and the program makes its own where it saves memory.
ALLOCATOR_OF_DASK = "MALLOC_TRIM_THRESHOLD_"

_lock = threading.Lock()
_running: defaultdict[str, set[subprocess.Popen[bytes]]] = defaultdict(set)
_cancelled: set[str] = set()


@dataclass(frozen=True)
class Call:
    """A call of `run-task`."""

    run: str
    """Identifier of the client's run, and topic of its events."""
    attempt: int
    program: str
    folder: str
    """Folder of the job as workers see it."""
    task: str
    limit_seconds: float
    """Time after which `run-task` itself is ended."""
    runs_after_failures: bool
    """True if the task runs when those before it have ended, whatever their ends."""

    def may_run_after(self, outcome: Outcome) -> bool:
        """True if a task before it has ended as it needs; a temporary failure is no end."""
        if self.runs_after_failures:
            return outcome.code not in (None, TEMPORARY)
        return outcome.code == DONE


def run_task(call: Call, *before: Outcome) -> Outcome:
    """Runs a task if those before it are done, and tells the client when it starts and ends."""
    if not all(call.may_run_after(outcome) for outcome in before):
        return Outcome(call.task, None)
    worker = get_worker()
    event = {"task": call.task, "attempt": call.attempt, "worker": worker.address}
    worker.log_event(call.run, event)
    begin = time.monotonic()
    outcome = _call(call, worker.address, begin)
    worker.log_event(call.run, {**event, "outcome": asdict(outcome)})
    return outcome


async def end_tasks(run: str) -> None:
    """Ends all tasks of a run on this worker, and waits until they have ended."""
    with _lock:
        _cancelled.add(run)
        processes = list(_running[run])
    for process in processes:
        _release(process)
    while _running[run]:
        await asyncio.sleep(0.05)


def _call(call: Call, worker: str, begin: float) -> Outcome:
    folder = Path(call.folder)
    # The program itself reads jobs on storage.
    if not STORAGE.match(call.folder) and not (folder / JOB_FILE).is_file():
        message = (
            f"{worker} does not see {folder / JOB_FILE}; mount the storage there, or say where "
            "workers see it (--worker-path)"
        )
        return Outcome(call.task, BAD_INPUT, message, worker=worker)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        code = _run_process(call, out, err)
        result, messages = _tail(out), _tail(err)
    return Outcome(
        task=call.task,
        code=code,
        message=_error(messages),
        log="" if code in (DONE, NOT_USABLE) else _log_tail(folder, call.task),
        has_run=not _is_up_to_date(result),
        seconds=time.monotonic() - begin,
        worker=worker,
    )


def _run_process(call: Call, out: IO[bytes], err: IO[bytes]) -> int:
    """Runs `run-task` under its supervisor; returns the exit code."""
    python = [sys.executable, "-I", "-S", supervisor.__file__, str(call.limit_seconds)]
    with _lock:
        if call.run in _cancelled:
            return TEMPORARY
        process = subprocess.Popen(
            [*python, call.program, "run-task", call.folder, call.task, "--json"],
            env={name: own for name, own in os.environ.items() if name != ALLOCATOR_OF_DASK},
            stdin=subprocess.PIPE,
            stdout=out,
            stderr=err,
            start_new_session=True,
        )
        _running[call.run].add(process)
    try:
        code = process.wait()
    finally:
        _release(process)
        with _lock:
            _running[call.run].discard(process)
    return TEMPORARY if code < 0 or code == INTERRUPTED else code


def _is_up_to_date(result: str) -> bool:
    """True if the result of `run-task --json` says that the task was done before."""
    try:
        return json.loads(result).get("up_to_date") is True
    except (ValueError, AttributeError):
        return False


def _error(messages: str) -> str:
    """The error in what `run-task --json`, or its supervisor, printed; else all of it."""
    text = messages.strip()
    try:
        return str(json.loads(text.splitlines()[-1])["error"])
    except (ValueError, IndexError, KeyError, TypeError):
        return text.removeprefix("error: ")


def _release(process: subprocess.Popen[bytes]) -> None:
    """Closes the pipe on whose end the supervisor ends the task."""
    if process.stdin is not None:
        process.stdin.close()


def _log_tail(folder: Path, task: str) -> str:
    try:
        with (folder / "logs" / f"{task}.log").open("rb") as log:
            return _tail(log)
    except OSError:
        return ""


def _tail(file: IO[bytes]) -> str:
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - MAX_TAIL_BYTES))
    return file.read().decode(errors="replace")
