"""Files of jobs: what is right is read, what is wrong is named."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from jobs import task, tree

from tunnelstitch_dask import JobError, read_job
from tunnelstitch_dask.graph import Graph


def write(folder: Path, content: object) -> Path:
    (folder / "job.json").write_text(json.dumps(content))
    return folder


def test_a_job_is_read_from_its_folder_or_its_file(tmp_path: Path) -> None:
    write(tmp_path, tree([task("a.refine", seconds=2.0), task("a.stitch", ["a.refine"])]))
    job = read_job(tmp_path)
    assert read_job(tmp_path / "job.json") == job
    assert job.folder == tmp_path.resolve()
    assert [task.id for task in job.tasks] == ["a.refine", "a.stitch"]
    assert job.tasks[1].after == ("a.refine",)
    assert job.tasks[0].needs.seconds == 2.0


def test_what_runs_after_failures_is_not_lost_with_what_fails(tmp_path: Path) -> None:
    report = task("n.map", ["a.refine", "a.stitch"]) | {"trigger_rule": "all_done"}
    tasks = [task("a.refine"), task("a.stitch", ["a.refine"]), report, task("n.end", ["n.map"])]
    graph = Graph(read_job(write(tmp_path, tree(tasks))))
    names = [task.id for task in graph.lost_with("a.refine")]
    assert names == ["a.stitch"]
    assert len(graph.dependants("a.refine")) == 3


def change_needs(name: str, value: object) -> Callable[[Any], None]:
    def change(job: Any) -> None:
        job["tasks"][0]["needs"][name] = value

    return change


def edit(index: int, **values: object) -> Callable[[Any], None]:
    return lambda job: job["tasks"][index].update(values)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda job: job.update(version=2), "plan the job anew"),
        (lambda job: job.update(format="x"), "'x' of version 1"),
        (lambda job: job.update(extra=1), "the job has the unknown key 'extra'"),
        (edit(0, colour=1), "task 'a.refine' has the unknown key 'colour'"),
        (change_needs("gpus", 1), "'needs' has the unknown key 'gpus'"),
        (lambda job: job["tasks"][1].pop("after"), "task 'a.stitch' has no 'after'"),
        (change_needs("seconds", 0), "'seconds' is not positive"),
        (change_needs("seconds", float("nan")), "NaN is no number"),
        (change_needs("cores", 0), "'cores' is not an integer of at least 1"),
        (change_needs("memory_bytes", 1.5), "'memory_bytes' is not an integer"),
        (edit(0, id="../x"), "it names files"),
        (edit(0, command=[]), "has no command"),
        (edit(0, after="a"), "'after' is not a list of texts"),
        (edit(0, trigger_rule="any"), "'trigger_rule' is not one of all_success, all_done"),
        (edit(1, id="a.refine"), "task 'a.refine' stands twice"),
        (edit(1, after=["b"]), "comes after 'b', which is not in the job"),
        (edit(0, after=["a.refine"]), "in a cycle: a.refine -> a.refine"),
        (edit(0, after=["a.stitch"]), "in a cycle: a.refine -> a.stitch -> a.refine"),
        (lambda job: job["tasks"].reverse(), "'a.refine', which has to stand before it"),
        (lambda job: job.update(tasks={}), "'tasks' is not a list"),
    ],
)
def test_errors_name_the_file_the_task_and_the_key(
    tmp_path: Path, change: Callable[[Any], None], expected: str
) -> None:
    content = tree([task("a.refine"), task("a.stitch", ["a.refine"])])
    change(content)
    with pytest.raises(JobError) as error:
        read_job(write(tmp_path, content))
    assert expected in str(error.value)
    assert str(tmp_path / "job.json") in str(error.value)


def test_a_file_that_is_no_json_is_named_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "job.json").write_text('{\n"format": }')
    with pytest.raises(JobError, match=r"job.json:2:11: "):
        read_job(tmp_path)
    (tmp_path / "job.json").write_text('{"format": 1, "format": 2}')
    with pytest.raises(JobError, match="key 'format' stands twice"):
        read_job(tmp_path)
    with pytest.raises(JobError, match="`tunnelstitch plan-job` wrote"):
        read_job(tmp_path / "none")


def test_critical_paths_run_to_the_end_of_the_job(tmp_path: Path) -> None:
    tasks = [
        task("a.refine", seconds=5.0),
        task("b.refine", seconds=1.0),
        task("a.stitch", ["a.refine"], seconds=2.0),
        task("a.report", ["a.refine", "a.stitch"], seconds=3.0),
    ]
    job = read_job(write(tmp_path, tree(tasks)))
    graph = Graph(job)
    paths = graph.path_seconds(job.tasks, lambda task: task.needs.seconds)
    assert paths == {"a.refine": 10.0, "b.refine": 1.0, "a.stitch": 5.0, "a.report": 3.0}
    assert [task.id for task in graph.dependants("a.refine")] == ["a.stitch", "a.report"]
    assert graph.dependants("b.refine") == []
