"""The graph of imports, of the add-on and of core: no circle, no arrow upwards. It lands in out/imports.md."""

import ast
import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ADDON, CORE = ROOT / "addon" / "skinwright", ROOT / "rust" / "core" / "src"

# From the ground up; a part imports only from floors below its own, and on its own floor what the next line allows.
ADDON_FLOORS = [
    {"csr", "errors", "registration", "translations"},
    {"declared", "files", "memory", "reporting", "soundness"},
    {"native"},
    {"jobs", "scene"},
    {
        "transfer",
        "match",
        "desparsify",
        "sculpt",
        "stored",
        "check",
        "retarget",
        "refine",
        "autoskin",
        "embed",
        "wardrobe",
    },
    {"settings"},
    {"preferences", "overlay"},
    {"operators", "headless", "ui"},
    {"__init__"},
]
SIDEWAYS = {("match", "transfer"), ("sculpt", "desparsify"), ("stored", "transfer"), ("retarget", "transfer")}
SIDEWAYS |= {("wardrobe", "transfer"), ("refine", "transfer"), ("autoskin", "transfer"), ("embed", "retarget")}
OPERATIONS = {"transfer", "sculpt", "desparsify", "embed", "autoskin", "retarget", "refine"}


def addon_modules():
    """Path of every module below the add-on, without the presets, which Blender runs."""
    paths = (path.relative_to(ADDON) for path in ADDON.rglob("*.py"))
    return sorted(path for path in paths if "presets" not in path.parts or len(path.parts) == 2)


def at_import(tree):
    """The import statements that run when the module is imported."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            yield node
        elif isinstance(node, ast.If | ast.Try):
            yield from at_import(node)


def targets(module, node):
    """Dotted paths that a relative import may lead to: the module it names, and each name as a module in it."""
    package = module.parent.parts[: len(module.parent.parts) - (node.level - 1)]
    base = (*package, *(node.module.split(".") if node.module else ()))
    yield base
    yield from ((*base, alias.name) for alias in node.names)


def addon_graph():
    """Module -> the modules it imports, both as paths without ending."""
    known = {module.with_suffix("").parts: module for module in addon_modules()}
    known |= {module.parent.parts: module for module in addon_modules() if module.name == "__init__.py"}
    graph = {}
    for module in addon_modules():
        found = {
            known[path] for node in at_import(ast.parse((ADDON / module).read_text())) for path in targets(module, node)
            if path in known
        }  # fmt: skip
        # The packages around a module are on their way in already.
        around = {folder / "__init__.py" for folder in module.parents}
        graph[module] = found - around - {module}
    return graph


def part(module):
    return module.parts[0].removesuffix(".py")


def core_graph():
    """Top-level module of core -> those it uses."""
    graph = {}
    for path in CORE.rglob("*.rs"):
        name = path.relative_to(CORE).parts[0].removesuffix(".rs")
        if name == "lib":
            continue
        text = re.sub(r"//.*", "", path.read_text())
        used = set(re.findall(r"\bcrate::([a-z_]+)", text))
        for group in re.findall(r"\bcrate::\{([^}]*)\}", text):
            used |= {item.strip().split("::")[0] for item in group.split(",")} & {p.stem for p in CORE.iterdir()}
        graph.setdefault(name, set()).update(used - {name})
    return graph


def parts_graph():
    graph = {}
    for module, others in addon_graph().items():
        graph.setdefault(part(module), set()).update({part(other) for other in others} - {part(module)})
    return graph


def assert_no_circle(graph):
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(map(str, error.args[1]))}")


def test_no_circle_in_the_addon():
    assert_no_circle(addon_graph())
    assert_no_circle({name: others for name, others in parts_graph().items() if name != "__init__"})


def test_no_circle_in_core():
    assert_no_circle(core_graph())


def test_no_arrow_upwards_in_the_addon():
    floor = {name: number for number, names in enumerate(ADDON_FLOORS) for name in names}
    for name, others in parts_graph().items():
        assert name in floor, f"{name} has no floor: give it one in ADDON_FLOORS"
        for other in others:
            below = floor[other] < floor[name]
            assert below or (name, other) in SIDEWAYS, f"{name} imports {other}, which is not below it"


def test_parts_of_core_know_no_operation_and_operations_not_each_other():
    for name, others in core_graph().items():
        assert not others & OPERATIONS, f"{name} uses {others & OPERATIONS}"


@pytest.mark.parametrize("folder", ["tests"])
def test_tests_never_import_a_benchmark(folder):
    """What both need is in tests/support."""
    benchmarks = {path.stem for path in (ROOT / "bench").glob("*.py")}
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and not node.level and node.module else []
            assert not {name.split(".")[0] for name in names} & benchmarks, f"{path} imports {names}"


def test_the_graph_is_drawn():
    """As Mermaid, which code hosts render: an arrow from each part to those it imports."""
    lines = ["# Who imports whom", ""]
    for title, graph in (("The add-on", parts_graph()), ("The core", core_graph())):
        lines += [f"## {title}", "", "```mermaid", "graph TD"]
        lines += [f"  {name.strip('_')} --> {other}" for name in sorted(graph) for other in sorted(graph[name])]
        lines += ["```", ""]
    path = ROOT / "out" / "imports.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines))
    assert "transfer --> scene" in path.read_text() and "transfer --> fill" in path.read_text()
