"""Rows in several processes: as in one, bit for bit; and what happens where a process or the program is lost."""

import contextlib
import importlib
import os
import signal
import subprocess
import sys
import time
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from tral_env import vector_processes
from tral_env.errors import ConfigError, LostWorkerError
from tral_env.vector_env import TralCorridorVectorEnv
from tral_env.vector_processes import TralCorridorProcesses, vector_env
from tral_fsm import load_policy
from tral_fsm.formats import library

LEARNING: dict[str, Any] = {"decision_hz": 20, "observation": "features", "history": 4, "action": "speed"}


def both(n: int, processes: int, **options: Any) -> tuple[TralCorridorVectorEnv, TralCorridorProcesses]:
    one, many = vector_env(n, **options), vector_env(n, processes=processes, **options)
    assert isinstance(one, TralCorridorVectorEnv)
    assert isinstance(many, TralCorridorProcesses)
    return one, many


def same(one: Mapping[str, Any], other: Mapping[str, Any]) -> None:
    """Two infos tell the same where their masks are true."""
    assert one.keys() == other.keys()
    for name in one:
        if name.startswith("_"):
            assert np.array_equal(one[name], other[name]), name
        elif isinstance(one[name], Mapping):
            same(one[name], other[name])
        else:
            mask = one[f"_{name}"]
            assert one[name].dtype == other[name].dtype, name
            assert np.array_equal(one[name][mask], other[name][mask], equal_nan=True), name


def drive(one: Any, many: Any, steps: int) -> int:
    """Drive both with the same actions; the number of episodes that ended."""
    rng, n, ended = np.random.default_rng(0), one.num_envs, 0
    for _ in range(steps):
        actions = rng.uniform(-1, 1, (n, 2)).astype(np.float32)
        first, second = one.step(actions), many.step(actions)
        for a, b in zip(first[:4], second[:4], strict=True):
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)
        same(first[4], second[4])
        done = first[2] | first[3]
        ended += int(done.sum())
        if one.metadata["autoreset_mode"].value == "Disabled" and done.any():
            again, other = (env.reset(options={"reset_mask": done}) for env in (one, many))
            assert np.array_equal(again[0], other[0])
            same(again[1], other[1])
    return ended


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_rows_drive_as_in_one_process(mode: str) -> None:
    options = {"scenario": ("corners", "gates"), "autoreset_mode": mode, "courses": 5, **LEARNING}
    one, many = both(5, 2, **options)
    with contextlib.closing(one), contextlib.closing(many):
        assert (many.observation_space, many.action_space) == (one.observation_space, one.action_space)
        assert (many.metadata, many.provided_readings) == (one.metadata, one.provided_readings)
        assert many.learner_options == one.learner_options
        asked: dict[str, Any] = {"seed": 5, "options": {"car": {"friction": np.linspace(0.5, 1.2, 5)}}}
        first, second = one.reset(**asked), many.reset(**asked)
        assert np.array_equal(first[0], second[0])
        same(first[1], second[1])
        assert drive(one, many, 160) >= 2


def test_a_machine_is_corrected_as_in_one_process() -> None:
    learner = {"decision_hz": 10, "observation": "features", "history": 2}
    one, many = both(4, 2, scenario="corners", autoreset_mode="SameStep", **learner)
    with contextlib.closing(one), contextlib.closing(many):
        for env in (one, many):
            env.correct(load_policy("corners"), 0.2, 0.5)
            env.reset(seed=7)
        drive(one, many, 30)


def test_the_rendered_camera_sees_what_it_sees_in_one_process() -> None:
    one, many = both(3, 2, scenario="gates", camera="rendered", autoreset_mode="SameStep")
    with contextlib.closing(one), contextlib.closing(many):
        assert np.array_equal(one.reset(seed=4)[0], many.reset(seed=4)[0])
        drive(one, many, 40)


def test_the_chosen_rows_are_rendered() -> None:
    options = {"scenario": "straight", "render_mode": "rgb_array", "width": 64, "height": 48, "randomization": "none"}
    one, many = both(3, 2, **options)
    with contextlib.closing(one), contextlib.closing(many):
        one.reset(seed=0)
        many.reset(seed=0)
        pictures = many.render_rows([2, 0])
        assert [each.shape for each in pictures] == [(48, 64, 3)] * 2
        for mine, other in zip(pictures, one.render_rows([2, 0]), strict=True):
            assert np.abs(mine.astype(int) - other).mean() < 1.0
        assert len(many.render() or ()) == 3
        assert len(many.render_rows([-1])) == 1
        for env in (one, many):
            with pytest.raises(IndexError):
                env.render_rows([3])


