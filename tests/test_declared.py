"""Every setting is declared once, and each entry keeps to its range: panel, operator, JSON, command line, library."""

import ast
import dataclasses
import json
import math

import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
pytestmark = pytest.mark.usefixtures("scene")

BAD_NUMBERS = [math.nan, math.inf, -math.inf, 1e300, -1e300, 1 << 70, -(1 << 70), 10**400]


def params_classes(addon):
    return [
        addon.transfer.TransferParams,
        addon.transfer.Mask,
        addon.sculpt.params.SculptParams,
        addon.autoskin.AutoskinParams,
        addon.desparsify.DesparsifyParams,
        addon.check.params.CheckParams,
        addon.retarget.params.RetargetParams,
        addon.embed.params.EmbedParams,
        addon.refine.params.RefineParams,
        addon.refine.params.CorrectiveParams,
        addon.preferences.Preferences,
    ]


def numbers(addon, kind):
    """(name, type, declaration) of every number."""
    declared = addon.declared.declared(kind)
    return [(name, hint, one) for name, (hint, one) in declared.items() if declared_kind(hint) in (int, float)]


def declared_kind(hint):
    kinds = [option for option in getattr(hint, "__args__", [hint]) if option is not type(None)]
    return kinds[0] if len(kinds) == 1 else hint


def made(kind, **settings):
    required = {f.name: "Group" for f in dataclasses.fields(kind) if f.default is dataclasses.MISSING}
    return kind(**required | settings)


def test_defaults_lie_in_their_ranges_and_ranges_have_two_ends(addon):
    for kind in params_classes(addon):
        made(kind)
        for name, _, one in numbers(addon, kind):
            assert math.isfinite(one.least) and math.isfinite(one.most) and one.least < one.most, name
            for end in (one.least, one.most):
                assert getattr(made(kind, **{name: end}), name) == end


def test_what_lies_outside_is_refused_whoever_makes_it(addon):
    for kind in params_classes(addon):
        for name, hint, one in numbers(addon, kind):
            just = 1 if declared_kind(hint) is int else 1e-6 * max(1, one.most)
            for value in [*BAD_NUMBERS, one.least - just, one.most + just]:
                with pytest.raises(addon.declared.SettingError, match=f"{name} is .*, but must lie between"):
                    made(kind, **{name: value})


def test_json_keeps_to_types_and_ranges(addon):
    for kind in params_classes(addon):
        required = {f.name: "Group" for f in dataclasses.fields(kind) if f.default is dataclasses.MISSING}
        for name, _, one in numbers(addon, kind):
            for value in BAD_NUMBERS:
                with pytest.raises(ValueError, match=f"{name} (is|cannot be)"):  # NaN and inf are no whole numbers
                    addon.declared.from_json(kind, required | {name: value})
            for value in ("1", [1], {}, True):
                with pytest.raises(ValueError, match=f"{name} cannot be"):
                    addon.declared.from_json(kind, required | {name: value})
            most = math.degrees(one.most) if one.unit == "ANGLE" else one.most
            assert getattr(addon.declared.from_json(kind, required | {name: most}), name) == pytest.approx(one.most)


def test_settings_go_through_json_unchanged(addon):
    for kind in params_classes(addon):
        params = made(kind)
        again = addon.declared.from_json(kind, json.loads(json.dumps(addon.declared.to_json(params))))
        assert repr(addon.declared.to_json(again)) == repr(addon.declared.to_json(params))


