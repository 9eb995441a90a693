"""The command: exit codes, a restart, two clients at once, cancelling."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import dask.config
import pytest
from distributed import Client, LocalCluster
from jobs import JobFolder, network, task

from tunnelstitch_dask import cli

MakeJob = Callable[[Iterable[Any]], JobFolder]


def start(
    job: JobFolder, *arguments: str, environment: dict[str, str] | None = None
) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tunnelstitch_dask", str(job.folder), "--json"]
    return subprocess.Popen(
        [*command, "--program", job.program, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=environment,
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, Any, str]:
    """Returns the exit code, the summary and the progress."""
    out, err = process.communicate(timeout=60)
    return process.returncode, json.loads(out) if out else None, err


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def address(client: Client) -> str:
    return str(client.scheduler_info(n_workers=0)["address"])


def test_a_killed_client_is_followed_by_another_that_repeats_nothing(
    client: Client, make_job: MakeJob
) -> None:
    job = make_job(network(4, seconds=1.0))
    first = start(job, "--scheduler", address(client))
    wait_until(lambda: job.runs("K0.refine") + job.runs("K1.refine") > 0)
    wait_until(lambda: len(job.running()) > 0)
    first.kill()
    first.communicate()
    code, summary, _ = finish(start(job, "--scheduler", address(client)))
    assert code == 0
    assert summary["up_to_date"]
    assert len(summary["done"]) + len(summary["up_to_date"]) == 12
    assert all(job.starts(f"K{k}.refine") == 1 for k in range(4))
    assert all(job.runs(f"K{k}.report") == 1 for k in range(4))


def test_two_clients_at_once_run_each_task_once(client: Client, make_job: MakeJob) -> None:
    job = make_job(network(4, seconds=0.5))
    both = [start(job, "--scheduler", address(client)) for _ in range(2)]
    ends = [finish(process) for process in both]
    for code, summary, _ in ends:
        assert code == 0
        assert not summary["failed"]
    done = [name for _, summary, _ in ends for name in summary["done"]]
    assert len(done) == len(set(done)) == 12
    assert all(job.starts(name) == 1 for name in done)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_cancelled_run_leaves_nothing_behind(
    client: Client, make_job: MakeJob, number: signal.Signals
) -> None:
    job = make_job([task(f"K{k}.refine", seconds=30.0) for k in range(6)])
    process = start(job, "--scheduler", address(client))
    wait_until(lambda: len(job.running()) == 3)
    process.send_signal(number)
    begin = time.monotonic()
    code, summary, err = finish(process)
    assert code == summary["exit_code"] == 130
    assert len(summary["unfinished"]) == 6
    assert "cancelled" in err
    assert time.monotonic() - begin < 10
    assert not job.running()
    wait_until(lambda: not any(client.processing().values()))
    assert sum(job.starts(f"K{k}.refine") for k in range(6)) == 3


def test_local_workers_run_the_job_and_end_with_a_terminal_interrupt(make_job: MakeJob) -> None:
    job = make_job([*network(1, seconds=0.0), task("K9.refine", seconds=60.0)])
    process = start(job, "--local", "1", "--threads-per-worker", "2")
    wait_until(lambda: job.runs("K0.report") == 1 and len(job.running()) == 1)
    # A terminal sends it to the workers, too.
    os.killpg(process.pid, signal.SIGINT)
    code, summary, err = finish(process)
    assert code == 130
    # What the last one told may have come too late.
    assert {"K0.refine", "K0.stitch"} <= set(summary["done"])
    assert "K9.refine" in summary["unfinished"]
    assert "Traceback" not in err
    assert not job.running()


def test_a_scheduler_that_is_lost_is_told(make_job: MakeJob) -> None:
    job = make_job([task("K0.refine", seconds=30.0)])
    environment = {**os.environ, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s"}
    with LocalCluster(n_workers=1, host="127.0.0.1", dashboard_address=None) as cluster:
        process = start(job, "--scheduler", cluster.scheduler_address, environment=environment)
        wait_until(lambda: len(job.running()) == 1)
    code, summary, err = finish(process)
    assert code == 75, err
    assert summary["exit_code"] == 75
    assert summary["unfinished"] == ["K0.refine"]
    assert "what is done stays done" in err


def test_errors_have_their_exit_codes(
    make_job: MakeJob, capsys: pytest.CaptureFixture[str]
) -> None:
    job = make_job([task("K0.refine")])
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nobody = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        with dask.config.set({"distributed.comm.timeouts.connect": "0.5s"}):
            assert cli.main([str(job.folder), "--scheduler", nobody]) == 75
    assert f"cannot reach the scheduler {nobody}" in capsys.readouterr().err
    assert cli.main([str(job.folder / "none"), "--local", "1"]) == 3
    assert "plan-job" in capsys.readouterr().err
    with pytest.raises(SystemExit) as usage:
        cli.main([str(job.folder)])
    assert usage.value.code == 2
