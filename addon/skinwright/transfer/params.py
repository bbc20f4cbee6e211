"""The settings of a transfer as plain values: what the panel, a script and a JSON file have in common."""

import math
from collections.abc import Iterable
from dataclasses import MISSING, dataclass
from typing import Any, Literal

from .. import declared
from ..declared import Params, max_influences, setting, threads

Groups = Literal["BONE_DEFORM", "BONE_SELECT", "ALL", "ACTIVE"]
Geometry = Literal["AS_SHOWN", "REST", "CURRENT"]
SourceScope = Literal["PARTS", "OBJECT", "ARMATURE", "COLLECTION"]
IslandPolicy = Literal["bridge", "nearest", "rigid", "skip"]
Method = Literal["paper", "confidence"]
SmallIslands = Literal["auto", "rigid", "solved"]
Reading = Literal["STEER", "PAINTED"]
THRESHOLDS = {"max_distance", "relative_max_distance", "max_normal_angle", "match_flipped_normals"}


@dataclass(frozen=True)
class Mask(Params):
    """A vertex group read as match mask, see scene.mask."""

    group: str = setting(MISSING, "Mask", "Vertex group that steers the match of this mesh; none matches automatically")
    reading: Reading = setting(
        "STEER",
        "Reading",
        "What the mask's weights mean",
        choices={
            "STEER": ("Steer", "0 inpaints, 0.5 is automatic, 1 forces a match; no member is automatic"),
            "PAINTED": ("Painted", "Painted above the threshold means inpaint, all else is automatic"),
        },
    )
    threshold: float = setting(0.5, "Threshold", "Weight above which a vertex counts as painted", most=1)
    invert: bool = setting(False, "Invert", "Inpaint what is not painted")


