"""The interface in other languages: nothing is missing, nothing is left over, nothing that is filled in is lost."""

import re

import messages
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

LOCALES = ("ja_JP", "ko_KR", "zh_HANS")
# Letters that a text in the language has, unless it is a name.
LETTERS = {"ja_JP": r"[\u3040-\u30ff\u4e00-\u9fff]", "ko_KR": r"[\uac00-\ud7af]", "zh_HANS": r"[\u4e00-\u9fff]"}
NAMES = {"MDD", "PC2"}


@pytest.fixture
def tables(addon):
    return addon.translations.tables()


def english(table):
    return {text for _, text in table}


def test_the_locales(tables):
    assert tuple(tables) == LOCALES


@pytest.mark.parametrize("locale", LOCALES)
def test_every_text_is_translated(tables, locale):
    missing = messages.messages() - english(tables[locale])
    assert not missing, f"{locale} lacks {sorted(missing)}"


@pytest.mark.parametrize("locale", LOCALES)
def test_no_translation_is_left_over(tables, locale):
    assert not english(tables[locale]) - messages.messages()


@pytest.mark.parametrize("locale", LOCALES)
def test_it_is_in_that_language(tables, locale):
    for (_, text), translated in tables[locale].items():
        assert text in NAMES or re.search(LETTERS[locale], translated), text
        assert not translated.endswith((".", "。")), text  # as Blender's own tooltips


@pytest.mark.parametrize("locale", LOCALES)
def test_numbers_and_names_survive(tables, locale):
    """Figures, file endings and the add-on's name stand in the translation as in English."""
    for (_, text), translated in tables[locale].items():
        for token in re.findall(r"\d+(?:\.\d+)?|\.\w+ |JSON|Skinwright|Blender|MDD|PC2|[+-]X", text):
            counted = token == "1" and re.search("一|ひと|한 ", translated)
            assert token.strip() in translated or counted, f"{text}: {token}"


def test_buttons_of_operators_find_theirs(tables):
    assert tables["ja_JP"]["Operator", "Transfer Weights"] == tables["ja_JP"]["*", "Transfer Weights"]
