"""A car file that is changed value by value: its comments stay, and it is written whole or not at all."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError, MissingExtraError
from tral_env.hardware.car_file import CarFile, parse_car, read_car_text


class CarText:
    """The text of a car file, and the car that it describes."""

    def __init__(self, path: Path) -> None:
        """Read a car file.

        Raises:
            BadFileError: it cannot be read, or is no car.
            MissingExtraError: tomlkit is not installed.
        """
        try:
            import tomlkit
        except ImportError as error:
            raise MissingExtraError("tomlkit", "car", "a car file that keeps its comments") from error
        self.path, self._tomlkit = path, tomlkit
        self.car: CarFile
        self.read()

    def read(self) -> Any:
        """Read the file, also again: somebody may have changed it in an editor meanwhile.

        Returns:
            The document, whose comments stay.

        Raises:
            BadFileError: it cannot be read, or is no car.
        """
        text = read_car_text(self.path)
        self.car = parse_car(text, str(self.path), self.path.parent)
        return self._tomlkit.parse(text)

    def put(self, values: dict[tuple[str | int, ...], Any]) -> None:
        """Put values into the file as it is now, and write it; a value of None takes its key away.

        Args:
            values: path of names (and numbers of sensors) -> value.

        Raises:
            BadFileError: the file is no car, or would not be one any more; nothing was written.
            ConfigError: the file cannot be written.
        """
        document = self.read()
        for (*tables, name), value in values.items():
            place = document
            for table in tables:
                if isinstance(table, str) and table not in place:
                    place[table] = self._tomlkit.table()
                place = place[table]
            if value is not None:
                place[name] = value
            elif name in place:
                del place[name]
        text = document.as_string()
        self.car = parse_car(text, str(self.path), self.path.parent)
        try:
            write_bytes(self.path, text.encode())
        except OSError as error:
            raise ConfigError(f"cannot write '{self.path}': {error}") from error

    def done(
        self, step: str, values: dict[tuple[str | int, ...], Any] | None = None, *, day: date | None = None
    ) -> None:
        """Put the values that a step found, and the day on which it was done."""
        self.put({**(values or {}), ("calibrated", step): day or date.today()})
