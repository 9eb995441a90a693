"""Runs on a real scheduler with several worker processes; tasks go wrong in all ways."""

from __future__ import annotations

import io
import os
import random
import signal
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from distributed import Client, SpecCluster
from distributed.core import Status
from jobs import JobFolder, network, task

from tunnelstitch_dask import RunOptions, Summary, run_job

MakeJob = Callable[[Iterable[Any]], JobFolder]


def run(job: JobFolder, client: Client, **options: Any) -> tuple[Summary, str]:
    """Runs a job with short pauses; returns the summary and the progress."""
    stream = io.StringIO()
    choices = {"backoff_seconds": 0.05, "grace_seconds": 0.5, **options}
    summary = run_job(job.folder, client, RunOptions(program=job.program, **choices), stream)
    return summary, stream.getvalue()


def test_every_task_is_done_once_and_then_up_to_date(client: Client, make_job: MakeJob) -> None:
    job = make_job(network(4, seconds=0.0))
    summary, progress = run(job, client)
    assert len(summary.done) == 12
    assert summary.exit_code == 0
    assert not summary.retried
    assert len(job.outputs()) == 12
    assert "K0 refine" in progress
    assert "12/12 done" in progress
    again, _ = run(job, client)
    assert len(again.up_to_date) == 12
    assert not again.done
    (job.folder.parent / "input.txt").write_text("other")
    changed, _ = run(job, client)
    assert len(changed.done) == 12


def test_a_failing_input_skips_what_comes_after_it_alone(client: Client, make_job: MakeJob) -> None:
    job = make_job(network(3, seconds=0.0))
    job.set_faults("K1.refine", "bad-input", "bad-input")
    summary, progress = run(job, client)
    assert [failure.task for failure in summary.failed] == ["K1.refine"]
    assert summary.failed[0].exit_code == 3
    assert "frame 7 is no picture" in summary.failed[0].message
    assert "error: frame 7 is no picture" in summary.failed[0].log
    skips = {(skip.task, skip.because_of) for skip in summary.skipped}
    assert skips == {("K1.stitch", "K1.refine"), ("K1.report", "K1.refine")}
    assert len(summary.done) == 6
    assert job.starts("K1.refine") == 1
    assert summary.exit_code == 1
    assert "K1.refine: failed" in progress
    assert "| error: frame 7 is no picture" in summary.to_text()


def test_a_result_that_may_not_be_used_is_kept_and_nothing_comes_after_it(
    client: Client, make_job: MakeJob
) -> None:
    job = make_job(network(2, seconds=0.0))
    job.set_faults("K0.refine", "not-usable")
    for _ in range(2):
        summary, _progress = run(job, client)
        assert summary.not_usable == ["K0.refine"]
        assert [skip.task for skip in summary.skipped] == ["K0.stitch", "K0.report"]
        assert summary.exit_code == 4
    assert job.starts("K0.refine") == 1


def with_report(tasks: list[Any]) -> list[Any]:
    """Tasks, and one that runs when all of them have ended."""
    report = task("network.map", [task["id"] for task in tasks])
    return [*tasks, report | {"trigger_rule": "all_done"}]


def test_a_report_on_all_tasks_runs_after_failures_and_again_after_a_change(
    client: Client, make_job: MakeJob
) -> None:
    job = make_job(with_report(network(3, seconds=0.0)))
    job.set_faults("K0.refine", "bad-input")
    job.set_faults("K1.refine", "not-usable")
    job.set_faults("K2.stitch", "full-disk", "full-disk")
    summary, _ = run(job, client, retries=1)
    assert {failure.task for failure in summary.failed} == {"K0.refine", "K2.stitch"}
    assert "network.map" in summary.done
    assert job.runs("network.map") == 1
    partial = job.outputs()["network/map.txt"]
    again, _ = run(job, client)
    assert "network.map" in again.done
    assert job.outputs()["network/map.txt"] != partial
    last, _ = run(job, client)
    assert "network.map" in last.up_to_date


def test_temporary_failures_are_retried_as_often_as_allowed(
    client: Client, make_job: MakeJob
) -> None:
    job = make_job(network(2, seconds=0.0))
    job.set_faults("K0.refine", "full-disk", "killed")
    job.set_faults("K1.stitch", *["full-disk"] * 9)
    begin = time.monotonic()
    summary, _ = run(job, client, retries=2, backoff_seconds=0.2)
    assert time.monotonic() - begin > 0.2 + 0.4
    assert [failure.task for failure in summary.failed] == ["K1.stitch"]
    assert "No space left on device" in summary.failed[0].message
    assert job.starts("K1.stitch") == 3
    assert job.starts("K0.refine") == 3
    assert {"K0.refine", "K0.stitch", "K0.report", "K1.refine"} == set(summary.done)
    assert [retry.task for retry in summary.retried].count("K0.refine") == 2
    assert [skip.task for skip in summary.skipped] == ["K1.report"]


