"""Pages that are made from the code while the site is built, so that they cannot differ from it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "skinwright"
STUB = ROOT / "rust" / "native" / "skinwright_native.pyi"


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
    """The texts of all SceneErrors that a file raises; what is filled in at run time is shown as a word in italics."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "SceneError" and node.args:
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
        words = re.findall(r"[a-z_]+", ast.unparse(node.value).lower())
        return f"*{words[0].replace('_', ' ') if words else 'value'}*"
    return ""


def settings() -> str:
    """The settings of each feature as the add-on declares them: label, name, default, range, what it does."""
    lines = []
    for path in sorted(ADDON.glob("*/params.py")):
        rows = declarations(path)
        if rows:
            heading = f"## {path.parent.name.title()}"
            lines += [heading, "", "| setting | name in scripts | default | range | what it does |"]
            lines += ["| --- | --- | --- | --- | --- |", *rows, ""]
    return "\n".join(lines)


def declarations(path: Path) -> list[str]:
    """A table row per setting that a file declares."""
    rows = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        call = node.value if isinstance(node, ast.AnnAssign) else None
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "setting" and len(call.args) > 2:
            default, label, sentence = call.args[:3]
            given = {keyword.arg: keyword.value for keyword in call.keywords}
            cells = [plain(label), f"`{node.target.id}`", shown(default), allowed(given), plain(sentence)]
            rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return rows


def shown(default: ast.expr) -> str:
    """A default as a person reads it."""
    text = ast.unparse(default)
    return "" if text == "MISSING" else f"{text[13:-1]}°" if text.startswith("math.radians(") else text.strip("'")


def allowed(given: dict[str, ast.expr]) -> str:
    """The choices or the range of a setting."""
    choices = given.get("choices")
    if isinstance(choices, ast.Dict):
        return ", ".join(f"`{ast.literal_eval(key)}`" for key in choices.keys if isinstance(key, ast.Constant))
    ends = [ast.unparse(given[name]) if name in given else "" for name in ("least", "most")]
    return f"{ends[0] or '0'} to {ends[1]}" if ends[1] else ""
