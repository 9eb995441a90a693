"""`job.json`: a job as a graph of tasks (docs/jobs.md)."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

JOB_FILE = "job.json"
FORMAT = "tunnelstitch job"
VERSION = 1
# Values of `trigger_rule`, the first unless given: True if a task runs after failures, too.
TRIGGER_RULES = {"all_success": False, "all_done": True}
# Identifiers name files.
TASK_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*")


class JobError(ValueError):
    """A job that cannot be read; the message names the file, the task and the remedy."""


@dataclass(frozen=True)
class Needs:
    """Needs and expectations of a task."""

    cores: int
    memory_bytes: int
    seconds: float
    """Expected time on that many processors."""
    limit_seconds: float
    """Time after which the task is ended."""


@dataclass(frozen=True)
class Task:
    """A call of the program."""

    id: str
    section: str
    step: str
    command: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    after: tuple[str, ...]
    """Tasks whose outputs it reads."""
    needs: Needs
    runs_after_failures: bool = False
    """True if it runs when the tasks before it have ended, whatever their ends: it reports on
    them."""


@dataclass(frozen=True)
class Job:
    """A graph of tasks; each stands behind those that it comes after."""

    folder: Path
    program: str
    tasks: tuple[Task, ...]


def read_job(path: Path | str) -> Job:
    """Reads the job of a folder, or of its `job.json`.

    Raises `JobError` for a file that is missing, malformed or of another version, and for tasks
    that are no graph.
    """
    given = Path(path)
    file = given if given.name == JOB_FILE else given / JOB_FILE
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise JobError(
            f"{file}: cannot read: {error}; a job is a folder that `tunnelstitch plan-job` wrote"
        ) from error
    try:
        tree = json.loads(text, object_pairs_hook=_unique_keys, parse_constant=_refuse_constant)
        job = _parse_job(tree, file.resolve().parent)
        _check_graph(job.tasks)
    except json.JSONDecodeError as error:
        raise JobError(f"{file}:{error.lineno}:{error.colno}: {error.msg}") from error
    except JobError as error:
        raise JobError(f"{file}: {error}") from error
    return job


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        raise JobError(f"key {max(names, key=names.count)!r} stands twice in one object")
    return found


def _refuse_constant(name: str) -> NoReturn:
    raise JobError(f"{name} is no number of JSON")


class _Reader:
    """Takes keys with their types out of an object; what remains is unknown."""

    def __init__(self, value: object, where: str) -> None:
        if not isinstance(value, dict):
            raise JobError(f"{where} is no object")
        self._values = dict(value)
        self._where = where

    def take(self, key: str) -> Any:
        if key not in self._values:
            raise JobError(f"{self._where} has no {key!r}")
        return self._values.pop(key)

    def refuse(self, key: str, expected: str) -> NoReturn:
        raise JobError(f"{self._where}: {key!r} is not {expected}")

    def choice(self, key: str, choices: dict[str, bool]) -> bool:
        """What the choice of an optional key stands for; without it, the first choice."""
        value = self._values.pop(key, next(iter(choices)))
        if not isinstance(value, str) or value not in choices:
            self.refuse(key, f"one of {', '.join(choices)}")
        return choices[value]

    def text(self, key: str) -> str:
        value = self.take(key)
        if not isinstance(value, str) or not value:
            self.refuse(key, "a text")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        value = self.take(key)
        if not isinstance(value, list) or not all(isinstance(text, str) for text in value):
            self.refuse(key, "a list of texts")
        return tuple(value)

    def integer(self, key: str, smallest: int) -> int:
        value = self.take(key)
        if not isinstance(value, int) or isinstance(value, bool) or value < smallest:
            self.refuse(key, f"an integer of at least {smallest}")
        return value

    def positive(self, key: str) -> float:
        value = self.take(key)
        if not isinstance(value, int | float) or isinstance(value, bool):
            self.refuse(key, "a number")
        if not (math.isfinite(value) and value > 0):
            self.refuse(key, "positive")
        return float(value)

    def end(self) -> None:
        for key in self._values:
            raise JobError(
                f"{self._where} has the unknown key {key!r}; this client reads version {VERSION}"
            )


def _parse_job(tree: object, folder: Path) -> Job:
    reader = _Reader(tree, "the job")
    kind, version = reader.take("format"), reader.take("version")
    if kind != FORMAT or version != VERSION:
        raise JobError(
            f"is {kind!r} of version {version!r}, and this client reads {FORMAT!r} of version "
            f"{VERSION}; plan the job anew, or update tunnelstitch-dask"
        )
    program = reader.text("program")
    tasks = reader.take("tasks")
    if not isinstance(tasks, list):
        reader.refuse("tasks", "a list")
    reader.end()
    return Job(folder, program, tuple(_parse_task(task, k) for k, task in enumerate(tasks)))


def _parse_task(tree: object, index: int) -> Task:
    name = tree.get("id") if isinstance(tree, dict) else None
    where = f"task {name!r}" if isinstance(name, str) else f"tasks[{index}]"
    reader = _Reader(tree, where)
    task = Task(
        id=reader.text("id"),
        section=reader.text("section"),
        step=reader.text("step"),
        command=reader.texts("command"),
        inputs=reader.texts("inputs"),
        outputs=reader.texts("outputs"),
        after=reader.texts("after"),
        needs=_parse_needs(reader.take("needs"), where),
        runs_after_failures=reader.choice("trigger_rule", TRIGGER_RULES),
    )
    reader.end()
    if not TASK_ID.fullmatch(task.id):
        raise JobError(f"{where}: 'id' must be letters, digits, -, _ and dots: it names files")
    if not task.command:
        raise JobError(f"{where} has no command")
    return task


def _parse_needs(tree: object, where: str) -> Needs:
    reader = _Reader(tree, f"{where}: 'needs'")
    needs = Needs(
        cores=reader.integer("cores", 1),
        memory_bytes=reader.integer("memory_bytes", 0),
        seconds=reader.positive("seconds"),
        limit_seconds=reader.positive("limit_seconds"),
    )
    reader.end()
    return needs


def _check_graph(tasks: tuple[Task, ...]) -> None:
    places: dict[str, int] = {}
    for k, task in enumerate(tasks):
        if task.id in places:
            raise JobError(f"task {task.id!r} stands twice")
        places[task.id] = k
    for task in tasks:
        for after in task.after:
            if after not in places:
                raise JobError(f"task {task.id!r} comes after {after!r}, which is not in the job")
    cycle = _find_cycle(tasks, places)
    if cycle:
        raise JobError(f"tasks come after each other in a cycle: {' -> '.join(cycle)}")
    for k, task in enumerate(tasks):
        for after in task.after:
            if places[after] > k:
                raise JobError(
                    f"task {task.id!r} comes after {after!r}, which has to stand before it"
                )


def _find_cycle(tasks: tuple[Task, ...], places: dict[str, int]) -> list[str]:
    """Follows edges that lead to a later place, which every cycle has; `[]` without a cycle."""
    finished: set[str] = set()
    for k, task in enumerate(tasks):
        if all(places[after] < k for after in task.after):
            continue
        path = [task.id]
        rest = [iter(task.after)]
        while path:
            after = next(rest[-1], None)
            if after is None:
                finished.add(path.pop())
                rest.pop()
            elif after in path:
                return [*path[path.index(after) :], after]
            elif after not in finished:
                path.append(after)
                rest.append(iter(tasks[places[after]].after))
    return []
