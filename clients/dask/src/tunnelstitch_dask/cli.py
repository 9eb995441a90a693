"""The command `tunnelstitch-dask`."""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import dask
from distributed import Client, LocalCluster
from distributed.system import MEMORY_LIMIT

from .job import JobError, read_job
from .outcome import TEMPORARY
from .resources import CORES, MEMORY
from .run import ClusterError, JobRun, RunOptions
from .summary import INTERRUPTED, Summary

# Exit code of bad input, as in tunnelstitch.
BAD_INPUT = 3
# Dask looks at its own processes many times a second. One that waits for a program needs no such
# looks: on one machine they take processor time that the tasks need.
QUIET = {"distributed.worker.profile.enabled": False, "distributed.admin.tick.interval": "1s"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    choices = _parser().parse_args(arguments)
    # A cluster manager asks to end with SIGTERM.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        job = read_job(choices.job)
        with _connect(choices) as client:
            run = JobRun(job, client, _options(choices))
            return _run(run, as_json=choices.json)
    except JobError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except ClusterError as error:
        print(f"error: {error}", file=sys.stderr)
        return TEMPORARY
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(run: JobRun, *, as_json: bool) -> int:
    try:
        run.run()
        exit_code = run.summary.exit_code
    except KeyboardInterrupt:
        print("cancelled; what is done stays done", file=sys.stderr)
        exit_code = INTERRUPTED
    except ClusterError as error:
        print(f"error: {error}; run again, what is done stays done", file=sys.stderr)
        exit_code = TEMPORARY
    _print_summary(run.summary, exit_code, as_json=as_json)
    return exit_code


def _print_summary(summary: Summary, exit_code: int, *, as_json: bool) -> None:
    print(summary.to_json(exit_code) if as_json else summary.to_text(), flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tunnelstitch-dask",
        description="Run the tasks of a job (tunnelstitch plan-job) on a Dask cluster.",
        epilog="Exit codes: 0 all done; 1 failed tasks; 2 wrong usage; 3 bad job; 4 results that "
        "may not be used; 75 no cluster; 130 cancelled.",
    )
    parser.add_argument("job", metavar="JOB", help="folder of the job")
    cluster = parser.add_mutually_exclusive_group(required=True)
    cluster.add_argument(
        "--scheduler", metavar="ADDRESS", help="scheduler of a cluster, as tcp://host:8786"
    )
    cluster.add_argument(
        "--local", metavar="WORKERS", type=_positive, help="start this many workers here"
    )
    parser.add_argument(
        "--threads-per-worker",
        metavar="N",
        type=_positive,
        default=1,
        help="tasks and processors of a worker of --local [default: 1]",
    )
    parser.add_argument(
        "--program",
        metavar="PATH",
        default="tunnelstitch",
        help="tunnelstitch on the workers [default: on their PATH]",
    )
    parser.add_argument(
        "--worker-path",
        metavar="PATH",
        help="folder of the job as workers see it [default: as here]",
    )
    parser.add_argument(
        "--retries",
        metavar="N",
        type=_count,
        default=RunOptions.retries,
        help="further attempts of a task that failed by memory, disk, time limit or signal "
        "[default: %(default)s]",
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    parser.add_argument("--version", action="version", version=_version())
    return parser


def _options(choices: argparse.Namespace) -> RunOptions:
    program: str = choices.program
    if choices.local and os.sep in program:
        program = str(Path(program).absolute())
    return RunOptions(program=program, retries=choices.retries, worker_path=choices.worker_path)


@contextlib.contextmanager
def _connect(choices: argparse.Namespace) -> Iterator[Client]:
    if choices.local:
        with _local_cluster(choices) as cluster, Client(cluster) as client:
            yield client
        return
    try:
        client = Client(choices.scheduler)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"cannot reach the scheduler {choices.scheduler}: {error}; start one with "
            "`dask scheduler`, or give --local"
        ) from error
    with client:
        yield client


def _local_cluster(choices: argparse.Namespace) -> LocalCluster:
    """Workers on this machine, which declare an equal share of its memory each."""
    threads: int = choices.threads_per_worker
    dask.config.set(QUIET)
    return LocalCluster(
        n_workers=choices.local,
        threads_per_worker=threads,
        processes=True,
        dashboard_address=None,
        silence_logs=logging.ERROR,
        preload=["tunnelstitch_dask.ignore_interrupt"],
        resources={CORES: threads, MEMORY: MEMORY_LIMIT / choices.local},
    )


def _positive(text: str) -> int:
    value = _count(text)
    if value < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError("must not be negative")
    return value


def _version() -> str:
    try:
        return f"tunnelstitch-dask {version('tunnelstitch-dask')}"
    except PackageNotFoundError:
        return "tunnelstitch-dask, not installed"
