"""A measured file in a description: its path, and how it is read."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from dovetail.units import Mass


class MeasuredFile(BaseModel):
    """A measured file, and the options of `read_frf` with which it is read."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    file: str
    accelerometer_mass: Mass | None = None
    quantity: str | None = None
    unit: str | None = None
    index: Annotated[int, Field(ge=1)] | None = None
    response: str | None = None
    force: str | None = None
    names: dict[str, str] | None = None
    columns: tuple[str, ...] | None = None
    ignore_dofs: bool | None = None
    reader: str | None = None

    @property
    def options(self) -> dict[str, Any]:
        """The options that are given."""
        return self.model_dump(exclude={"file"}, exclude_none=True)
