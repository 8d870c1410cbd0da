"""The person before the car: what is said, and what is asked, over a keyboard, also by ssh."""

from __future__ import annotations

from collections.abc import Callable

from tral_env.errors import TralError

YES, NO = ("y", "yes"), ("n", "no")
QUIT = ("q", "quit")


class BrokenOff(TralError, RuntimeError):  # noqa: N818 (it is no error of anybody)
    """The person ended the calibration; what was done is kept."""


class Person:
    """Says and asks line by line; nothing here moves while a question waits for its answer."""

    def __init__(self, say: Callable[[str], None] = print, read: Callable[[str], str] = input) -> None:
        """Speak through a terminal.

        Args:
            say: shows a line.
            read: shows a question, and gives the line that was typed; EOFError: there will be none.
        """
        self._say, self._read = say, read

    def say(self, text: str) -> None:
        """Show a line."""
        self._say(text)

    def ask(self, question: str, *, keep_case: bool = False) -> str:
        """Ask, and give the answer without spaces around it, in small letters unless its case counts.

        Raises:
            BrokenOff: the answer was q, or there is nobody.
        """
        try:
            answer = self._read(f"{question} ").strip()
        except EOFError as error:
            raise BrokenOff("nobody answers") from error
        if answer.lower() in QUIT:
            raise BrokenOff("broken off")
        return answer if keep_case else answer.lower()

    def agrees(self, question: str) -> bool:
        """Ask until the answer is yes or no."""
        return self.chooses(question, {"y": YES, "n": NO}) == "y"

    def chooses(self, question: str, choices: dict[str, tuple[str, ...]]) -> str:
        """Ask until the answer is one of some choices, each with the answers that mean it; the choice."""
        while True:
            answer = self.ask(f"{question} [{'/'.join(choices)}/q]")
            for choice, answers in choices.items():
                if answer in answers:
                    return choice
            self.say(f"  '{answer}' is none of {', '.join(choices)}; q ends, and keeps what was done")
