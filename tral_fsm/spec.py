"""What the parts of a definition are made of: parameters with unit, meaning, limits, and rules for them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, model_validator

Id = StrictInt | Annotated[StrictStr, Field(min_length=1)]
"""Name of a state or transition: a number or a word."""
MarkerId = Annotated[StrictInt, Field(ge=0, le=49)]
"""Gates and markers of the dictionary."""
Side = Literal["left", "right"]
SonarName = Literal["left", "front", "right"]


def quantity(default: float | None, unit: str, description: str, **limits: Any) -> Any:
    """A parameter with unit, meaning and limits (`ge`, `gt`, `le`, `lt`)."""
    return Field(default, description=description, json_schema_extra={"unit": unit}, **limits)


def required(unit: str, description: str, **limits: Any) -> Any:
    """A parameter that has no default."""
    return Field(description=description, json_schema_extra={"unit": unit}, **limits)


class Spec(BaseModel):
    """Base of all parts of a machine: frozen, nothing unknown, nothing converted in silence, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)

    exactly_one: ClassVar[tuple[str, ...]] = ()
    """Two parameters of which one must be given, and not both."""
    needs: ClassVar[Mapping[str, str]] = {}
    """A parameter that makes sense only beside another one."""

    @model_validator(mode="after")
    def _together(self) -> Self:
        given = [name for name in self.exactly_one if getattr(self, name) is not None]
        if self.exactly_one and len(given) != 1:
            names = " and ".join(self._with_unit(name) for name in self.exactly_one)
            raise ValueError(f"got {'both' if given else 'neither'} of {names}: give exactly one")
        for name, other in self.needs.items():
            if getattr(self, name) is not None and getattr(self, other) is None:
                raise ValueError(f"{name} needs {other}, which is not given")
        return self

    @classmethod
    def _with_unit(cls, name: str) -> str:
        unit = unit_of(cls, name)
        return f"{name} [{unit}]" if unit else name


def unit_of(spec: type[Spec], name: str) -> str:
    """Unit of a parameter; empty: none."""
    extra = spec.model_fields[name].json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""