def test_properties_are_made_from_the_declarations(addon, scene):
    """Name, sentence, default and range of the panel's settings, the operators' and the preferences'."""
    operators = bpy.ops.skinwright
    homes = [
        (addon.transfer.TransferParams, scene.skinwright.transfer.bl_rna.properties),
        (addon.transfer.TransferParams, operators.transfer_weights.get_rna_type().properties),
        (addon.autoskin.AutoskinParams, operators.automatic_weights.get_rna_type().properties),
        (addon.desparsify.DesparsifyParams, operators.desparsify.get_rna_type().properties),
        (addon.check.params.CheckParams, operators.check_weights.get_rna_type().properties),
        (addon.sculpt.params.SculptParams, scene.skinwright.sculpt.bl_rna.properties),
    ]
    for kind, properties in homes:
        for name, _, one in numbers(addon, kind):
            if name not in properties:
                continue
            prop, default = properties[name], kind.__dataclass_fields__[name].default
            assert (prop.name, prop.description) == (one.label, one.sentence)
            assert prop.default == pytest.approx(one.shown if default is None else default), name
            assert (prop.hard_min, prop.hard_max) == pytest.approx((one.least, one.most)), name


def test_a_fresh_panel_asks_for_the_defaults(addon, scene):
    default = addon.transfer.TransferParams()
    shown = scene.skinwright.transfer.to_params()
    assert shown.max_normal_angle == pytest.approx(default.max_normal_angle, rel=1e-6)
    # To the last bit: 0.05, not 0.0500000007 as Blender keeps it.
    assert dataclasses.replace(shown, max_normal_angle=default.max_normal_angle) == default
    sculpt = dataclasses.asdict(scene.skinwright.sculpt.to_options())
    assert sculpt == dataclasses.asdict(addon.sculpt.params.SculptParams())


def stub_defaults(path):
    """Every function and method of the stub with its keyword defaults."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef):
            pairs = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            yield node.name, {arg.arg: ast.literal_eval(value) for arg, value in pairs if value}


def test_defaults_are_the_librarys(addon, native):
    """What the library does without settings, as its signature says and as the stub repeats."""
    import inspect
    from pathlib import Path

    stub = dict(stub_defaults(Path(__file__).parents[1] / "rust" / "native" / "skinwright_native.pyi"))
    calls = [
        ("transfer_weights", addon.transfer.TransferParams()),
        ("automatic_weights", addon.autoskin.AutoskinParams()),
        ("desparsify", addon.desparsify.DesparsifyParams()),
    ]
    for name, params in calls:
        signature = inspect.signature(getattr(native, name)).parameters
        library = {key: p.default for key, p in signature.items() if p.default is not inspect.Parameter.empty}
        expected = addon.declared.native_keywords(params)
        if name == "transfer_weights":
            # The module answers scripts as it always did; artists get the better method.
            assert (expected.pop("method"), library["method"]) == ("confidence", "paper")
        assert {key: library[key] for key in expected} == expected
        assert {key: stub[name][key] for key in expected} == expected
    solver = inspect.signature(native.SculptSolver).parameters
    for key, value in addon.declared.native_keywords(addon.sculpt.params.SculptParams()).items():
        assert solver[key].default == value


def test_choices_are_the_librarys_methods(addon, native):
    """Each list of methods is ALL of its enum in core, which the library names when it refuses another."""
    import re
    from pathlib import Path

    weights = native.Weights.from_dense([[1.0]])
    sheet = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    rows = native.Weights.from_dense([[1.0]] * 3)
    calls = {
        ("transfer", "TransferParams", "island_policy"): lambda: native.transfer_weights(
            *sheet, rows, *sheet, island_policy="none"
        ),
        ("desparsify", "DesparsifyParams", "method"): lambda: native.desparsify(weights, [-1], method="none"),
    }
    stub = (Path(__file__).parents[1] / "rust" / "native" / "skinwright_native.pyi").read_text()
    for (feature, kind, name), call in calls.items():
        with pytest.raises(native.InvalidParameter, match="must be one of") as refused:
            call()
        library = set(re.split(r", ", str(refused.value).rpartition("must be one of ")[2]))
        _, one = addon.declared.declared(getattr(getattr(addon, feature), kind))[name]
        assert set(one.choices) == library, name
        literals = [set(re.findall(r'"(\w+)"', group)) for group in re.findall(r"Literal\[([^]]*)\]", stub)]
        assert library in literals, f"the stub lacks {library}"
