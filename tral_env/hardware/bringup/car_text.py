"""A car file that is changed value by value: its comments stay, and it is written whole or not at all."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Any

from tral_env import json_text
from tral_env.atomic import write_bytes
from tral_env.errors import BadFileError, ConfigError, MissingExtraError
from tral_env.hardware.car_file import CarFile, parse_car


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
        self.path = path
        try:
            text = json_text.read(path)
        except (OSError, UnicodeDecodeError) as error:
            raise BadFileError(
                f"cannot read '{path}': {error}. `tral car init` writes a car file to begin with"
            ) from error
        self.car: CarFile = parse_car(text, str(path), path.parent)
        self._document: Any = tomlkit.parse(text)
        self._new_table = tomlkit.table

    def put(self, values: dict[tuple[str | int, ...], Any]) -> None:
        """Put values into the file, and write it; a value of None takes its key away.

        Args:
            values: path of names (and numbers of sensors) -> value.

        Raises:
            BadFileError: the car would not be one any more; nothing was written.
            ConfigError: the file cannot be written.
        """
        for (*tables, name), value in values.items():
            place = self._document
            for table in tables:
                if isinstance(table, str) and table not in place:
                    place[table] = self._new_table()
                place = place[table]
            if value is not None:
                place[name] = value
            elif name in place:
                del place[name]
        text = self._document.as_string()
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
