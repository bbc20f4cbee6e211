"""The settings of a sculpt session as plain values."""

from dataclasses import dataclass
from typing import Any, Literal

from .. import declared
from ..declared import Params, setting, threads
from ..desparsify.params import METHODS, Method

Guard = Literal["NONE", "ACTION", "RANGE"]
Residual = Literal["DISCARD", "SHAPE_KEY"]


@dataclass(frozen=True)
class SculptParams(Params):
    """How strokes become weights; `kappa` and `passes` as in the native stub.

    `candidates` are given to every vertex at the start (0: only those it has). `guard` poses hold with `guard_alpha`;
    rest always holds. `residual` is what becomes of what weights cannot reach.
    """

    kappa: float = setting(
        0.01,
        "Stiffness",
        "How much weights hold on to what they were: low follows the sculpt, high hardly moves",
        least=1e-6,
        most=1,
        soft_least=0.001,
        soft_most=0.05,
        precision=3,
        step=0.1,
        native=True,
    )
    passes: int = setting(
        3, "Passes", "Times the pull towards the old weights is taken out of the answer", least=1, most=100, native=True
    )
    candidates: int = setting(
        4, "Bones", "Bones every vertex may choose from; 0 leaves only those that it has", most=12, soft_most=8
    )
    method: Method = setting("surface", "Method", "Which bones a vertex gets", choices=METHODS)
    guard: Guard = setting(
        "NONE",
        "Guard Poses",
        "Poses whose shape a stroke should not spoil; the rest pose is always safe",
        choices={
            "NONE": ("None", "Only the poses sculpted in so far"),
            "ACTION": ("Keyframes", "The frames that have keys in the armature's action"),
            "RANGE": ("Range of Motion", "Turns of the touched bones by 45 and 90 degrees"),
        },
    )
    guard_alpha: float = setting(
        0.2,
        "Guard Strength",
        "How much a guard pose counts against the sculpted one",
        least=0.01,
        most=1,
        unit="FACTOR",
    )
    residual: Residual = setting(
        "DISCARD",
        "Leftover",
        "What becomes of the part of a sculpt that no weights can reach",
        choices={
            "DISCARD": ("Discard", "It is lost"),
            "SHAPE_KEY": ("Shape Key", "It goes to a corrective shape key that the joint's turn drives"),
        },
    )
    threads: int = threads()


def options_from_json(settings: Any) -> SculptParams:
    """Settings from a JSON object of their names.

    Raises ValueError for another name or type, SettingError for a value out of range.
    """
    return declared.from_json(SculptParams, settings)
