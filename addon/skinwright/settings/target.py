"""What each target knows about itself: its match mask, and whether it is being sculpted."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty
from bpy.types import PropertyGroup

from ..transfer.params import Mask


class SKINWRIGHT_PG_object(PropertyGroup):
    """What each target knows about itself: its match mask, and whether it is being sculpted."""

    mask_group: StringProperty(
        name="Mask",
        description="Vertex group that steers the match of this mesh; none matches automatically",
    )
    mask_reading: EnumProperty(
        name="Reading",
        description="What the mask's weights mean",
        items=[
            ("STEER", "Steer", "0 inpaints, 0.5 is automatic, 1 forces a match; no member is automatic"),
            ("PAINTED", "Painted", "Painted above the threshold means inpaint, all else is automatic"),
        ],
    )
    mask_threshold: FloatProperty(
        name="Threshold", description="Weight above which a vertex counts as painted", default=0.5, min=0, max=1
    )
    mask_invert: BoolProperty(name="Invert", description="Inpaint what is not painted", default=False)

    sculpting: BoolProperty(
        name="Sculpting",
        description="Weights are being sculpted; undo has gone back to before that where this is off",
        default=False,
        options={"HIDDEN"},
    )

    painting: BoolProperty(
        name="Painting",
        description="The match mask is being painted; undo has gone back to before that where this is off",
        default=False,
        options={"HIDDEN"},
    )

    def mask(self) -> Mask | None:
        """The mask as plain values, if there is one."""
        if not self.mask_group:
            return None
        return Mask(self.mask_group, self.mask_reading, self.mask_threshold, self.mask_invert)
