"""A run of a job on a cluster: submits tasks, follows their events, repeats what may succeed.

Every task is a future that depends on those of the tasks before it. An attempt that fails with exit
code 75 is followed by another, which takes the place of the future, and with it those of all
dependants, which have not run. All results are files of the job; futures carry outcomes alone.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import sys
import threading
import time
import uuid
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from distributed import Client, Future, KilledWorker, Scheduler

from .graph import Graph
from .job import Job, Task, read_job
from .outcome import DONE, NOT_USABLE, TEMPORARY, Cause, Outcome
from .progress import Progress
from .resources import Capacity
from .state import Phase, TaskState
from .summary import Failure, Retry, Skip, Summary
from .worker import Call, end_tasks, run_task

# The remedy where Dask itself cannot run a task.
INSTALLED = "install tunnelstitch-dask in one version with the client, scheduler and workers"
# Longest pause before another attempt, seconds.
MAX_BACKOFF_S = 60.0
# Time between two looks at all tasks, seconds.
LOOK_INTERVAL_S = 0.1
# Time between two looks at the workers, seconds.
WORKER_LOOK_INTERVAL_S = 10.0
# Time in which workers must have ended the tasks of a cancelled run, seconds.
CANCEL_SECONDS = 30.0


class ClusterError(Exception):
    """A cluster that cannot be reached, or not be used; what is done stays done."""


@dataclass(frozen=True)
class RunOptions:
    """Choices of a run."""

    program: str = "tunnelstitch"
    """The program, as workers find it."""
    retries: int = 3
    """Further attempts of a task that failed for a reason that may pass."""
    backoff_seconds: float = 1.0
    """Pause before the first of them; doubles with each."""
    grace_seconds: float = 30.0
    """Time beyond its limit after which `run-task`, and as much later its worker, is ended."""
    worker_path: str | None = None
    """Folder of the job as workers see it; None if they see it as the client does."""
    worker_timeout_seconds: float = 300.0
    """Longest time without any worker."""


@dataclass(frozen=True)
class _Settled:
    """The future of an attempt is no longer pending."""

    task: str
    attempt: int
    future: Future[Any]


class JobRun:
    """A run of a job by a client."""

    def __init__(
        self,
        job: Job,
        client: Client,
        options: RunOptions | None = None,
        stream: TextIO | None = None,
    ) -> None:
        """Prepares a run; progress is written to `stream`, standard error unless given."""
        self.summary = Summary(str(job.folder))
        self._options = options or RunOptions()
        self._client = client
        self._graph = Graph(job)
        self._id = f"tunnelstitch-{uuid.uuid4().hex}"
        self._folder = self._options.worker_path or str(job.folder)
        self._states = {task.id: TaskState(task, task.needs.memory_bytes) for task in job.tasks}
        self._open = set(self._states)
        self._next_look_s = self._next_worker_look_s = 0.0
        self._last_worker_s = time.monotonic()
        self._priorities = self._graph.path_seconds(job.tasks, lambda task: task.needs.seconds)
        self._events: queue.SimpleQueue[dict[str, Any] | _Settled] = queue.SimpleQueue()
        self._progress = Progress(stream or sys.stderr, self._graph)
        self._capacity = Capacity()

    def run(self) -> Summary:
        """Runs all tasks that are not done.

        Raises `ClusterError` if the cluster is lost. On any exception, `KeyboardInterrupt`
        included, running tasks are ended and `summary` has what was done.
        """
        begin = time.monotonic()
        try:
            self._wait_for_worker()
            self._client.subscribe_topic(self._id, self._put_event)
            self._submit(self._open_tasks())
            while self._open:
                self._handle_events()
                self._look_at_clock()
        except OSError as error:
            # Of a call to a scheduler that is lost.
            self._cancel()
            raise ClusterError(f"the connection to the scheduler was lost: {error}") from error
        except BaseException:
            self._cancel()
            raise
        finally:
            self.summary.seconds = time.monotonic() - begin
            self._progress.show(self._states.values(), is_last=True)
            if self._client.status == "running":
                with contextlib.suppress(ValueError):
                    self._client.unsubscribe_topic(self._id)
        return self.summary

    def _open_tasks(self) -> list[Task]:
        return [state.task for state in self._states.values() if state.phase.is_open]

    def _look_at_clock(self) -> None:
        """Does what is due, from time to time: it takes a look at every task."""
        now = time.monotonic()
        if now >= self._next_look_s:
            self._next_look_s = now + LOOK_INTERVAL_S
            self._repeat_due_tasks()
            self._end_overdue_tasks()
            self._look_for_workers(now)
            self._progress.show(self._states.values())

    def _look_for_workers(self, now: float) -> None:
        """Gives up a cluster that has lost all workers, and gets none."""
        if now < self._next_worker_look_s:
            return
        self._next_worker_look_s = now + WORKER_LOOK_INTERVAL_S
        if self._client.nthreads():
            self._last_worker_s = now
        elif now - self._last_worker_s > self._options.worker_timeout_seconds:
            raise ClusterError(
                f"the cluster has had no worker for {now - self._last_worker_s:.0f} s"
            )
        else:
            self._progress.note("the cluster has no worker; waiting for one")

    def _end(self, state: TaskState, phase: Phase) -> None:
        state.end(phase)
        self._open.discard(state.task.id)

    def _wait_for_worker(self) -> None:
        limit = self._options.worker_timeout_seconds
        try:
            self._client.wait_for_workers(1, timeout=limit)
        except asyncio.TimeoutError as error:
            raise ClusterError(f"the cluster has no worker after {limit:g} s") from error
        self._capacity = Capacity.of_cluster(self._client)

    def _submit(self, tasks: list[Task]) -> None:
        """Submits new attempts, except of tasks that come after one that waits for its own."""
        for task in tasks:
            state = self._states[task.id]
            state.end_attempt()
            if self._has_unsubmitted_before(task):
                continue
            attempt = state.attempt
            call = Call(
                run=self._id,
                attempt=attempt,
                program=self._options.program,
                folder=self._folder,
                task=task.id,
                limit_seconds=task.needs.limit_seconds + self._options.grace_seconds,
                runs_after_failures=task.runs_after_failures,
            )
            request = self._capacity.request(task.needs, state.memory_bytes)
            others = self._capacity.others(request, state.failed_on)
            future = self._client.submit(
                run_task,
                call,
                *self._open_futures(task.after),
                # The first word names the group of tasks in Dask's dashboard.
                key=(task.step, task.id, self._id, attempt),
                priority=self._priorities[task.id],
                resources=request or None,
                workers=others,
                allow_other_workers=others is not None,
                pure=False,
            )
            state.future = future
            settled = _Settled(task.id, attempt, future)
            future.add_done_callback(lambda _, settled=settled: self._events.put(settled))

    def _open_futures(self, tasks: tuple[str, ...]) -> list[Future[Any]]:
        """Futures of the tasks that are not done; the results of others are in the job's files."""
        states = (self._states[name] for name in tasks)
        return [state.future for state in states if state.phase.is_open and state.future]

    def _has_unsubmitted_before(self, task: Task) -> bool:
        states = (self._states[name] for name in task.after)
        return any(state.phase.is_open and state.future is None for state in states)

    def _put_event(self, event: tuple[float, dict[str, Any]]) -> None:
        self._events.put(event[1])

    def _handle_events(self) -> None:
        """Waits for an event, and handles all that are there."""
        with contextlib.suppress(queue.Empty):
            event = self._events.get(timeout=LOOK_INTERVAL_S)
            while True:
                if isinstance(event, _Settled):
                    self._handle_settled(event)
                else:
                    self._handle_message(event)
                event = self._events.get_nowait()

    def _handle_message(self, message: dict[str, Any]) -> None:
        """Handles the start or the end of an attempt, as its worker tells it."""
        state = self._states[message["task"]]
        if message["attempt"] != state.attempt or not state.phase.is_open:
            return
        if "outcome" in message:
            self._end_attempt(state, Outcome(**message["outcome"]))
            return
        if state.worker:
            # The scheduler itself repeats the attempts of lost workers.
            reason = f"lost its worker {state.worker}"
            self._record_retry(state, Cause.WORKER_LOST, reason)
        state.phase, state.worker = Phase.RUNNING, message["worker"]
        state.started_s = time.monotonic()

    def _handle_settled(self, event: _Settled) -> None:
        """Handles futures that have ended in another way than their worker told."""
        state = self._states[event.task]
        if event.attempt != state.attempt or not state.phase.is_open:
            return
        try:
            outcome = event.future.result()
        except CancelledError as error:
            self._handle_cancelled(error)
        except KilledWorker as error:
            if error.task == event.future.key:
                self._handle_killed_worker(state)
            else:
                self._repeat_without_outcome(state)
        except Exception as error:
            self._fail(state, None, f"{type(error).__name__}: {error}; {INSTALLED}", "")
        else:
            self._end_attempt(state, outcome)

    def _handle_cancelled(self, error: CancelledError) -> None:
        """Submits everything again if the scheduler is back."""
        if getattr(error, "reason", "") != "scheduler-connection-lost":
            raise ClusterError(f"the scheduler refused a task: {error}; {INSTALLED}")
        while self._client.status == "connecting":
            time.sleep(0.1)
        if self._client.status != "running":
            raise ClusterError("the connection to the scheduler was lost")
        self._progress.note("the scheduler was lost and is back; submitting all tasks again")
        self._wait_for_worker()
        self._client.subscribe_topic(self._id, self._put_event)
        self._submit(self._open_tasks())

    def _end_attempt(self, state: TaskState, outcome: Outcome) -> None:
        if outcome.code is None:
            self._repeat_without_outcome(state)
            return
        name = state.task.id
        if outcome.code == DONE:
            if outcome.has_run:
                self._end(state, Phase.DONE)
                self.summary.done.append(name)
                self._progress.finished(state, outcome.seconds)
            else:
                self._end(state, Phase.UP_TO_DATE)
                self.summary.up_to_date.append(name)
        elif outcome.code == NOT_USABLE:
            self._end(state, Phase.NOT_USABLE)
            self.summary.not_usable.append(name)
            self._progress.note(f"{name}: done, but the result may not be used")
            self._skip_dependants(state.task)
        elif outcome.code != TEMPORARY:
            self._fail(state, outcome.code, outcome.message, outcome.log)
        elif outcome.cause is Cause.BUSY:
            self._wait_for_other_run(state)
        else:
            state.failed_on.add(outcome.worker)
            self._retry(state, outcome.cause, outcome.message, outcome.log)

    def _repeat_without_outcome(self, state: TaskState) -> None:
        """Plans another attempt of a task that did not run, since one before it had no outcome.

        If that one has failed, they are repeated together. It may have been done, though: when
        its worker is lost, the scheduler runs it again for its dependants.
        """
        if not self._has_unsubmitted_before(state.task):
            self._plan_attempt(state, self._options.backoff_seconds)

    def _wait_for_other_run(self, state: TaskState) -> None:
        """Looks again later at a task that another client, or a lost worker, is running."""
        now = time.monotonic()
        state.busy_since_s = state.busy_since_s or now
        waited_s = now - state.busy_since_s
        limit_s = state.task.needs.limit_seconds + 2 * self._options.grace_seconds
        if waited_s > limit_s:
            message = f"has been running elsewhere for more than {limit_s:.0f} s"
            self._fail(state, TEMPORARY, message, "")
        else:
            self._plan_attempt(state, max(waited_s, self._options.backoff_seconds))

    def _retry(self, state: TaskState, cause: Cause, message: str, log: str) -> None:
        """Plans another attempt after a failure that may pass."""
        message = message or cause.value
        if state.retries == self._options.retries:
            self._fail(state, TEMPORARY, f"{message} (after {state.retries} retries)", log)
            return
        self._record_retry(state, cause, message)
        self._plan_attempt(state, self._options.backoff_seconds * 2**state.retries)
        state.retries += 1
        state.busy_since_s = None
        if cause in (Cause.MEMORY, Cause.WORKER_LOST):
            state.memory_bytes *= 2

    def _plan_attempt(self, state: TaskState, pause_s: float) -> None:
        state.end_attempt(due_s=time.monotonic() + min(pause_s, MAX_BACKOFF_S))

    def _record_retry(self, state: TaskState, cause: Cause, message: str) -> None:
        self.summary.retried.append(Retry(state.task.id, cause.value, message))
        self._progress.note(f"{state.task.id}: {message}; it is run again")

    def _repeat_due_tasks(self) -> None:
        """Submits attempts whose time has come, and with them the dependants that wait."""
        now = time.monotonic()
        states = self._states.values()
        due = [state.task.id for state in states if state.is_due(now)]
        if not due:
            return
        self._capacity = Capacity.of_cluster(self._client)
        again = {task.id for name in due for task in self._graph.dependants(name)} | set(due)
        self._submit([task for task in self._open_tasks() if task.id in again])

    def _handle_killed_worker(self, state: TaskState) -> None:
        """Handles a task that was lost with more workers than the scheduler allows."""
        if state.worker:
            message = f"lost its worker {state.worker}, as others before"
            self._retry(state, Cause.WORKER_LOST, message, "")
        else:
            # It had been assigned to those workers, and did not run.
            self._plan_attempt(state, 0.0)

    def _end_overdue_tasks(self) -> None:
        """Restarts workers that have not ended a task long after its limit."""
        now = time.monotonic()
        for state in self._states.values():
            limit_s = state.task.needs.limit_seconds + 2 * self._options.grace_seconds
            if state.phase is not Phase.RUNNING or now - state.started_s <= limit_s:
                continue
            if state.worker in self._client.scheduler_info(n_workers=-1)["workers"]:
                worker = state.worker
                message = f"worker {worker} did not end it in its time limit, and is restarted"
                self._retry(state, Cause.TIME_LIMIT, message, "")
                self._client.run_on_scheduler(restart_worker, worker)
            else:
                # The scheduler will find another one.
                state.phase, state.worker = Phase.WAITING, ""

    def _fail(self, state: TaskState, code: int | None, message: str, log: str) -> None:
        self._end(state, Phase.FAILED)
        failure = Failure(state.task.id, code, message, log, f"logs/{state.task.id}.log")
        self.summary.failed.append(failure)
        self._progress.note(f"{state.task.id}: failed: {message}")
        self._skip_dependants(state.task)

    def _skip_dependants(self, task: Task) -> None:
        for later in self._graph.lost_with(task.id):
            state = self._states[later.id]
            if state.phase.is_open:
                self._end(state, Phase.SKIPPED)
                self.summary.skipped.append(Skip(later.id, task.id))

    def _cancel(self) -> None:
        """Ends all tasks of this run on all workers."""
        self.summary.unfinished = [task.id for task in self._open_tasks()]
        for state in self._states.values():
            state.release()
        if self._client.status != "running":
            return
        # A worker that hangs does not answer.
        call = threading.Thread(
            target=self._client.run,
            args=(end_tasks, self._id),
            kwargs={"on_error": "ignore"},
            daemon=True,
        )
        call.start()
        call.join(CANCEL_SECONDS)


async def restart_worker(address: str, dask_scheduler: Scheduler) -> None:
    """Restarts a worker; on the scheduler. One without a nanny is removed."""
    await dask_scheduler.restart_workers(
        [address], wait_for_workers=False, on_error="return", stimulus_id="tunnelstitch-overdue"
    )


def run_job(
    job: Job | Path | str,
    client: Client,
    options: RunOptions | None = None,
    stream: TextIO | None = None,
) -> Summary:
    """Runs the tasks of a job that are not done on a cluster, and returns how they ended.

    `stream` gets the progress; None means standard error. Raises `JobError` for a job that cannot
    be read, and `ClusterError` for a cluster that is lost. `KeyboardInterrupt` ends running tasks.
    """
    read = job if isinstance(job, Job) else read_job(job)
    return JobRun(read, client, options, stream).run()
