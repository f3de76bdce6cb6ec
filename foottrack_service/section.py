"""What all sections of the settings are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator


class Section(BaseModel):
    """Base of all sections: a misspelt key is an error, not silently ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _keep_the_rest(cls, values: Any) -> Any:
        """A table below that says a part leaves the rest at *this* section's default, not at the table's type's own."""
        if not isinstance(values, Mapping):
            return values
        return {name: _over_default(cls, name, value) for name, value in values.items()}


def _over_default(section: type[Section], name: str, value: Any) -> Any:
    field = section.model_fields.get(name)
    if field is None or not isinstance(field.default, Section) or not isinstance(value, Mapping):
        return value
    return {**field.default.model_dump(exclude_unset=True), **value}
