"""The rules of the house that no compiler checks: directions of import, versions, packaging."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "skinwright"
MODULES = sorted(p.relative_to(ADDON) for p in ADDON.rglob("*.py") if "presets" not in p.relative_to(ADDON).parts)

# ui -> operators (by bl_idname) -> features, settings -> scene, native -> the wheel.
FLOOR = {"csr", "declared", "errors", "files", "jobs", "memory", "native", "reporting", "scene", "soundness"}
# A feature may import the floor, and of the other features only these.
FEATURES = {
    "transfer": set(),
    "match": {"transfer"},
    "autoskin": {"transfer"},
    "desparsify": set(),
    "sculpt": {"desparsify"},
    "stored": {"transfer"},
    "check": set(),
    "retarget": {"transfer"},
    "embed": {"retarget"},
    "refine": set(),
    "wardrobe": {"transfer"},
}
MAY_IMPORT = {
    "csr": set(),
    "errors": set(),
    "registration": set(),
    "declared": {"errors"},
    "files": {"errors"},
    "memory": {"errors"},
    "native": {"csr", "errors", "memory"},
    "reporting": {"csr"},
    "soundness": {"csr", "errors"},
    "translations": set(),
    "scene": {"csr", "errors", "soundness"},
    "jobs": {"csr", "errors", "native"},
    **{feature: FLOOR | others for feature, others in FEATURES.items()},
    "settings": {"declared", "errors"} | set(FEATURES),
    "preferences": {"declared", "memory", "native", "registration", "settings"},
    "overlay": FLOOR | {"check", "match", "stored", "transfer"},
    "operators": FLOOR | set(FEATURES) | {"settings", "preferences", "registration"},
    "ui": FLOOR - {"scene"} | set(FEATURES) | {"settings", "registration"},
    "headless": FLOOR | set(FEATURES),
    "__init__": {"headless", "operators", "overlay", "preferences", "settings", "scene", "translations", "ui"},
}
NEVER_SEES_BPY = {"csr", "declared", "errors", "files", "memory", "native", "reporting", "soundness"}
MAY_SEE_THE_WHEEL = {"native"}


def toml(name):
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


def part(module):
    return module.parts[0].removesuffix(".py")


def imports(module):
    """(level, name) of every import in a module; the names after `from . import` one by one."""
    for node in ast.walk(ast.parse((ADDON / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.level, node.module
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.level, alias.name) for alias in node.names)


def imported_part(module, level, name):
    """The part of the add-on a relative import leads to."""
    package = module.parent.parts[: len(module.parent.parts) - (level - 1)]
    return (*package, *name.split("."))[0]


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_imports_point_one_way(module):
    for level, name in imports(module):
        top = name.split(".")[0]
        if level:
            target = imported_part(module, level, name)
            assert target in MAY_IMPORT[part(module)] | {part(module)}, f"{module} imports {target}"
        assert top != "skinwright", f"{module} must import relatively"
        assert not (top in ("bpy", "bmesh", "gpu", "bl_ui") and part(module) in NEVER_SEES_BPY), f"{module} sees {top}"
        assert not (top == "skinwright_native" and part(module) not in MAY_SEE_THE_WHEEL), f"{module} sees the wheel"


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_no_side_effects_at_import(module):
    """At the top of a module stand definitions, constants and imports, never a bare call."""
    for node in ast.parse((ADDON / module).read_text(encoding="utf-8")).body:
        bare = isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant)
        assert not bare, f"{module}:{node.lineno} runs at import"


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_no_module_of_odds_and_ends(module):
    assert not {"utils", "helpers", "manager", "data", "common", "misc"} & {p.removesuffix(".py") for p in module.parts}


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_functions_stay_short(module):
    for node in ast.walk(ast.parse((ADDON / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            length = node.end_lineno - node.lineno + 1
            assert length <= 60, f"{module}: {node.name} has {length} lines"


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_no_integer_of_the_platforms_size(module):
    """NumPy 1 counts in 32 bits on Windows (Blender 4.2 to 5.0): what makes integers names their size."""
    makes_integers = {"arange", "cumsum", "cumprod", "prod", "indices"}
    for node in ast.walk(ast.parse((ADDON / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in makes_integers:
            assert "dtype" in {keyword.arg for keyword in node.keywords}, f"{module}:{node.lineno} names no dtype"
        as_int = isinstance(node, ast.Call) and any(isinstance(a, ast.Name) and a.id == "int" for a in node.args)
        as_int = as_int and isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name)
        assert not (as_int and node.func.value.id == "np"), f"{module}:{node.lineno} makes int of the platform's size"


# Everything that runs on a user's machine, whose own encoding Windows does not make UTF-8.
SCRIPTS = sorted(
    path for folder in ("addon", "blender_scripts", "docs", "examples") for path in (ROOT / folder).rglob("*.py")
)


def reads_or_writes_text(call):
    """Whether a call reads or writes text, by its name and arguments: no types are known here."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    given = {keyword.arg for keyword in call.keywords}
    if name == "open" and isinstance(call.func, ast.Attribute) and given.isdisjoint({"mode", "encoding"}):
        owner = ast.unparse(call.func.value)
        sessions = owner.endswith(("session", "painting")) or owner in ("os", "tarfile", "self")
        modes = [a.value for a in call.args[:1] if isinstance(a, ast.Constant)]
        return not sessions and (not call.args or any("b" not in mode for mode in modes))
    if name in ("open", "fdopen", "NamedTemporaryFile"):
        modes = [a.value for a in [*call.args[1:2], *(k.value for k in call.keywords if k.arg == "mode")]]
        return not any("b" in str(mode) for mode in modes)
    return name in ("read_text", "write_text") or (name in ("run", "Popen", "check_output") and "text" in given)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_text_names_its_encoding(script):
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and reads_or_writes_text(node):
            given = {keyword.arg for keyword in node.keywords}
            assert "encoding" in given, f"{script.name}:{node.lineno} names no encoding"


