"""Drives on a Dask cluster: a real scheduler and two workers, each a process."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tral_env.errors import ConfigError
from tral_fsm import load_machine
from tral_fsm.evaluation.cluster import Cluster
from tral_fsm.evaluation.comparison import drive_field, key
from tral_fsm.evaluation.contenders import contenders
from tral_fsm.evaluation.records import read_lines
from tral_fsm.evaluation.suites import suite as suite_named
from tral_fsm.tuning import Evaluator, Task

Client = pytest.importorskip("distributed", reason="the extra `cluster` is not installed").Client
# Dask leaves sockets to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")

MACHINES = Path(__file__).parents[2] / "benchmarks" / "machines.py"
TASK = Task(scenarios=("straight",), seeds=tuple(range(4)))


@contextmanager
def started(*arguments: str):
    """A process of Dask that ends with the block."""
    code = "import sys; from dask.__main__ import main; sys.argv[0] = 'dask'; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def scheduler(told: Path):
    """Address of a scheduler."""
    where = ("--scheduler-file", str(told), "--no-dashboard", "--host", "127.0.0.1", "--port", "0")
    with started("scheduler", *where):
        wait_until(told.exists)
        yield json.loads(told.read_text())["address"]


@pytest.fixture
def cluster(tmp_path: Path):
    """Address of a scheduler with two workers, and the processes of the workers."""
    with ExitStack() as stack:
        address = stack.enter_context(scheduler(tmp_path / "scheduler.json"))
        worker = ("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        folder = ("--local-directory", str(tmp_path))
        workers = [stack.enter_context(started(*worker, *folder)) for _ in range(2)]
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=120)
        yield address, workers


def wait_until(true, limit_s: float = 120.0) -> None:
    end = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_a_cluster_drives_as_one_process_does_also_when_a_worker_is_lost(cluster):
    address, workers = cluster
    machines = [load_machine("wall")]
    with Evaluator(TASK) as here:
        expected = here.on_courses(machines, TASK.courses)

    counts: list[int] = []

    def lose_one(stage):
        counts.append(stage.done)
        if stage.done:
            os.kill(workers[0].pid, signal.SIGKILL)

    with Evaluator(TASK, processes=address, on_stage=lose_one) as there:
        assert there.on_courses(machines, TASK.courses) == expected
        assert there.on_courses(machines, TASK.courses) == expected
    assert counts[-1] == 2 * len(machines) * len(TASK.courses)


@pytest.mark.slow
def test_a_comparison_on_a_cluster_has_the_records_of_one_process(cluster, tmp_path):
    address, _ = cluster
    suite = suite_named("smoke").with_courses(1)
    kept = []
    for name, workers in (("here", 1), ("there", address)):
        (tmp_path / name).mkdir()
        lines = drive_field(suite, contenders("constant"), tmp_path / name, workers)
        kept.append(sorted((line for line in lines if line["kind"] == "drive"), key=key))
    assert kept[0]
    assert kept[0] == kept[1]


@pytest.mark.slow
def test_a_benchmark_on_a_cluster_has_the_records_of_one_process(cluster, tmp_path):
    address, _ = cluster
    made = []
    for who in (("--processes", "1"), ("--cluster", address)):
        out = tmp_path / f"{who[0][2:]}.jsonl"
        what = ("--seeds", "0:2", "--scenarios", "straight", "--own", "--out", str(out))
        subprocess.run([sys.executable, str(MACHINES), *what, *who], check=True, capture_output=True)
        lines = [line for line in read_lines(out) if line["kind"] == "drive"]
        made.append(sorted(lines, key=lambda line: line["seed"]))
    assert len(made[0]) == 2
    assert made[0] == made[1]


def test_a_cluster_without_workers_is_refused(tmp_path):
    told = tmp_path / "scheduler.json"
    with scheduler(told) as address, pytest.raises(ConfigError, match=r"no worker.*dask worker tcp:"):
        Cluster(address)


def test_where_no_scheduler_is_the_error_names_the_remedy(monkeypatch):
    monkeypatch.setattr("tral_fsm.evaluation.cluster._CONNECT_S", 0.2)
    with pytest.raises(ConfigError, match=r"no Dask scheduler.*dask scheduler"):
        Cluster("tcp://127.0.0.1:1")
