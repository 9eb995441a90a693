"""The job script of the README's example for Slurm, as dask-jobqueue writes it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"


def code_block(language: str, containing: str) -> str:
    """The code block of the README that has this text."""
    blocks = re.findall(rf"```{language}\n(.*?)```", README.read_text(), re.DOTALL)
    return str(next(block for block in blocks if containing in block))


def test_the_job_script_is_that_of_the_readme() -> None:
    pytest.importorskip("dask_jobqueue")
    example = code_block("python", "SLURMCluster")
    setup = example.partition("cluster.scale")[0]
    names: dict[str, object] = {}
    exec(setup, names)
    cluster = names["cluster"]
    try:
        script = cluster.job_script()  # type: ignore[attr-defined]
    finally:
        cluster.close()  # type: ignore[attr-defined]
    script = script.replace(sys.executable, "python")
    script = re.sub(r"tcp://\S+", "tcp://SCHEDULER:PORT", script)
    assert script.strip() == code_block("bash", "#SBATCH").strip()
