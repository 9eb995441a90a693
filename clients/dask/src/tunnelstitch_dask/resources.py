"""Processors and memory that workers declare, and that tasks ask for."""

from __future__ import annotations

from dataclasses import dataclass

from distributed import Client

from .job import Needs

# Names of the resources, as in `dask worker --resources "cores=8 memory=32e9"`.
CORES = "cores"
MEMORY = "memory"


@dataclass(frozen=True)
class Capacity:
    """The largest amounts that a worker declares; None where none declares any."""

    cores: float | None = None
    memory_bytes: float | None = None

    @staticmethod
    def of_cluster(client: Client) -> Capacity:
        """The capacity of the workers that are there."""
        workers = client.scheduler_info(n_workers=-1)["workers"].values()

        def largest(name: str) -> float | None:
            declared = [worker["resources"].get(name) for worker in workers]
            return max((amount for amount in declared if amount is not None), default=None)

        return Capacity(largest(CORES), largest(MEMORY))

    def request(self, needs: Needs, memory_bytes: int) -> dict[str, float]:
        """The resources of a task; no more than a worker has, or it would never start."""
        request = {}
        if self.cores is not None:
            request[CORES] = min(float(needs.cores), self.cores)
        if self.memory_bytes is not None:
            request[MEMORY] = min(float(memory_bytes), self.memory_bytes)
        return request
