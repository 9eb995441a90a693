"""A job of the program itself on a cluster where everything fails; the bytes of its results.

    python benches/failures.py TUNNELSTITCH [--kills 20]

A network of five simulated sections in two shards each runs on four worker processes. On the first
a call of the program stops without end, the second has a full disk, the others are killed at
random; after a minute all are. The results are compared with those of `run-job` without a failure.
Prints the summary of the run; ends with status 1 if a task is not done or a byte differs.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import dask
from distributed import Client, LocalCluster, Nanny
from distributed.core import Status

from tunnelstitch_dask import RunOptions, run_job

SECTIONS = 5
# Time after which the task that stops is ended, seconds.
LIMIT_SECONDS = 40.0
# Largest file while the disk of a worker is full, bytes.
FULL_DISK_BYTES = 20_000
# Time after which that disk has room again, and all workers are killed at random, seconds.
FAULT_SECONDS = 60.0
# Results that have no times, command line or absolute paths of their run, of each section.
RESULTS = ("refined/poses.tum", "refined/covariance.csv", "refined/masked.json", "panorama.tif")


def plan(program: str, folder: Path) -> None:
    """Simulates the surveys and plans two equal jobs, `failing` and `undisturbed`."""

    def call(*words: object) -> None:
        subprocess.run([program, *map(str, words), "--quiet"], check=True)

    size = ["--frames", 24, "--size", "160x120", "--supersample", 2]
    for k in range(SECTIONS):
        call("simulate", "free", *size, "--seed", k, "--out", folder / f"K{k}")
    sections = [f'[[section]]\nid = "K{k}"\nsurvey = "K{k}"\n' for k in range(SECTIONS)]
    (folder / "network.toml").write_text("".join(sections))
    for name in ("failing", "undisturbed"):
        job = folder / name
        call("plan-job", folder / "network.toml", "--shards", 2, "--cores", 1, "--out", job)
    path = folder / "failing" / "job.json"
    job = json.loads(path.read_text())
    for task in job["tasks"]:
        task["needs"]["limit_seconds"] = LIMIT_SECONDS
    path.write_text(json.dumps(job))


def results(folder: Path) -> dict[str, bytes]:
    """The results of all sections, as far as they are there."""
    names = (f"K{k}/{name}" for k in range(SECTIONS) for name in RESULTS)
    paths = {name: folder / name for name in names}
    return {name: path.read_bytes() for name, path in paths.items() if path.exists()}


def limit_files(size: int) -> None:
    """Lets a worker write no larger files; its tasks inherit it."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


def is_below(process: int, ancestor: int | None) -> bool:
    """True if a process was started by another, or by one that was."""
    while process > 1 and process != ancestor:
        status = Path(f"/proc/{process}/status").read_text()
        process = int(status.split("PPid:")[1].split()[0])
    return process == ancestor


def stop_one(job: Path, worker: Nanny, end: threading.Event) -> None:
    """Stops the first call of `refine` for a job that a worker is seen to run."""
    while not end.wait(0.05):
        for path in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                is_refine = b"refine" in (path / "cmdline").read_bytes().split(b"\0")
                process = int(path.name)
                is_of_job = is_refine and (path / "cwd").readlink() == job
                if is_of_job and is_below(process, worker.pid):
                    os.kill(process, signal.SIGSTOP)
                    return


def kill_workers(workers: list[Nanny], kills: int, end: threading.Event) -> None:
    """Kills workers at random, so many times; the first two are spared at first."""
    choice = random.Random(1)
    begin = time.monotonic()
    while kills and not end.wait(choice.uniform(0.5, 3.5)):
        is_late = time.monotonic() - begin > FAULT_SECONDS
        nanny = choice.choice(workers if is_late else workers[2:])
        process = nanny.process
        # A nanny gives up on a worker that dies before it has started.
        if process is not None and process.status is Status.running and nanny.pid:
            os.kill(nanny.pid, signal.SIGKILL)
            kills -= 1
    print(f"workers still to be killed at the end: {kills}")


def main() -> None:
    """Runs both jobs and compares their results."""
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--kills", type=int, default=20)
    choices = parser.parse_args()
    program = str(Path(choices.program).absolute())
    # Otherwise a worker that is killed again just then is given up.
    dask.config.set({"distributed.deploy.lost-worker-timeout": "1h"})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        plan(program, folder)
        subprocess.run([program, "run-job", folder / "undisturbed", "--quiet"], check=True)
        end = threading.Event()
        with (
            LocalCluster(
                n_workers=4, threads_per_worker=1, dashboard_address=None, silence_logs=50
            ) as cluster,
            Client(cluster) as client,
        ):
            workers = list(cluster.workers.values())
            client.run(limit_files, FULL_DISK_BYTES, workers=[workers[1].worker_address])
            free = threading.Timer(
                FAULT_SECONDS, lambda: client.run(limit_files, resource.RLIM_INFINITY)
            )
            threads = [
                threading.Thread(target=stop_one, args=(folder / "failing", workers[0], end)),
                threading.Thread(target=kill_workers, args=(workers, choices.kills, end)),
                free,
            ]
            for thread in threads:
                thread.start()
            summary = run_job(folder / "failing", client, RunOptions(program, retries=40))
            end.set()
            free.cancel()
            for thread in threads:
                thread.join()
        print(summary.to_text())
        failing, undisturbed = (results(folder / job) for job in ("failing", "undisturbed"))
        names = failing.keys() | undisturbed.keys()
        wrong = sorted(name for name in names if failing.get(name) != undisturbed.get(name))
        print(f"{len(undisturbed)} files of results, {len(wrong)} of them differ: {wrong}")
        sys.exit(bool(wrong) or bool(summary.exit_code))


if __name__ == "__main__":
    main()
