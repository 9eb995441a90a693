"""Jobs of stub tasks."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

STUB = Path(__file__).with_name("stub.py")


def task(name: str, after: Iterable[str] = (), seconds: float = 0.0, **needs: float) -> Any:
    """A task of `job.json`; its name is `SECTION.STEP`."""
    section, _, step = name.partition(".")
    return {
        "id": name,
        "section": section,
        "step": step,
        "command": ["tunnelstitch", str(seconds)],
        "inputs": ["../input.txt"],
        "outputs": [f"{section}/{step}.txt"],
        "after": list(after),
        "needs": {
            "cores": 1,
            "memory_bytes": 1000,
            "seconds": max(seconds, 0.1),
            "limit_seconds": 60.0,
        }
        | needs,
    }


def tree(tasks: Iterable[Any]) -> dict[str, Any]:
    """The content of `job.json`."""
    return {
        "format": "tunnelstitch job",
        "version": 1,
        "program": "tunnelstitch 0.1.0",
        "tasks": list(tasks),
    }


def network(sections: int, seconds: float) -> list[Any]:
    """Tasks of a network: each section is refined, then stitched, then reported on."""
    tasks = []
    for k in range(sections):
        refine, stitch, report = (f"K{k}.{step}" for step in ("refine", "stitch", "report"))
        tasks += [
            task(refine, seconds=seconds),
            task(stitch, [refine], seconds=seconds),
            task(report, [refine, stitch]),
        ]
    return tasks


@dataclass(frozen=True)
class JobFolder:
    """A job of stub tasks in a folder of its own."""

    folder: Path
    program: str

    @staticmethod
    def create(parent: Path, tasks: Iterable[Any]) -> JobFolder:
        """Writes the job, its input and the program."""
        folder = parent / "job"
        folder.mkdir()
        (parent / "input.txt").write_text("input")
        (folder / "job.json").write_text(json.dumps(tree(tasks)))
        program = parent / "stub"
        program.write_text(f"#!{sys.executable} -IS\n{STUB.read_text()}")
        program.chmod(0o755)
        return JobFolder(folder, str(program))

    def set_faults(self, name: str, *faults: str) -> None:
        """Lets the next attempts of a task go wrong."""
        (self.folder / "faults").mkdir(exist_ok=True)
        (self.folder / "faults" / name).write_text("".join(f"{fault}\n" for fault in faults))

    def outputs(self) -> dict[str, bytes]:
        """All outputs that exist."""
        job = json.loads((self.folder / "job.json").read_text())
        paths = [path for task in job["tasks"] for path in task["outputs"]]
        return {
            path: (self.folder / path).read_bytes()
            for path in paths
            if (self.folder / path).exists()
        }

    def runs(self, name: str) -> int:
        """Attempts of a task that worked."""
        return len(self._lines("runs", name))

    def starts(self, name: str) -> int:
        """Attempts of a task that began."""
        return len(self._lines("starts", name))

    def running(self) -> set[int]:
        """Processes of tasks that still run."""
        names = [path.name for path in (self.folder / "starts").glob("*")]
        pids = {int(pid) for name in names for pid in self._lines("starts", name)}
        return {pid for pid in pids if _is_stub(pid)}

    def kill(self) -> None:
        """Kills what a test has left behind."""
        for pid in self.running():
            os.kill(pid, signal.SIGKILL)

    def _lines(self, kind: str, name: str) -> list[str]:
        path = self.folder / kind / name
        return path.read_text().splitlines() if path.exists() else []


def _is_stub(pid: int) -> bool:
    try:
        return b"run-task" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
