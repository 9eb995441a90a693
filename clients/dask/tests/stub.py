"""Stands in for `tunnelstitch`: `stub run-task JOB ID --json` behaves as docs/jobs.md says.

The command of a task is `[program, SECONDS]`: it works for that time, then writes the hash of its
key to its outputs. `faults/ID` in the folder of the job has a line for each attempt that goes
wrong; an attempt takes the first line away. `runs/ID` gets a line for each attempt that works.
"""

import fcntl
import hashlib
import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any, NoReturn, TextIO

USAGE, BAD_INPUT, NOT_USABLE, TEMPORARY = 2, 3, 4, 75


def fail(code: int, message: str) -> NoReturn:
    """Ends as the program does."""
    print(json.dumps({"error": message, "exit_code": code}), file=sys.stderr)
    sys.exit(code)


def runs_after_failures(task: dict[str, Any]) -> bool:
    """True if it reports on the tasks before it, whatever their ends."""
    return task.get("trigger_rule") == "all_done"


def key(folder: Path, tasks: dict[str, Any], name: str) -> str:
    """Hash of the command, the inputs, and the keys before."""
    task = tasks[name]
    text = hashlib.sha256(json.dumps(task["command"][1:]).encode())
    for path in task["inputs"]:
        text.update((folder / path).read_bytes())
    for after in task["after"]:
        if runs_after_failures(task):
            text.update(f"{record(folder, tasks, after)}".encode())
        else:
            text.update(key(folder, tasks, after).encode())
    return text.hexdigest()


def record(folder: Path, tasks: dict[str, Any], name: str) -> int | None:
    """Exit code of a task that is done with its present key."""
    try:
        state = json.loads((folder / "state" / f"{name}.json").read_text())
    except FileNotFoundError:
        return None
    return int(state["exit_code"]) if state["key"] == key(folder, tasks, name) else None


def write(path: Path, text: str) -> None:
    """Writes a file that is complete or not there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.write_text(text)
    unfinished.replace(path)


def append(path: Path, line: str) -> None:
    """Adds a line to a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(f"{line}\n")


def next_fault(folder: Path, name: str) -> list[str]:
    """Takes the first line of the faults away."""
    path = folder / "faults" / name
    if not path.exists():
        return ["none"]
    first, *rest = [*path.read_text().splitlines(), ""]
    write(path, "".join(f"{line}\n" for line in rest if line))
    return first.split() or ["none"]


def misbehave(fault: list[str], name: str, limit_seconds: float, log: TextIO) -> int:
    """Does what the fault says; returns the exit code of a command that works."""
    place = f"; see logs/{name}.log"
    match fault:
        case ["none"]:
            return 0
        case ["not-usable"]:
            return NOT_USABLE
        case ["bad-input"]:
            print("error: frame 7 is no picture", file=log)
            fail(BAD_INPUT, f"task {name}: frame 7 is no picture{place}")
        case ["signal", number]:
            fail(TEMPORARY, f"task {name}: it was ended by signal {number}{place}")
        case ["full-disk"]:
            fail(TEMPORARY, f"task {name}: No space left on device{place}")
        case ["full-disk-of", memory]:
            if os.environ.get("STUB_MEMORY_BYTES") == memory:
                fail(TEMPORARY, f"task {name}: No space left on device{place}")
            return 0
        case ["memory", needed]:
            if int(os.environ.get("STUB_MEMORY_BYTES", "0")) < int(needed):
                fail(TEMPORARY, f"task {name}: too little memory{place}")
            return 0
        case ["slow"]:
            time.sleep(limit_seconds)
            limit = f"limit of {limit_seconds:.0f} seconds"
            fail(TEMPORARY, f"task {name}: it was ended after its {limit}{place}")
        case ["hang"]:
            time.sleep(3600)
        case ["stop-worker"]:
            # The supervisor is a child of the worker.
            supervisor = os.getppid()
            text = Path(f"/proc/{supervisor}/stat").read_text()
            os.kill(int(text.rpartition(")")[2].split()[1]), signal.SIGSTOP)
            time.sleep(3600)
        case ["killed"]:
            os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError(fault)


def run_task(folder: Path, name: str) -> int:
    """Runs a task unless it is done; returns the exit code."""
    tasks = {task["id"]: task for task in json.loads((folder / "job.json").read_text())["tasks"]}
    if name not in tasks:
        fail(USAGE, f"has no task {name}")
    task = tasks[name]
    for after in [] if runs_after_failures(task) else task["after"]:
        if record(folder, tasks, after) != 0:
            fail(BAD_INPUT, f"task {name} comes after {after}, which is not done")
    (folder / "state").mkdir(exist_ok=True)
    lock = (folder / "state" / f"{name}.lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        fail(TEMPORARY, f"task {name} is running already; wait for it to end")
    done = record(folder, tasks, name)
    if done is not None and (done or all((folder / path).exists() for path in task["outputs"])):
        print(json.dumps({"task": name, "up_to_date": True}))
        return done
    append(folder / "starts" / name, str(os.getpid()))
    (folder / "logs").mkdir(exist_ok=True)
    log = (folder / "logs" / f"{name}.log").open("w")
    print(f"begin {name}", file=log, flush=True)
    own_key = key(folder, tasks, name)
    fault = next_fault(folder, name)
    time.sleep(float(task["command"][1]))
    code = misbehave(fault, name, task["needs"]["limit_seconds"], log)
    for path in task["outputs"] if code == 0 else []:
        write(folder / path, hashlib.sha256(own_key.encode()).hexdigest())
    write(folder / "state" / f"{name}.json", json.dumps({"key": own_key, "exit_code": code}))
    append(folder / "runs" / name, str(os.getpid()))
    print(json.dumps({"task": name, "up_to_date": False}))
    return code


if __name__ == "__main__":
    if sys.argv[1] != "run-task":
        fail(USAGE, "expects run-task JOB ID")
    sys.exit(run_task(Path(sys.argv[2]), sys.argv[3]))