def test_gymnasium_makes_it() -> None:
    env = gym.make_vec("tral_env:TralCorridor-v0", num_envs=3, processes=2, scenario="straight")
    with contextlib.closing(env):
        assert isinstance(env, TralCorridorProcesses)
        assert env.spec is not None
        assert env.spec.kwargs["processes"] == 2
        assert env.reset(seed=0)[0].shape == (3, 20)


class Unknown:
    """Cannot be found by another process: this module is not on its path."""

    __module__ = "a_module_that_is_not_there"


def test_a_policy_beside_the_script_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "beside_the_script.py").write_text(
        "from tral_fsm.runtime.policy import MachinePolicy\nclass Own(MachinePolicy): pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    policy = importlib.import_module("beside_the_script").Own(library.load("corners"))
    with contextlib.closing(TralCorridorProcesses(2, 2, scenario="straight")) as env:
        env.correct(policy, 0.2, 0.5)
        assert env.reset(seed=0)[0].shape == (2, 20)


def test_modules_of_the_current_folder_do_not_count(tmp_path: Path) -> None:
    """As for a script that runs from another folder: only what stands beside the script is found."""
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "random.py").write_text("raise RuntimeError('not this one')\n")
    script = tmp_path / "program.py"
    script.write_text(
        "from tral_env.vector_processes import vector_env\n"
        "env = vector_env(2, processes=2, scenario='straight')\n"
        "print(env.reset(seed=0)[0].shape)\n"
        "env.close()\n"
    )
    told = subprocess.run([sys.executable, script], cwd=tmp_path / "here", capture_output=True, text=True, check=False)
    assert told.stdout == "(2, 20)\n", told.stderr


class TestRefused:
    def test_a_policy_whose_class_stands_in_the_script(self, tmp_path: Path) -> None:
        script = tmp_path / "program.py"
        script.write_text(
            "from tral_env.errors import ConfigError\n"
            "from tral_env.vector_processes import vector_env\n"
            "class Own: pass\n"
            "env = vector_env(2, processes=2, scenario='straight')\n"
            "try:\n"
            "    env.correct(Own(), 0.2, 0.5)\n"
            "except ConfigError as error:\n"
            "    print(error)\n"
            "env.close()\n"
        )
        told = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
        assert "'Own'" in told.stdout, told.stderr
        assert "move the class from the script to a module beside it" in told.stdout

    def test_the_rows_of_a_refusal_are_named(self) -> None:
        with contextlib.closing(TralCorridorProcesses(4, 2, scenario="straight")) as env:
            with pytest.raises(ConfigError, match="friction") as refused:
                env.reset(seed=0, options={"car": {"friction": np.array([0.5, 0.5, 0.5, -1.0])}})
            assert "rows 2 to 3" in refused.value.__notes__[0]

    def test_a_policy_that_the_processes_cannot_read(self, monkeypatch: pytest.MonkeyPatch) -> None:
        here = types.ModuleType("a_module_that_is_not_there")
        here.Unknown = Unknown  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, here.__name__, here)
        with contextlib.closing(TralCorridorProcesses(2, 2, scenario="straight")) as env:
            with pytest.raises(ModuleNotFoundError, match="a_module_that_is_not_there"):
                env.correct(Unknown(), 0.2, 0.5)  # type: ignore[arg-type]
            assert env.reset(seed=0)[0].shape == (2, 20)

    def test_a_policy_that_cannot_be_pickled(self) -> None:
        with contextlib.closing(TralCorridorProcesses(2, 2, scenario="straight")) as env:
            with pytest.raises(ConfigError, match=r"correct: .*<lambda>.*: with processes=1 it need not be pickled"):
                env.correct(lambda: None, 0.2, 0.5)  # type: ignore[arg-type]
            assert env.reset(seed=0)[0].shape == (2, 20)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"processes": 3}, "processes = 3: expected at most one for each of the 2 cars"),
            ({"processes": 0}, "processes = 0: expected a whole number, 1 or more"),
            ({"processes": 2, "scenario": "corner"}, "corner"),
            ({"processes": 2, "autoreset_mode": "Never"}, "autoreset_mode"),
        ],
    )
    def test_options(self, options: dict[str, Any], message: str) -> None:
        with pytest.raises(ConfigError, match=message):
            vector_env(2, **options)

    def test_what_a_reset_or_a_step_is_given(self) -> None:
        with contextlib.closing(TralCorridorProcesses(4, 2, scenario="straight", autoreset_mode="Disabled")) as env:
            for asked, message in (
                ({"seed": [1, 2]}, "2 seeds for 4 environments"),
                ({"options": {"reset_mask": [True] * 2}}, r"expected bool \(4,\)"),
                ({"options": {"car": {"friction": [0.5, 0.6]}}}, "friction has 2 values: expected one, or 4"),
                ({"options": {"car": {"grip": 0.5}}}, "grip"),
            ):
                with pytest.raises(ConfigError, match=message):
                    env.reset(**asked)
            env.reset(seed=0)
            with pytest.raises(ConfigError, match=r"\(2, 2\): expected \(4, 2\)"):
                env.step(np.zeros((2, 2)))
            assert env.step(np.zeros((4, 2)))[1].shape == (4,)  # what was refused has harmed nothing


