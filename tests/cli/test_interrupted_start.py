"""Ctrl-C ends the program `tral` with exit code 130 and without a traceback, also while it still imports."""

import os
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest

from tral_fsm import starting
from tral_fsm.evaluation.ending import interrupted_between_imports

PROGRAM = Path(sysconfig.get_path("scripts")) / "tral"
TOLD_BY_PYTHON = "import time:"
"""Python begins a line on stderr so for each module that it has imported, if it is asked to."""


def interrupted_after(module: str, *arguments: object) -> tuple[int, list[str]]:
    """Exit code and words on stderr of `tral`, which gets SIGINT once it has imported a module."""
    environment = {**os.environ, "PYTHONPROFILEIMPORTTIME": "1"}
    command = [PROGRAM, *map(str, arguments)]
    said = []
    # A narrow pipe: the program waits for the test, and cannot end before the signal comes.
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, pipesize=4096, text=True
    ) as run:
        assert run.stderr is not None
        for line in run.stderr:
            if not line.startswith(TOLD_BY_PYTHON):
                said += line.split()
            elif line.split("|")[-1].strip() == module:
                run.send_signal(signal.SIGINT)
    return run.returncode, said


@pytest.mark.parametrize(
    "module", ["tral_fsm.starting", "datetime", "numpy", "gymnasium", "pydantic", "tral_fsm", "typer"]
)
def test_while_the_program_starts(module: str) -> None:
    assert interrupted_after(module, "fsm", "states") == (130, [])


@pytest.mark.parametrize("module", ["tral_fsm.programs.drive", "mujoco._structs", "cv2"])
def test_while_a_command_imports_what_it_needs(tmp_path: Path, module: str) -> None:
    code, said = interrupted_after(module, "drive", "--scenario", "straight", "--out", tmp_path)
    assert code == 130
    assert " ".join(said) in ("", f"Stopped. The episodes that had ended are in {tmp_path}")


def import_then_wait() -> None:
    import interrupts_itself

    assert interrupts_itself.is_whole
    end_s = time.monotonic() + 60.0
    while time.monotonic() < end_s:  # one long wait, as of signal.pause, could begin just after the signal
        time.sleep(0.001)


def test_an_interrupt_amid_an_import_comes_when_the_import_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "interrupts_itself.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nis_whole = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupted_between_imports():
        import_then_wait()


def test_an_import_that_never_ends_is_interrupted_in_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hangs.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\n"
        "end_s = time.monotonic() + 60.0\nwhile time.monotonic() < end_s: time.sleep(0.001)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupted_between_imports():
        import hangs  # noqa: F401


def test_the_handler_of_before_comes_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interrupted_between_imports():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_a_program_that_ignores_the_signal_goes_on_ignoring_it() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupted_between_imports():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("name", ["train.py", "pytest", "-c"])
def test_any_other_program_keeps_its_interrupt(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(sys, "argv", [name])
    starting.guard_start()
    assert signal.getsignal(signal.SIGINT) is not starting.quit_at_once
