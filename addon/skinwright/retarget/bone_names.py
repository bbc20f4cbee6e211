"""What bones are called in the rigs that characters come with, in terms of one vocabulary."""

import re
import unicodedata
from functools import cache

# `{S}` stands for the side as each convention writes it.
_FINGERS = ("thumb", "index", "middle", "ring", "pinky")


def _fingers(pattern: str, names: tuple[str, ...] = _FINGERS, first: int = 1) -> dict[str, str]:
    return {
        f"{finger}{joint}": pattern.format(name=name, joint=joint + first - 1, S="{S}")
        for finger, name in zip(_FINGERS, names, strict=True)
        for joint in (1, 2, 3)
    }


def _limbs(*names: str) -> dict[str, str]:
    keys = ("shoulder", "upper_arm", "forearm", "hand", "thigh", "shin", "foot", "toe")
    return dict(zip(keys, names, strict=True))


def _trunk(*names: str) -> dict[str, str]:
    keys = ("hips", "spine1", "spine2", "spine3", "neck", "head")
    return {key: name for key, name in zip(keys, names, strict=True) if name}


CONVENTIONS: dict[str, tuple[dict[str, str], str, str]] = {
    "Mixamo": (
        _trunk("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head")
        | _limbs(*(f"{{S}}{n}" for n in ["Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase"]))
        | _fingers("{S}Hand{name}{joint}", ("Thumb", "Index", "Middle", "Ring", "Pinky")),
        "Left",
        "Right",
    ),
    "Unreal": (
        _trunk("pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head")
        | _limbs(*(f"{n}_{{S}}" for n in ["clavicle", "upperarm", "lowerarm", "hand", "thigh", "calf", "foot", "ball"]))
        | _fingers("{name}_0{joint}_{S}"),
        "l",
        "r",
    ),
    "Rigify": (
        _trunk("spine", "spine.001", "spine.002", "spine.003", "spine.004", "spine.006")
        | _limbs(*(f"{n}.{{S}}" for n in ["shoulder", "upper_arm", "forearm", "hand", "thigh", "shin", "foot", "toe"]))
        | _fingers("{name}.0{joint}.{S}", ("thumb", "f_index", "f_middle", "f_ring", "f_pinky")),
        "L",
        "R",
    ),
    "VRoid": (
        _trunk(*(f"J_Bip_C_{n}" for n in ["Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"]))
        | _limbs(
            *(
                f"J_Bip_{{S}}_{n}"
                for n in ["Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "ToeBase"]
            )
        )
        | _fingers("J_Bip_{S}_{name}{joint}", ("Thumb", "Index", "Middle", "Ring", "Little")),
        "L",
        "R",
    ),
    "VRM": (
        _trunk("hips", "spine", "chest", "upperChest", "neck", "head")
        | _limbs(
            *(f"{{S}}{n}" for n in ["Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes"])
        )
        | _fingers("{S}{name}{joint}", ("Thumb", "Index", "Middle", "Ring", "Little")),
        "left",
        "right",
    ),
    "MMD": (
        _trunk("下半身", "上半身", "上半身2", "", "首", "頭")
        | _limbs(*(f"{{S}}{n}" for n in ["肩", "腕", "ひじ", "手首", "足", "ひざ", "足首", "足先EX"]))
        | _fingers("{S}{name}{joint}", ("親指", "人指", "中指", "薬指", "小指")),
        "左",
        "右",
    ),
    "Character Creator": (
        _trunk(*(f"CC_Base_{n}" for n in ["Pelvis", "Waist", "Spine01", "Spine02", "NeckTwist01", "Head"]))
        | _limbs(
            *(
                f"CC_Base_{{S}}_{n}"
                for n in ["Clavicle", "Upperarm", "Forearm", "Hand", "Thigh", "Calf", "Foot", "ToeBase"]
            )
        )
        | _fingers("CC_Base_{S}_{name}{joint}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
        "L",
        "R",
    ),
    "Daz": (
        _trunk("pelvis", "abdomenLower", "abdomenUpper", "chestLower", "neckLower", "head")
        | _limbs(
            *(f"{{S}}{n}" for n in ["Collar", "ShldrBend", "ForearmBend", "Hand", "ThighBend", "Shin", "Foot", "Toe"])
        )
        | _fingers("{S}{name}{joint}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
        "l",
        "r",
    ),
    "MakeHuman": (
        _trunk("root", "spine05", "spine03", "spine01", "neck01", "head")
        | _limbs(
            *(
                f"{n}.{{S}}"
                for n in ["clavicle", "upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot", "toe1-1"]
            )
        )
        | {f"{f}{j}": f"finger{k}-{j}.{{S}}" for k, f in enumerate(_FINGERS, 1) for j in (1, 2, 3)},
        "L",
        "R",
    ),
    "Quaternius": (
        _trunk("Hips", "Abdomen", "Torso", "Chest", "Neck", "Head")
        | _limbs(
            *(
                f"{n}.{{S}}"
                for n in ["Shoulder", "UpperArm", "LowerArm", "Wrist", "UpperLeg", "LowerLeg", "Foot", "Toe"]
            )
        )
        | _fingers("{name}{joint}.{S}", ("Thumb", "Index", "Middle", "Ring", "Pinky")),
        "L",
        "R",
    ),
}
_PREFIX = re.compile(r"^(?:.*[:|]|mixamorig\d*[_:]?|DEF-|ORG-|ValveBiped\.|Armature_|bip001[ _])", re.IGNORECASE)
_SIDES = {"left": "L", "right": "R", "l": "L", "r": "R", "左": "L", "右": "R"}


def plain(name: str) -> str:
    """Lower case, full-width letters narrow, without the prefix of a namespace and without separators."""
    narrow = unicodedata.normalize("NFKC", name)
    return re.sub(r"[\s._\-]+", "", _PREFIX.sub("", narrow)).lower()


def side(name: str) -> str:
    """The letter L or R, or nothing for the middle: by `.L`, `_l`, `Left`, `L_`, `lShldr`, or the MMD characters."""
    bare = _PREFIX.sub("", unicodedata.normalize("NFKC", name))
    if bare[:1] in "左右":
        return _SIDES[bare[0]]
    if found := re.search(r"left|right", bare, re.IGNORECASE):
        return _SIDES[found[0].lower()]
    words = [word.lower() for word in re.split(r"[\s._\-]+", bare)]
    for word in (words[-1], *words):
        if word in ("l", "r"):
            return _SIDES[word]
    # `upper_arm.L.001` has been handled; Daz writes `lShldrBend`, others `UpperArmL`.
    if re.match(r"[lr][A-Z]", bare):
        return _SIDES[bare[0]]
    if re.search(r"[a-z0-9][LR]$", bare):
        return _SIDES[bare[-1].lower()]
    return ""


def without_side(name: str) -> str:
    """The plain name without what says the side."""
    bare = _PREFIX.sub("", unicodedata.normalize("NFKC", name))
    bare = re.sub(r"left|right|左|右", "", bare, flags=re.IGNORECASE)
    bare = re.sub(r"(^|[\s._\-])[lr](?=$|[\s._\-])", r"\1", bare, flags=re.IGNORECASE)
    if re.match(r"[lr][A-Z]", bare):
        bare = bare[1:]
    bare = re.sub(r"(?<=[a-z0-9])[LR]$", "", bare)
    return plain(bare)


@cache
def _table(convention: str) -> dict[str, str]:
    names, left, right = CONVENTIONS[convention]
    table = {}
    for key, pattern in names.items():
        if "{S}" not in pattern:
            table[plain(pattern)] = key
            continue
        table[plain(pattern.replace("{S}", left))] = f"{key}.L"
        table[plain(pattern.replace("{S}", right))] = f"{key}.R"
    return table


def convention(names: list[str]) -> str:
    """The convention that knows most of these names, nothing if none knows at least six."""
    counts = {c: sum(plain(name) in _table(c) for name in names) for c in CONVENTIONS}
    best = max(counts, key=lambda c: counts[c])
    return best if counts[best] >= 6 else ""


def vocabulary(names: list[str]) -> dict[str, str]:
    """What each of these names means, by the convention they follow; names it does not know are left out."""
    found = convention(names)
    table = _table(found) if found else {}
    return {name: table[plain(name)] for name in names if plain(name) in table}
