"""Processors and memory that workers declare, and that tasks ask for."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field

from distributed import Client

from .job import Needs

# Names of the resources, as in `dask worker --resources "cores=8 memory=32e9"`.
CORES = "cores"
MEMORY = "memory"


@dataclass(frozen=True)
class Capacity:
    """The amounts that workers declare."""

    workers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Amounts by name, of each worker by its address."""

    @staticmethod
    def of_cluster(client: Client) -> Capacity:
        """The capacity of the workers that are there."""
        workers = client.scheduler_info(n_workers=-1)["workers"].items()
        return Capacity({address: worker["resources"] for address, worker in workers})

    def request(self, needs: Needs, memory_bytes: int) -> dict[str, float]:
        """The resources of a task; no more than a worker has, or it would never start."""
        wanted = {CORES: float(needs.cores), MEMORY: float(memory_bytes)}
        request = {}
        for name, amount in wanted.items():
            declared = [has[name] for has in self.workers.values() if name in has]
            if declared:
                request[name] = min(amount, max(declared))
        return request

    def others(self, request: Mapping[str, float], failed_on: Set[str]) -> list[str] | None:
        """Workers on which an attempt has not failed; None if it may run on any.

        If all of those are lost before it starts, the scheduler takes any worker, whatever it has:
        so all must have what the task asks for.
        """
        others = [address for address in self.workers if address not in failed_on]
        has_enough = all(
            has.get(name, 0.0) >= amount
            for has in self.workers.values()
            for name, amount in request.items()
        )
        return others if failed_on and others and has_enough else None
