"""Numbers of the scene file's grammar: finite, and of the right sign."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Number = Annotated[float, Field(allow_inf_nan=False, strict=False)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0.0)]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
PositiveTriple = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Number], Field(min_length=4, max_length=4)]


class Strict(BaseModel):
    """A mapping without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)
