"""A process between a worker and a task: the task ends with its worker, and in time.

`python supervisor.py LIMIT_SECONDS COMMAND…` runs the command in a process group of its own and
ends with its exit code. The worker holds the other end of standard input. When it closes it, or
dies for whatever reason, the group is ended. So it is after the limit, with exit code 75. It uses
the standard library alone, so that it starts fast (`python -I -S`).
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from types import FrameType

TEMPORARY = 75
# Time that `run-task` has to end its command and to remove unfinished files.
GRACE_SECONDS = 8.0


def end_group(child: "subprocess.Popen[bytes]") -> None:
    """Asks the group to end, and kills it after the grace."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(GRACE_SECONDS)
    kill_group(child)


def kill_group(child: "subprocess.Popen[bytes]") -> None:
    """Kills what is left of the group."""
    # macOS denies permission where only zombies are left.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)


def main(limit_seconds: float, command: list[str]) -> int:
    """Runs the command; returns the exit code."""
    try:
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as error:
        print(f"cannot start {command[0]}: {error.strerror}", file=sys.stderr)
        return 127

    def end_with_worker() -> None:
        os.read(0, 1)
        end_group(child)

    def end_on_signal(_signal: int, _frame: "FrameType | None") -> None:
        threading.Thread(target=end_group, args=(child,)).start()

    signal.signal(signal.SIGTERM, end_on_signal)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_worker, daemon=True).start()
    try:
        code = child.wait(limit_seconds)
    except subprocess.TimeoutExpired:
        end_group(child)
        print(f"did not end within its time limit and {GRACE_SECONDS:g} s more", file=sys.stderr)
        return TEMPORARY
    kill_group(child)
    if code < 0:
        print(f"run-task was ended by signal {-code}", file=sys.stderr)
        return TEMPORARY
    return code


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]), sys.argv[2:]))
