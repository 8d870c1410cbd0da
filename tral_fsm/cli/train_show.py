"""The terminal's view of a training."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tral_fsm.learning.choices import TrainRequest
    from tral_fsm.learning.run import Progress


class TrainBar:
    """A bar on stderr: success so far, the best validation, and the time that is left."""

    def __init__(self, request: TrainRequest) -> None:
        from rich import progress as rich
        from rich.console import Console

        self._name = f"{request.algo} on {', '.join(request.scenarios)}"
        self._bar = rich.Progress(
            rich.TextColumn("{task.description}", markup=False),
            rich.BarColumn(bar_width=20),
            rich.TaskProgressColumn(),
            rich.TimeElapsedColumn(),
            rich.TextColumn("left"),
            rich.TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._task: rich.TaskID | None = None

    def __enter__(self) -> TrainBar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self) -> None:
        """Show the bar."""
        self._task = self._bar.add_task(f"{self._name}: starting", total=1.0)

    def show(self, progress: Progress) -> None:
        """Show how far the training is."""
        success = "-" if progress.success is None else f"{100 * progress.success:.0f} %"
        best = "-" if progress.best is None else f"{100 * progress.best.success:.0f} %"
        told = f"{self._name}: success {success}, best validation {best}"
        if self._task is not None:
            self._bar.update(self._task, completed=progress.share, description=told)

    def note(self, said: str) -> None:
        """Print a line above the bar."""
        self._bar.console.print(said, markup=False, highlight=False)
