"""Progress: a line a section and step, and one for all."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Iterable
from typing import TextIO

from .graph import Graph
from .state import Phase, TaskState

# Time between two looks at all tasks, on a terminal and elsewhere, seconds.
TERMINAL_INTERVAL_S = 0.5
PLAIN_INTERVAL_S = 2.0


class Progress:
    """Writes lines to a stream: in place on a terminal, elsewhere those that changed."""

    def __init__(self, stream: TextIO, graph: Graph) -> None:
        self._stream = stream
        self._graph = graph
        self._is_terminal = stream.isatty()
        self._next_s = 0.0
        self._shown: dict[str, str] = {}
        self._height = 0
        self._ratio = _Ratio()

    def finished(self, state: TaskState, seconds: float) -> None:
        """Learns by how much tasks take longer than expected."""
        self._ratio.add(state.task.needs.seconds, seconds)

    def note(self, text: str) -> None:
        """Writes a line that stays."""
        self._erase()
        print(text, file=self._stream, flush=True)

    def show(self, states: Iterable[TaskState], *, is_last: bool = False) -> None:
        """Writes the counts, unless it did a moment ago."""
        now = time.monotonic()
        if now < self._next_s and not is_last:
            return
        interval = TERMINAL_INTERVAL_S if self._is_terminal else PLAIN_INTERVAL_S
        self._next_s = now + interval
        groups: dict[str, list[TaskState]] = {}
        for state in states:
            groups.setdefault(f"{state.task.section} {state.task.step}", []).append(state)
        lines = {name: self._group_line(name, group, now) for name, group in groups.items()}
        everything = [state for group in groups.values() for state in group]
        total = self._total_line(everything, now)
        if self._is_terminal:
            active = [
                lines[name]
                for name, group in groups.items()
                if any(state.phase is Phase.RUNNING for state in group)
            ]
            self._redraw([*active, total])
        else:
            changed = [line for name, line in lines.items() if self._shown.get(name) != line]
            if changed or is_last:
                print("\n".join([*changed, total]), file=self._stream, flush=True)
        self._shown = lines

    def _group_line(self, name: str, group: list[TaskState], now: float) -> str:
        line = f"{name:<32} {_counts(group)}"
        # Time that passes alone is no change of a line that is not drawn in place.
        left = sum(self._left_s(state, now if self._is_terminal else None) for state in group)
        return f"{line}; {_duration(left)} of work left" if left > 0 else line

    def _total_line(self, states: list[TaskState], now: float) -> str:
        line = f"{'all':<32} {_counts(states)}"
        left = {state.task.id: self._left_s(state, now) for state in states if state.phase.is_open}
        if not left:
            return line
        tasks = [state.task for state in states if state.phase.is_open]
        paths = self._graph.path_seconds(tasks, lambda task: left[task.id])
        running = sum(state.phase is Phase.RUNNING for state in states)
        # Neither the longest chain nor the running workers end before this.
        seconds = max(max(paths.values()), sum(left.values()) / max(running, 1))
        return f"{line}; about {_duration(seconds)} left"

    def _left_s(self, state: TaskState, now: float | None) -> float:
        if not state.phase.is_open:
            return 0.0
        expected = state.task.needs.seconds * self._ratio.value
        if state.phase is Phase.RUNNING and now is not None:
            return max(expected - (now - state.started_s), 0.0)
        return expected

    def _redraw(self, lines: list[str]) -> None:
        self._erase()
        size = shutil.get_terminal_size()
        lines = lines[-(size.lines - 1) :]
        self._stream.write("".join(f"{line[: size.columns - 1]}\n" for line in lines))
        self._stream.flush()
        self._height = len(lines)

    def _erase(self) -> None:
        if self._height:
            self._stream.write(f"\x1b[{self._height}A\x1b[J")
            self._height = 0


class _Ratio:
    """Time that tasks took over the time that was expected."""

    def __init__(self) -> None:
        self._expected_s = self._taken_s = 0.0

    def add(self, expected_s: float, taken_s: float) -> None:
        self._expected_s += expected_s
        self._taken_s += taken_s

    @property
    def value(self) -> float:
        return self._taken_s / self._expected_s if self._expected_s > 0 else 1.0


def _counts(states: list[TaskState]) -> str:
    counts = Counter(state.phase for state in states)
    finished = counts[Phase.DONE] + counts[Phase.UP_TO_DATE]
    text = f"{finished}/{len(states)} done"
    shown = (Phase.RUNNING, Phase.NOT_USABLE, Phase.FAILED, Phase.SKIPPED)
    return ", ".join(
        [text, *(f"{counts[phase]} {phase.value}" for phase in shown if counts[phase])]
    )


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
