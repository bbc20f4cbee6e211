"""The settings of an embedding as plain values."""

from dataclasses import dataclass
from typing import Literal

from ..declared import Params, setting, threads


@dataclass(frozen=True)
class EmbedParams(Params):
    """How an armature is put into meshes that have none."""

    method: Literal["template", "medial"] = setting(
        "template",
        "Method",
        "What the places of the joints are found by",
        choices={
            "template": ("Template Character", "Lay the surface of the source's character onto the meshes"),
            "medial": ("Shape Alone", "Look for the middle of limbs; a bare armature is enough"),
        },
        native=True,
    )
    symmetric: bool = setting(
        True, "Symmetric", "Make bones of both sides mirror images, and keep those of the middle on the plane between"
    )
    bind: bool = setting(True, "Bind", "Give the meshes an Armature modifier with the new armature if they have none")
    threads: int = threads()
