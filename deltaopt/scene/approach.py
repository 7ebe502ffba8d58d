"""How a motion leaves its start and reaches its goal: straight up and down within a cylinder."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from deltaopt.files.units import WIDTH
from deltaopt.files.validated_record import Positive, Record, Vector3
from deltaopt.limits.limit import Column

EXPECTED_APPROACH = "a mapping with the keys start and goal, each {height, radius} in m"


class ApproachAtEnd(Record):
    """Within a vertical cylinder of ``radius`` (m) about an end until ``height`` (m) above it."""

    height: Annotated[Positive, WIDTH] = Field(description="a length in m, greater than 0")
    radius: Annotated[Positive, WIDTH] = Field(description="a length in m, greater than 0")

    def column(self, end: Vector3) -> Column:
        """The cylinder about an end, m."""
        x, y, z = end
        return Column(y, z, self.radius, x - self.height)


class Approach(Record):
    """The cylinders at ``start`` and ``goal``; between them the motion stays above the lower of
    both heights."""

    start: ApproachAtEnd = Field(description="a mapping with the keys height and radius, in m")
    goal: ApproachAtEnd = Field(description="a mapping with the keys height and radius, in m")
