"""The settings of desparsification as plain values."""

from dataclasses import dataclass
from typing import Literal

from ..declared import Choices, Params, setting, threads

Method = Literal["surface", "hop"]
METHODS: Choices = {
    "surface": ("Surface", "The bones whose regions are nearest along the surface"),
    "hop": ("Hierarchy", "The bones that are fewest steps away in the armature"),
}


@dataclass(frozen=True)
class DesparsifyParams(Params):
    """`n` members a vertex, found by `method` (see the native stub); `threads` 0 takes all."""

    n: int = setting(
        4,
        "Bones",
        "Members every vertex has afterwards; the smallest beyond that are dropped",
        least=1,
        most=12,
        soft_most=8,
        native=True,
    )
    method: Method = setting("surface", "Method", "Which bones a vertex gets", choices=METHODS, native=True)
    selected_only: bool = setting(
        False, "Selected Vertices", "Only the vertices selected in Edit mode or by the paint mask"
    )
    threads: int = threads()