@pytest.mark.parametrize(
    ("call", "text"),
    [
        ("open(path)", True),
        ("open(path, 'rb')", False),
        ("open(path, mode='wb')", False),
        ("path.open()", True),
        ("path.open('w')", True),
        ("path.open('rb')", False),
        ("self.session.open()", False),
        ("os.fdopen(handle, 'wb')", False),
        ("os.fdopen(handle, 'w')", True),
        ("path.read_text()", True),
        ("subprocess.run(command, text=True)", True),
        ("subprocess.run(command)", False),
    ],
)
def test_what_counts_as_text(call, text):
    assert reads_or_writes_text(ast.parse(call, mode="eval").body) == text


def test_versions_are_equal():
    version = toml("Cargo.toml")["workspace"]["package"]["version"]
    assert toml("addon/skinwright/blender_manifest.toml")["version"] == version
    named = toml("Cargo.toml")["workspace"]["dependencies"]
    assert {named[f"skinwright-{crate}"]["version"] for crate in ("core", "solve")} == {version}
    for crate in ("core", "native", "solve"):
        assert toml(f"rust/{crate}/Cargo.toml")["package"]["version"] == {"workspace": True}
    assert toml("pyproject.toml")["project"].get("version", version) == version
    locked = {package["name"]: package["version"] for package in toml("Cargo.lock")["package"]}
    assert {locked[f"skinwright-{crate}"] for crate in ("core", "native", "solve")} == {version}


def test_the_changelog_knows_the_version():
    changelog = ROOT / "CHANGELOG.md"
    if not changelog.exists():
        pytest.skip("there is no CHANGELOG.md yet")
    version = toml("Cargo.toml")["workspace"]["package"]["version"]
    assert re.search(
        rf"^## .*({re.escape(version)}|[Uu]nreleased)", changelog.read_text(encoding="utf-8"), re.MULTILINE
    )


def test_one_glam():
    assert [package["name"] for package in toml("Cargo.lock")["package"]].count("glam") == 1


@pytest.mark.parametrize("crate", ["core", "solve"])
def test_the_numerics_are_pure(crate):
    dependencies = set(toml(f"rust/{crate}/Cargo.toml")["dependencies"])
    assert not dependencies & {"pyo3", "numpy"}
    assert "#![forbid(unsafe_code)]" in (ROOT / "rust" / crate / "src" / "lib.rs").read_text(encoding="utf-8")


def test_the_manifest_is_valid():
    """By Blender's own command for extensions, which needs no Blender."""
    bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    (command,) = scripts.rglob("bl_pkg/cli/blender_ext.py")
    done = subprocess.run(
        [sys.executable, str(command), "validate", str(ADDON)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_manifest_asks_for_nothing_but_files():
    manifest = toml("addon/skinwright/blender_manifest.toml")
    assert manifest["id"] == ADDON.name
    assert set(manifest["permissions"]) == {"files"}
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert manifest["blender_version_min"] == "4.2.0"
