"""Every text of the interface that a translator has to know: of classes that are registered, and literals of `draw`."""

import ast
from pathlib import Path

import bpy

ADDON = Path(__file__).resolve().parents[2] / "addon" / "skinwright"
CALLS = {"label", "operator", "prop", "prop_search", "prop_enum", "progress", "menu"}
# Of file browsers, translated by Blender itself.
BLENDERS_OWN = {
    "File Path",
    "Filepath used for importing the file",
    "Filepath used for exporting the file",
    "Check Existing",
    "Check and warn on overwriting existing files",
}


def messages() -> set[str]:
    """All of them, in English."""
    found = literals() | {"Weights"}  # the sidebar's tab
    for cls in classes():
        found |= of_class(cls)
    shown = {text for text in found if text[:1].isupper() or (any(map(str.isalpha, text)) and not text.isidentifier())}
    return shown - BLENDERS_OWN


def classes():
    """The add-on's registered classes."""
    kinds = (
        bpy.types.AddonPreferences,
        bpy.types.Menu,
        bpy.types.Operator,
        bpy.types.Panel,
        bpy.types.PropertyGroup,
        bpy.types.UIList,
    )
    waiting = [kind for kind in kinds if kind]
    while waiting:
        cls = waiting.pop()
        waiting += cls.__subclasses__()
        if getattr(cls, "is_registered", False) and cls.__module__.startswith("bl_ext.user_default.skinwright"):
            yield cls


def of_class(cls) -> set[str]:
    """Label and description of the class, of its properties, and of the items of its menus."""
    rna = cls.bl_rna
    if issubclass(cls, bpy.types.Operator):
        rna = getattr(bpy.ops.skinwright, cls.bl_idname.split(".")[1]).get_rna_type()
    found = {getattr(cls, "bl_label", "")}
    if issubclass(cls, bpy.types.Operator):
        found.add(rna.description)
    inherited = set(rna.base.properties.keys()) if rna.base else set()
    for prop in rna.properties:
        if prop.identifier not in inherited and prop.identifier not in ("rna_type", "name"):
            found |= {prop.name, prop.description}
            if prop.type == "ENUM":
                found |= {text for item in prop.enum_items for text in (item.name, item.description)}
    return found


def of_a_table(node) -> bool:
    """Whether a constant beside others is a label: identifiers of classes and items of menus have no small letters."""
    value = node.value if isinstance(node, ast.Constant) else None
    return isinstance(value, str) and not value.isupper() and value[:1].isupper() and "SKINWRIGHT" not in value


def literals() -> set[str]:
    """Texts that are written where they are drawn, and those of tables beside."""
    found = set()
    for path in sorted([*ADDON.glob("ui/*.py"), *ADDON.glob("settings/*.py"), ADDON / "preferences.py"]):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CALLS:
                texts = [keyword.value for keyword in node.keywords if keyword.arg == "text"]
                found |= {text.value for text in texts if isinstance(text, ast.Constant)}
            elif isinstance(node, ast.Tuple | ast.Dict):
                entries = node.elts if isinstance(node, ast.Tuple) else node.values
                found |= {text.value for text in entries if of_a_table(text)}
    return found
