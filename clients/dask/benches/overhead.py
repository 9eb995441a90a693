"""Time that the scheduler and the client add to each task, and what follows for many frames.

    python benches/overhead.py [--workers 2] [--tasks 10 100 1000]

Runs jobs of tasks without work: each starts its supervisor and a program that ends at once. The
processor time is that of this process, which holds the client and the scheduler. A line
t = a + b n is fitted to it. The model of cost below the table is no measurement.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster

from tunnelstitch_dask import RunOptions, run_job

# Assumptions of the model: frames of a section, and processor time of a frame for all steps, the
# second from 12,000 frames in 12 minutes on two cores.
FRAMES_OF_SECTION = 1000
STEPS_OF_SECTION = 3
FRAME_PROCESSOR_SECONDS = 12 * 60 * 2 / 12_000
CORES_OF_TASK = 2
# A worker is lost once in this time of its cores, and half a task is repeated then.
CORE_SECONDS_OF_LOSS = 30 * 86400.0


def write_job(folder: Path, count: int) -> None:
    """Writes sections of one task each."""
    needs = {"cores": 1, "memory_bytes": 1, "seconds": 0.1, "limit_seconds": 600.0}
    tasks = [
        {
            "id": f"K{k}.refine",
            "section": f"K{k}",
            "step": "refine",
            "command": ["tunnelstitch", "refine"],
            "inputs": [],
            "outputs": [],
            "after": [],
            "needs": needs,
        }
        for k in range(count)
    ]
    job = {"format": "tunnelstitch job", "version": 1, "program": "none", "tasks": tasks}
    (folder / "job.json").write_text(json.dumps(job))


def measure(client: Client, count: int) -> tuple[float, float]:
    """Returns the time and the processor time of client and scheduler, seconds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_job(folder, count)
        begin, processor = time.perf_counter(), time.process_time()
        options = RunOptions(program="/bin/true")
        summary = run_job(folder, client, options, io.StringIO())
        spent = time.perf_counter() - begin, time.process_time() - processor
        if len(summary.done) != count:
            sys.exit(summary.to_text())
    return spent


def fit_line(counts: list[int], seconds: list[float]) -> tuple[float, float]:
    """Returns a and b of t = a + b n by least squares of relative errors."""
    # Weighted by 1/t: otherwise the largest count alone decides.
    weights = [1 / t**2 for t in seconds]
    total = sum(weights)
    n_mean = sum(w * n for w, n in zip(weights, counts, strict=True)) / total
    t_mean = sum(w * t for w, t in zip(weights, seconds, strict=True)) / total
    rows = list(zip(weights, counts, seconds, strict=True))
    slope = sum(w * (n - n_mean) * (t - t_mean) for w, n, t in rows) / sum(
        w * (n - n_mean) ** 2 for w, n, _ in rows
    )
    return t_mean - slope * n_mean, slope


def print_model(task_seconds: float, start_seconds: float) -> None:
    """Prints time and bottleneck of large networks."""
    work = FRAMES_OF_SECTION * FRAME_PROCESSOR_SECONDS
    print(
        f"\nModel: sections of {FRAMES_OF_SECTION} frames, {STEPS_OF_SECTION} tasks each; "
        f"{FRAME_PROCESSOR_SECONDS:.2f} core seconds a frame on any number of workers;\n"
        f"tasks of {CORES_OF_TASK} cores; {1e3 * start_seconds:.0f} ms of a worker to start one; "
        f"one scheduler, {1e3 * task_seconds:.2f} ms a task;\n"
        f"a worker lost every {CORE_SECONDS_OF_LOSS / 86400:.0f} core days.\n"
        "Storage keeps up, and the last section ends with the others. The longest of the times is\n"
        "that of the job: work, scheduler (one process), or one section from start to end."
    )
    print(f"{'frames':>12} {'cores':>7} {'work':>10} {'scheduler':>10} {'section':>9}  bottleneck")
    for frames in (10**6, 10**8):
        sections = frames / FRAMES_OF_SECTION
        for cores in (100, 1000, 10_000):
            repeated = work / 2 / CORE_SECONDS_OF_LOSS
            start = STEPS_OF_SECTION * start_seconds * CORES_OF_TASK
            times = {
                "work": sections * (work * (1 + repeated) + start) / cores,
                "scheduler": sections * STEPS_OF_SECTION * task_seconds,
                "section": work / CORES_OF_TASK,
            }
            bottleneck = max(times, key=lambda name: times[name])
            columns = " ".join(f"{times[name] / 3600:>8.2f} h" for name in times)
            print(f"{frames:>12,} {cores:>7,} {columns}  {bottleneck}")


def main() -> None:
    """Measures, fits and prints."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--tasks", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--repeats", type=int, default=3)
    choices = parser.parse_args()
    print(f"{os.cpu_count()} cores, {choices.workers} workers of 1 thread")
    print(
        f"{'tasks':>6} {'time':>9} {'client + scheduler':>19} {'a task':>9} {'worker a task':>14}"
    )
    processors = []
    with (
        LocalCluster(
            n_workers=choices.workers, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,
    ):
        measure(client, 10)
        for count in choices.tasks:
            runs = [measure(client, count) for _ in range(choices.repeats)]
            seconds, processor = (statistics.median(column) for column in zip(*runs, strict=True))
            processors.append(processor)
            start_seconds = choices.workers * seconds / count
            print(
                f"{count:>6} {seconds:>7.2f} s {processor:>17.2f} s "
                f"{1e3 * processor / count:>6.2f} ms "
                f"{1e3 * start_seconds:>11.0f} ms"
            )
    start, slope = fit_line(choices.tasks, processors)
    print(f"fit: {1e3 * start:.0f} ms + {1e3 * slope:.2f} ms a task")
    print_model(slope, start_seconds)


if __name__ == "__main__":
    main()
