"""Pages that are made from the code while the site is built, so that they cannot differ from it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "skinwright"
STUB = ROOT / "rust" / "native" / "skinwright_native.pyi"
# What the artist calls features whose folders have another name.
TITLES = {"autoskin": "Automatic Weights", "desparsify": "Add Bone Slots", "embed": "Embed Armature"}
# What is raised with a sentence for the artist.
REFUSALS = {
    "FileError",
    "ManifestError",
    "NativeError",
    "RecordError",
    "Refused",
    "SceneError",
    "SettingError",
    "StoredError",
    "TooLarge",
    "Unsound",
}
# Parts of expressions that say nothing to a reader.
NAMELESS = {"name", "self", "obj", "data", "join", "len", "str", "r", "f", "s"}


def on_page_markdown(markdown: str, page, config, files) -> str:
    """Fill the places that a page leaves for what is generated."""
    makers = {"PYTHON": python_reference, "MESSAGES": messages, "SETTINGS": settings}
    for name, make in makers.items():
        place = f"<!-- {name} -->"
        if place in markdown:
            markdown = markdown.replace(place, make())
    return markdown


def python_reference() -> str:
    """Every class and function of the native module's stub, with signature and docstring."""
    lines = []
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and ast.get_docstring(node):
            lines += [f"## {node.name}", "", ast.get_docstring(node), ""]
            for method in (m for m in node.body if isinstance(m, ast.FunctionDef)):
                lines += function(method, "###")
        elif isinstance(node, ast.FunctionDef):
            lines += function(node, "##")
    return "\n".join(lines)


def function(node: ast.FunctionDef, heading: str) -> list[str]:
    """One function: its name, its signature as code, what it says of itself."""
    signature = ast.unparse(ast.FunctionDef(node.name, node.args, [ast.Pass()], [], node.returns, None, lineno=0))
    signature = signature.removesuffix("\n    pass").removesuffix(":")
    return [f"{heading} {node.name}", "", "```python", signature, "```", "", ast.get_docstring(node) or "", ""]


def messages() -> str:
    """Every sentence with which the add-on refuses something, by the file that says it."""
    lines = []
    for path in sorted(ADDON.rglob("*.py")):
        found = sorted(set(sentences(path)))
        if found:
            part = path.relative_to(ADDON).with_suffix("").as_posix().replace("/__init__", "")
            lines += [f"## {part.replace('_', ' ')}", "", *(f"- {sentence}" for sentence in found), ""]
    return "\n".join(lines)


def sentences(path: Path) -> list[str]:
    """The texts of all refusals that a file raises; what is filled in at run time is shown as a word in italics."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        name = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
        if name in REFUSALS and node.args:
            text = plain(node.args[0])
            if text and len(text) > 20:
                found.append(text)
    return found


def plain(node: ast.expr) -> str:
    """A string or formatted string as it reads."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(plain(value) for value in node.values)
    if isinstance(node, ast.FormattedValue):
        return f"*{word(node.value)}*"
    return ""


def word(node: ast.expr) -> str:
    """What stands for a value in a message: the last name of its expression that says something."""
    names = [name for name in re.findall(r"[a-z_]+", ast.unparse(node).lower()) if name not in NAMELESS]
    return names[-1].replace("_", " ").strip() if names else "name"


def settings() -> str:
    """The settings of each feature as the add-on declares them: label, name, default, range, what it does."""
    lines = []
    for path in sorted(ADDON.glob("*/params.py")):
        rows = declarations(path)
        if rows:
            heading = f"## {TITLES.get(path.parent.name, path.parent.name.title())}"
            lines += [heading, "", "| setting | name in scripts | default | range | what it does |"]
            lines += ["| --- | --- | --- | --- | --- |", *rows, ""]
    return "\n".join(lines)


def declarations(path: Path) -> list[str]:
    """A table row per setting that a file declares."""
    rows, tree = [], ast.parse(path.read_text(encoding="utf-8"))
    lists = {node.target.id: node.value for node in tree.body if isinstance(node, ast.AnnAssign)}
    for node in ast.walk(tree):
        call = declaration(node.value) if isinstance(node, ast.AnnAssign) else None
        if call:
            default, label, sentence = call.args[:3]
            given = {keyword.arg: keyword.value for keyword in call.keywords}
            if isinstance(given.get("choices"), ast.Name):
                given["choices"] = lists.get(given["choices"].id)
            cells = [plain(label), f"`{node.target.id}`", shown(default), allowed(given), plain(sentence)]
            rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return rows


def declaration(value: ast.expr | None) -> ast.Call | None:
    """The call of `setting` that a field's value is, or that the function of declared.py makes which it calls."""
    name = getattr(value.func, "id", "") if isinstance(value, ast.Call) else ""
    if name == "setting" and len(value.args) > 2:
        return value
    tree = ast.parse((ADDON / "declared.py").read_text(encoding="utf-8"))
    made = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name != "setting"]
    if not made or not isinstance(made[0].body[-1], ast.Return):
        return None
    local = {node.targets[0].id: node.value for node in made[0].body if isinstance(node, ast.Assign)}
    call = made[0].body[-1].value
    if not (isinstance(call, ast.Call) and getattr(call.func, "id", "") == "setting"):
        return None
    return ast.Call(call.func, [local.get(getattr(arg, "id", ""), arg) for arg in call.args], call.keywords)


def shown(default: ast.expr) -> str:
    """A default as a person reads it."""
    text = ast.unparse(default)
    return "" if text == "MISSING" else in_degrees(text).strip("'")


def in_degrees(text: str) -> str:
    """An angle of the source as degrees; any other text as it is."""
    if text.startswith("math.radians("):
        return f"{text[13:-1]}°"
    parts = re.fullmatch(r"math\.pi(?: / (\d+))?", text)
    return f"{180 // int(parts[1] or 1)}°" if parts else text


def allowed(given: dict[str, ast.expr]) -> str:
    """The choices or the range of a setting."""
    choices = given.get("choices")
    if isinstance(choices, ast.Dict):
        return ", ".join(f"`{ast.literal_eval(key)}`" for key in choices.keys if isinstance(key, ast.Constant))
    ends = [ast.unparse(given[name]) if name in given else "" for name in ("least", "most")]
    least, most = (in_degrees(end) for end in ends)
    return f"{least or '0'} to {most}" if most else f"from {least}" if least else ""
