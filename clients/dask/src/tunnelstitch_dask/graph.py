"""Order of tasks: critical paths and dependants."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from .job import Job, Task


class Graph:
    """The tasks of a job with the edges towards dependants."""

    def __init__(self, job: Job) -> None:
        self.tasks: dict[str, Task] = {task.id: task for task in job.tasks}
        self._next: dict[str, list[str]] = {task.id: [] for task in job.tasks}
        for task in job.tasks:
            for after in task.after:
                self._next[after].append(task.id)

    def dependants(self, task_id: str) -> list[Task]:
        """All tasks that come after a task, directly or not, in the order of the job."""
        return self._later(task_id, lambda _: True)

    def lost_with(self, task_id: str) -> list[Task]:
        """The tasks that cannot run if a task fails, in the order of the job."""
        return self._later(task_id, lambda task: not task.runs_after_failures)

    def _later(self, task_id: str, follows: Callable[[Task], bool]) -> list[Task]:
        found: set[str] = set()
        rest = [task_id]
        while rest:
            later = (name for name in self._next[rest.pop()] if follows(self.tasks[name]))
            fresh = [name for name in later if name not in found]
            found.update(fresh)
            rest.extend(fresh)
        return [task for task in self.tasks.values() if task.id in found] if found else []

    def path_seconds(
        self, tasks: Iterable[Task], seconds: Callable[[Task], float]
    ) -> dict[str, float]:
        """Longest time from the start of each of `tasks` to the end of the job.

        L(t) = s(t) + max over its direct dependants d of L(d), in seconds; of `tasks`, which
        stand in the order of the job, others count as done.
        """
        lengths: dict[str, float] = {}
        for task in reversed(list(tasks)):
            later = (lengths.get(name, 0.0) for name in self._next[task.id])
            lengths[task.id] = seconds(task) + max(later, default=0.0)
        return lengths
