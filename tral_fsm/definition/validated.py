"""What the parts of a definition are made of: parameters with a unit, a meaning and limits, and rules for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, model_validator

from tral_env.errors import MachineError

Id = StrictInt | Annotated[StrictStr, Field(min_length=1)]
"""Name of a state or transition: a number or a word."""
MarkerId = Annotated[StrictInt, Field(ge=0, le=49)]
"""Id of a gate or marker in the ArUco dictionary."""
Side = Literal["left", "right"]
SonarName = Literal["left", "front", "right"]


def quantity(default: float | None, unit: str, description: str, *, null: str = "", **limits: Any) -> Any:
    """A parameter with a default, a unit, a meaning and limits (`ge`, `gt`, `le`, `lt`).

    Args:
        default: value without one in the file.
        unit: empty: none.
        description: meaning, for the schema and the errors.
        null: word for null in pictures; empty: "no" and the name of the parameter.
        limits: as pydantic names them.
    """
    extra: dict[str, Any] = {"unit": unit, **({"null": null} if null else {})}
    return Field(default, description=description, json_schema_extra=extra, **limits)


def required(unit: str, description: str, **limits: Any) -> Any:
    """A parameter without a default, so that a file must give it."""
    return Field(description=description, json_schema_extra={"unit": unit}, **limits)


class Spec(BaseModel):
    """Base of all parts of a machine: frozen, without unknown members, silent conversions or NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)

    exactly_one: ClassVar[tuple[str, ...]] = ()
    """Two parameters: a file must give one of them, and not both."""
    needs: ClassVar[Mapping[str, str]] = {}
    """Parameter -> another one that it needs beside it."""

    former: ClassVar[tuple[str, ...]] = ()
    """Parameters of earlier versions: a file may give them, and they do nothing."""

    @classmethod
    def required_members(cls) -> Mapping[str, str]:
        """Members that the class which runs this spec must have, and what the spec says that asks for each."""
        return {}

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        for error in self.cross_field_errors({name: getattr(self, name) for name in type(self).model_fields}):
            raise ValueError(error)
        return self

    @classmethod
    def cross_field_errors(cls, values: Mapping[str, Any]) -> Iterator[str]:
        """What is wrong with the parameters together, although each alone may be right.

        Args:
            values: by name; those with a default may be missing.
        """
        given = [name for name in cls.exactly_one if values.get(name) is not None]
        if cls.exactly_one and len(given) != 1:
            names = " and ".join(cls._with_unit(name) for name in cls.exactly_one)
            yield f"got {'both' if given else 'neither'} of {names}: give exactly one"
        for name, other in cls.needs.items():
            if values.get(name) is not None and values.get(other) is None:
                yield f"{name} needs {other}, which is not given"

    @classmethod
    def _with_unit(cls, name: str) -> str:
        unit = unit_of(cls, name)
        return f"{name} [{unit}]" if unit else name


def unit_of(spec: type[Spec], name: str) -> str:
    """Unit of a parameter; empty: none."""
    return _extra(spec, name, "unit")


def null_of(spec: type[Spec], name: str) -> str:
    """Word for null of a parameter; empty: null means that there is none."""
    return _extra(spec, name, "null")


def _extra(spec: type[Spec], name: str, key: str) -> str:
    extra = spec.model_fields[name].json_schema_extra
    return str(extra.get(key, "")) if isinstance(extra, dict) else ""


def type_name(spec: type[Spec]) -> str:
    """The "type" by which machine files name a class.

    Raises:
        MachineError: the class has none.
    """
    name = spec.model_fields["type"].default
    if not isinstance(name, str) or not name:
        raise MachineError(f'{spec.__name__} does not say its type: write type: Literal["Name"] = "Name" into it')
    return name
