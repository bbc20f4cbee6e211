"""What each target knows about itself: its match mask, and whether it is being sculpted."""

from typing import TYPE_CHECKING, Any

from bpy.props import BoolProperty, StringProperty
from bpy.types import PropertyGroup

from ..declared import declared
from ..transfer.params import Mask
from .properties import decimal, properties

_READING = {f"mask_{name}": prop for name, prop in properties(Mask, ["reading", "threshold", "invert"]).items()}


class SKINWRIGHT_PG_object(PropertyGroup):
    """What each target knows about itself: its match mask, and whether it is being sculpted."""

    __annotations__ = {
        "mask_group": StringProperty(
            name="Mask",
            description="Vertex group that steers the match of this mesh; none matches automatically",
        ),
        **_READING,
        "sculpting": BoolProperty(
            name="Sculpting",
            description="Weights are being sculpted; undo has gone back to before that where this is off",
            default=False,
            options={"HIDDEN"},
        ),
    }
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def mask(self) -> Mask | None:
        """The mask as plain values, if there is one."""
        if not self.mask_group:
            return None
        threshold = decimal(self.mask_threshold, declared(Mask)["threshold"][1])
        return Mask(self.mask_group, self.mask_reading, threshold, self.mask_invert)