def worker_pids(parent: int) -> list[int]:
    told = subprocess.run(["ps", "-o", "pid=,args=", "--ppid", str(parent)], capture_output=True, text=True, check=True)
    return [int(line.split()[0]) for line in told.stdout.splitlines() if "vector_worker" in line]


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def await_end(pids: list[int]) -> bool:
    until_s = time.monotonic() + 30.0
    while any(map(alive, pids)) and time.monotonic() < until_s:
        time.sleep(0.05)
    return not any(map(alive, pids))


class TestLost:
    def test_a_process_that_is_killed_is_told_and_all_others_end(self) -> None:
        env = TralCorridorProcesses(4, 2, scenario="straight")
        env.reset(seed=0)
        workers = worker_pids(os.getpid())[-2:]
        os.kill(workers[1], signal.SIGKILL)
        with pytest.raises(
            LostWorkerError, match=r"the process of the rows 2 to 3 is gone \(exit code -9\).*make the env"
        ):
            env.step(np.zeros((4, 2)))
        assert await_end(workers)
        with pytest.raises(LostWorkerError, match="the environment is closed"):
            env.step(np.zeros((4, 2)))
        env.close()
        env.close()

    def test_ctrl_c_while_large_answers_are_written_ends_the_processes_at_once(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        """An answer that nobody reads is larger than a pipe: the process must not wait for its reader for ever."""
        env = TralCorridorProcesses(64, 1, scenario="straight", **(LEARNING | {"history": 12}))
        observation, _ = env.reset(seed=0)
        assert observation.nbytes > 2**16

        def interrupt(stream: object) -> bytes:
            raise KeyboardInterrupt

        workers = worker_pids(os.getpid())[-1:]
        monkeypatch.setattr(vector_processes, "receive", interrupt)
        monkeypatch.setattr(vector_processes, "_END_S", 500.0)  # none is killed within the time of a test
        with pytest.raises(KeyboardInterrupt):
            env.step(np.zeros((64, 2)))
        assert not any(map(alive, workers))
        assert env.closed
        assert "Error" not in capfd.readouterr().err

    def test_a_process_that_fails_says_where_to_look(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        (tmp_path / "numpy.py").write_text("raise RuntimeError('broken')\n")
        monkeypatch.syspath_prepend(tmp_path)
        with pytest.raises(LostWorkerError, match=r"exit code 1\), and its last lines on the terminal tell why"):
            TralCorridorProcesses(2, 2, scenario="straight")

    def test_a_process_that_does_not_start_is_told(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(sys, "executable", "/there/is/no/python")
        with pytest.raises(
            LostWorkerError, match=r"the process of the rows 0 to 1 did not start: .*/there/is/no/python"
        ):
            TralCorridorProcesses(4, 2, scenario="straight")

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
    def test_the_processes_end_with_the_program(self, number: int, tmp_path: Path) -> None:
        """The program has no `if __name__ == "__main__"`: the processes do not run it."""
        script = (
            "import sys, numpy as np, gymnasium as gym\n"
            "env = gym.make_vec('tral_env:TralCorridor-v0', num_envs=2, processes=2, scenario='straight')\n"
            "env.reset(seed=0)\n"
            "print('ready', flush=True)\n"
            "while True:\n"
            "    env.step(np.zeros((2, 2)))\n"
        )
        path = tmp_path / "program.py"
        path.write_text(script)
        with subprocess.Popen(
            [sys.executable, path], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as program:
            assert program.stdout is not None
            assert program.stdout.readline() == "ready\n"
            workers = worker_pids(program.pid)
            assert len(workers) == 2
            program.send_signal(number)
            assert program.wait(30.0) != 0
        assert await_end(workers)