@dataclass(frozen=True)
class TransferParams(Params):
    """Angles in radians, absolute lengths in world units; an absolute length wins over its relative form.

    `mask` None leaves each target its own, as picked in the panel. `threads` 0 takes all.
    """

    groups: Groups = setting(
        "BONE_DEFORM",
        "Groups",
        "Which of the source's vertex groups are written",
        choices={
            "BONE_DEFORM": ("Deform Bones", "Groups of all bones that deform"),
            "BONE_SELECT": ("Selected Bones", "Groups of the selected bones that deform"),
            "ALL": ("All Groups", "Every group; those that are not bones are each carried over by themselves"),
            "ACTIVE": ("Active Group", "The active group of the source"),
        },
    )
    source_scope: SourceScope = setting(
        "PARTS",
        "Body",
        "Which meshes are taken as one body with the source",
        choices={
            "PARTS": ("Source and Its Parts", "The source and the meshes on its armature that continue its borders"),
            "OBJECT": ("Source Alone", "The source and nothing else"),
            "ARMATURE": ("All on Its Armature", "Every visible mesh that the source's armature deforms"),
            "COLLECTION": ("All in Its Collection", "Every visible mesh in the source's collection"),
        },
    )
    geometry: Geometry = setting(
        "AS_SHOWN",
        "Geometry",
        "Which shapes are laid over each other",
        # Files keep the number of a choice: new ones come last.
        choices={
            "REST": ("Rest", "The shapes without modifiers, shape keys or pose"),
            "CURRENT": (
                "Current",
                "The shapes as they are posed and deformed now; what does not follow the pose yet is bound in it",
            ),
            "AS_SHOWN": (
                "As Shown, at Rest",
                "The shapes with shape keys and modifiers, but not as they are posed",
            ),
        },
    )
    method: Method = setting(
        "confidence",
        "Method",
        "How vertices take weights from the source",
        choices={
            "paper": (
                "Match or Inpaint",
                "Copy where distance and angle are within their thresholds, fill in the rest",
            ),
            "confidence": ("Confidence", "Trust the weights of each vertex's point less the larger gap and tilt are"),
        },
        native=True,
    )
    softness: float = setting(
        0.7,
        "Softness",
        "How far weights are smoothed, as a multiple of the gap between garment and source",
        least=0.05,
        most=10,
        soft_least=0.35,
        soft_most=1.4,
        precision=2,
        step=5,
        native=True,
    )
    max_distance: float | None = setting(
        None,
        "Distance",
        "Farthest from the source a vertex may match",
        most=1e9,
        soft_most=1,
        unit="DISTANCE",
        shown=0.05,
        native=True,
    )
    relative_max_distance: float = setting(
        0.05,
        "Distance",
        "Farthest from the source a vertex may match, as a part of the target's diagonal or of 30 % of the source's",
        most=10,
        soft_most=0.5,
        precision=3,
        step=1,
        native=True,
    )
    max_normal_angle: float = setting(
        math.radians(35),
        "Angle",
        "Largest angle between the normals of a vertex and its match",
        most=math.pi,
        unit="ANGLE",
        native=True,
    )
    match_flipped_normals: bool = setting(
        True, "Flipped Normals", "Match surfaces that face the other way too, as linings do", native=True
    )
    join_borders: bool = setting(
        True, "Join Borders", "Solve targets whose borders lie on each other as one mesh, so that no gap opens there"
    )
    relative_weld_tolerance: float = setting(
        1e-6,
        "Weld",
        "Vertices closer than this part of the target's diagonal are one, as at seams of imported files; 0 for none",
        most=0.01,
        soft_most=1e-3,
        precision=6,
        step=0.01,
        native=True,
    )
    mask: Mask | None = setting(None, "Mask", "A vertex group that steers the match, for every target the same")
    smoothness_length: float | None = setting(
        None,
        "Smoothness",
        "How far inpainted weights flow smoothly",
        most=1e9,
        soft_most=1,
        unit="DISTANCE",
        shown=0.1,
        native=True,
    )
    relative_smoothness_length: float = setting(
        0.05,
        "Smoothness",
        "How far inpainted weights flow smoothly, as a part of the source's bounding-box diagonal",
        most=100,
        soft_most=0.5,
        precision=3,
        step=1,
        native=True,
    )
    island_policy: IslandPolicy = setting(
        "bridge",
        "Loose Parts",
        "What to do with parts of which no vertex matches, such as buttons and belts",
        choices={
            "bridge": ("Bridge", "Hang the part on the nearest part that has weights"),
            "nearest": ("Nearest", "Give each vertex the weights of its closest point on the source"),
            "rigid": ("Rigid", "Give the whole part one set of weights, for buckles and plates"),
            "skip": ("Skip", "Leave the part as it is"),
        },
        native=True,
    )
    small_islands: SmallIslands = setting(
        "auto",
        "Small Parts",
        "What to do with small loose parts that hang off the source, such as buttons and pouches",
        choices={
            "auto": ("Automatic", "Rigid with Confidence, as computed otherwise"),
            "rigid": ("Rigid", "Give each part one set of weights if it nearly has one"),
            "solved": ("As Computed", "Leave them as they are computed"),
        },
        native=True,
    )
    smoothing_iterations: int = setting(
        0,
        "Smoothing",
        "Passes of smoothing over the inpainted vertices and their surroundings",
        most=1000,
        soft_most=20,
        native=True,
    )
    smoothing_factor: float = setting(
        0.2,
        "Smoothing Factor",
        "How much of its neighbours a vertex takes in each pass",
        most=1,
        unit="FACTOR",
        native=True,
    )
    symmetrize: bool = setting(
        False,
        "Symmetrize",
        "Give vertices that mirror each other across the armature's X the same weights, left and right exchanged",
    )
    max_influences: int = max_influences(native=True)
    mix_factor: float = setting(
        1.0,
        "Mix",
        "How much of the new weights is taken; the rest are the weights already there",
        most=1,
        unit="FACTOR",
    )
    selected_only: bool = setting(
        False, "Selected Vertices", "Write only the vertices selected in Edit mode or by the paint mask"
    )
    add_armature: bool = setting(True, "Add Armature", "Let the source's armature deform targets that have none")
    add_corrective_smooth: bool = setting(
        False, "Corrective Smooth", "Give targets the Corrective Smooth modifier that the source has"
    )
    replace_others: bool = setting(
        False,
        "Replace Deformers",
        "End what else moves a target or overrules its weights: bone parents, constraints, other armatures, modifiers",
    )
    skip_failing: bool = setting(
        False, "Skip Failing", "Leave out targets that cannot be done, and write the others all the same"
    )
    make_single_user: bool = setting(
        False,
        "Make Single User",
        "Give a target a mesh of its own where others share it, so that theirs keeps its weights",
    )
    threads: int = threads()

    def native(self) -> dict[str, Any]:
        """The keyword arguments of the native transfer; the mask is the caller's."""
        return declared.native_keywords(self)


def means_thresholds(given: Iterable[str]) -> bool:
    """Whether thresholds are named and no method: then the one that has thresholds is meant, not the default."""
    names = set(given)
    return "method" not in names and not names.isdisjoint(THRESHOLDS)


def from_json(settings: Any) -> TransferParams:
    """Settings from a JSON object: the names of TransferParams, `max_normal_angle` in degrees, `mask` an object.

    Thresholds without a method mean the method `paper`.
    Raises ValueError for a name that is none of them or a value of another type, SettingError for one out of range.
    """
    if isinstance(settings, dict) and isinstance(settings.get("evaluated"), bool):  # what `geometry` was called
        evaluated = settings["evaluated"]
        rest = {name: value for name, value in settings.items() if name != "evaluated"}
        settings = {"geometry": "CURRENT" if evaluated else "REST"} | rest
    if isinstance(settings, dict) and means_thresholds(settings):
        settings = {"method": "paper"} | settings
    return declared.from_json(TransferParams, settings)


def to_json(params: TransferParams) -> dict[str, Any]:
    """The inverse of from_json, so that a report tells how it was made."""
    return declared.to_json(params)
