"""Runs the jobs of tunnelstitch (`job.json`, docs/jobs.md) on a Dask cluster.

read_job ─> JobRun ─┬─> Graph: priorities, dependants
                    ├─> Capacity: resources that workers declare
                    ├─> run_task, on workers, under a supervisor
                    └─> Progress, Summary
"""

from .job import Job, JobError, Needs, Task, read_job
from .run import ClusterError, JobRun, RunOptions, run_job
from .summary import Failure, Retry, Skip, Summary

__all__ = [
    "ClusterError",
    "Failure",
    "Job",
    "JobError",
    "JobRun",
    "Needs",
    "Retry",
    "RunOptions",
    "Skip",
    "Summary",
    "Task",
    "read_job",
    "run_job",
]
