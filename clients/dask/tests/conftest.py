"""A scheduler with several worker processes on loopback, and jobs of stub tasks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import dask.config
import pytest
from distributed import Client, Nanny, Scheduler, SpecCluster
from jobs import JobFolder

WORKERS = 3
# The memory that each worker declares, bytes.
MEMORY_BYTES = (1000, 1000, 4000)


@pytest.fixture(scope="session")
def cluster() -> Iterator[SpecCluster]:
    """Workers of one thread, of which the last declares more memory."""
    os.environ["DASK_LOGGING__DISTRIBUTED"] = "error"
    workers = {
        k: {
            "cls": Nanny,
            "options": {
                "nthreads": 1,
                "resources": {"cores": 1, "memory": memory},
                "env": {"STUB_MEMORY_BYTES": str(memory)},
            },
        }
        for k, memory in enumerate(MEMORY_BYTES)
    }
    scheduler = {
        "cls": Scheduler,
        "options": {"dashboard": False, "port": 0, "host": "127.0.0.1"},
    }
    # Otherwise a worker that is killed again just then is given up.
    dask.config.set({"distributed.deploy.lost-worker-timeout": "1h"})
    with SpecCluster(workers=workers, scheduler=scheduler, silence_logs=50) as cluster:
        yield cluster


@pytest.fixture
def client(cluster: SpecCluster) -> Iterator[Client]:
    """A client of the cluster, all of whose workers are there."""
    with Client(cluster) as client:
        client.wait_for_workers(WORKERS, timeout=30)
        yield client


@pytest.fixture
def make_job(tmp_path: Path) -> Iterator[Callable[[Iterable[Any]], JobFolder]]:
    """Writes a job; what runs after the test is killed."""
    jobs: list[JobFolder] = []

    def make(tasks: Iterable[Any]) -> JobFolder:
        jobs.append(JobFolder.create(tmp_path, tasks))
        return jobs[-1]

    yield make
    for job in jobs:
        job.kill()