def test_what_fails_on_a_worker_is_run_on_another(client: Client, make_job: MakeJob) -> None:
    names = [f"K{k}.refine" for k in range(9)]
    job = make_job([task(name, memory_bytes=900) for name in names])
    for name in names:
        # The worker of this memory; it is idle again at once, so that it is given much.
        job.set_faults(name, *["full-disk-of 4000"] * 3)
    summary, _ = run(job, client, retries=1)
    assert sorted(summary.done) == names
    assert summary.retried


def test_a_task_out_of_memory_gets_a_worker_with_more(client: Client, make_job: MakeJob) -> None:
    tasks = [task(f"K{k}.refine", memory_bytes=900) for k in range(6)]
    job = make_job(tasks)
    for k in range(6):
        job.set_faults(f"K{k}.refine", *["memory 3000"] * 4)
    summary, _ = run(job, client)
    assert len(summary.done) == 6
    # 900, 1800 and 3600 bytes: from the second attempt on, one worker has as much.
    assert all(job.starts(f"K{k}.refine") <= 2 for k in range(6))
    assert {retry.cause for retry in summary.retried} == {"memory or signal 9"}


def test_a_task_of_more_memory_than_any_worker_runs_on_the_largest(
    client: Client, make_job: MakeJob
) -> None:
    job = make_job([task("K0.refine", memory_bytes=10**12, cores=64)])
    job.set_faults("K0.refine", "memory 4000")
    summary, _ = run(job, client)
    assert summary.done == ["K0.refine"]
    assert not summary.retried


def test_tasks_that_do_not_end_are_ended(client: Client, make_job: MakeJob) -> None:
    limits = {"K0": "slow", "K1": "hang", "K2": "stop-worker"}
    job = make_job([task(f"{name}.refine", limit_seconds=0.5) for name in limits])
    for name, fault in limits.items():
        job.set_faults(f"{name}.refine", fault)
    summary, _ = run(job, client)
    assert sorted(summary.done) == ["K0.refine", "K1.refine", "K2.refine"]
    causes = {retry.task: retry for retry in summary.retried}
    assert {retry.cause for retry in causes.values()} == {"time limit"}
    assert "limit of 0 seconds" in causes["K0.refine"].message
    assert "did not end within its time limit" in causes["K1.refine"].message
    assert "is restarted" in causes["K2.refine"].message
    assert not job.running()


def test_a_program_or_folder_that_workers_do_not_see_is_named(
    client: Client, make_job: MakeJob
) -> None:
    job = make_job([task("K0.refine")])
    summary, _ = run(JobFolder(job.folder, "/nowhere/tunnelstitch"), client)
    assert "cannot start /nowhere/tunnelstitch" in summary.failed[0].message
    summary, _ = run(job, client, worker_path="/nowhere")
    assert "does not see /nowhere/job.json" in summary.failed[0].message
    assert summary.exit_code == 1


def test_workers_killed_at_random_change_no_byte(
    client: Client, cluster: SpecCluster, make_job: MakeJob, tmp_path: Path
) -> None:
    job = make_job(network(8, seconds=0.4))
    # The duration of the work is part of the command, so of the key and of the stub's bytes.
    expected = JobFolder.create(make_folder(tmp_path / "expected"), network(8, seconds=0.4))
    kills = 0
    stop = threading.Event()

    def kill_workers() -> None:
        nonlocal kills
        choice = random.Random(1)
        while kills < 20 and not stop.wait(choice.uniform(0.2, 0.6)):
            nanny = choice.choice(list(cluster.workers.values()))
            # A nanny gives up on a worker that dies before it has started.
            process = nanny.process
            if process is not None and process.status is Status.running and nanny.pid:
                os.kill(nanny.pid, signal.SIGKILL)
                kills += 1

    killer = threading.Thread(target=kill_workers)
    killer.start()
    try:
        summary, _ = run(job, client, retries=20)
    finally:
        stop.set()
        killer.join()
    assert kills == 20
    assert summary.exit_code == 0
    assert sorted(summary.done + summary.up_to_date) == sorted(
        f"K{k}.{step}" for k in range(8) for step in ("refine", "stitch", "report")
    )
    assert any(retry.cause == "worker lost" for retry in summary.retried)
    assert all(job.runs(name) == 1 for name in summary.done + summary.up_to_date)
    assert not job.running()
    run(expected, client)
    assert job.outputs() == expected.outputs()


def make_folder(path: Path) -> Path:
    path.mkdir()
    return path
