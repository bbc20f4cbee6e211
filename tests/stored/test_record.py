"""Weights in files: to the bit, without pickle, refused with a sentence if damaged, readable by numpy alone."""

import contextlib
import io
import json
import zipfile

import numpy as np
import pytest


@pytest.fixture
def record(addon):
    import importlib

    return importlib.import_module(addon.__name__ + ".stored.record")


@pytest.fixture
def kept(record):
    """Five vertices: two members, none, one of weight 0, the smallest and the largest of floats."""
    rng = np.random.default_rng(1)
    return record.Record(
        object="Kleid ä",
        names=["Arm.L", "腕.R", 'quote"', "pin"],
        locked=[False, True, False, False],
        active="pin",
        indptr=np.array([0, 2, 2, 3, 4, 6], np.uint32),
        groups=np.array([3, 0, 1, 2, 1, 0], np.uint32),
        values=np.array([0.1, 1 / 3, 0, 1e-45, np.nextafter(np.float32(1), 0, dtype=np.float32), 0.7], np.float32),
        positions=rng.normal(size=(5, 3)).astype(np.float32),
        triangles=np.array([[0, 1, 2], [2, 3, 4]], np.uint32),
    )


def same(a, b):
    assert a.header() == b.header()
    for name in ("indptr", "groups", "values", "positions", "triangles"):
        assert getattr(a, name).dtype == getattr(b, name).dtype
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name


def test_both_files_give_the_same_bits(record, kept):
    same(record.from_npz(record.to_npz(kept)), kept)
    same(record.from_json(record.to_json(kept)), kept)
    assert record.to_npz(kept) == record.to_npz(kept)  # no time of day inside


def test_the_npz_is_read_by_numpy_alone(record, kept):
    with np.load(io.BytesIO(record.to_npz(kept)), allow_pickle=False) as file:
        header = json.loads(file["header"].tobytes())
        rows = [
            {header["names"][g]: float(w) for g, w in zip(file["groups"][a:b], file["values"][a:b], strict=True)}
            for a, b in zip(file["indptr"][:-1], file["indptr"][1:], strict=True)
        ]
    assert (header["format"], header["version"]) == ("skinwright weights", 1)
    assert rows[0] == {"pin": pytest.approx(0.1), "Arm.L": pytest.approx(1 / 3)} and rows[1] == {}


def test_the_json_is_read_by_json_alone(record, kept):
    content = json.loads(record.to_json(kept))
    assert content["names"] == kept.names and content["locked"] == kept.locked
    assert content["vertices"][0] == [[3, pytest.approx(0.1)], [0, pytest.approx(1 / 3)]]
    assert [len(members) for members in content["vertices"]] == [2, 0, 1, 1, 2]


def test_a_pickle_is_never_run(record, tmp_path):
    class Boom:
        def __reduce__(self):
            return (open, (str(tmp_path / "ran"), "w"))

    file = io.BytesIO()
    np.savez(file, header=np.array([Boom()], dtype=object))
    with pytest.raises(record.RecordError, match="cannot be read"):
        record.from_npz(file.getvalue())
    assert not (tmp_path / "ran").exists()


def changed(record, kept, header=None, **arrays):
    names = ("indptr", "groups", "values", "positions", "triangles")
    return record.pack(kept.header() | (header or {}), {name: getattr(kept, name) for name in names} | arrays)


@pytest.mark.parametrize(
    ("header", "arrays", "sentence"),
    [
        ({"format": "other"}, {}, "holds no weights"),
        ({"version": 2}, {}, "update the extension"),
        ({"version": "1"}, {}, "update the extension"),
        ({"names": ["a", "a", "b", "c"]}, {}, "names a group twice"),
        ({"names": "abcd"}, {}, "no list of texts"),
        ({"names": ["a"], "locked": [False]}, {}, "group that it does not name"),
        ({"locked": [0, 1, 0, 0]}, {}, "locks do not fit"),
        ({"active": None}, {}, "of which object"),
        ({}, {"indptr": np.array([0, 2, 1, 3, 4, 6])}, "rows do not fit"),
        ({}, {"indptr": np.array([0, 2, 2, 3, 4, 9])}, "rows do not fit"),
        ({}, {"indptr": np.array([0, 2, 2, 3, 4])}, "lengths"),
        ({}, {"groups": np.array([3, 0, 1, 2, 1, -1])}, "group that it does not name"),
        ({}, {"groups": np.array([3.0, 0, 1, 2, 1, 0])}, "`groups` is missing or of another type"),
        ({}, {"values": np.array(["a"] * 6)}, "`values` is missing or of another type"),
        ({}, {"positions": np.zeros((5, 2), np.float32)}, "lengths"),
        ({}, {"triangles": np.array([[0, 1, 5]])}, "names a vertex that is not there"),
        ({}, {"groups": np.array([3, 3, 1, 2, 1, 0])}, "in a group twice"),
    ],
)
def test_what_does_not_fit_together_is_refused(record, kept, header, arrays, sentence):
    with pytest.raises(record.RecordError, match=sentence):
        record.from_npz(changed(record, kept, header, **arrays))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("vertices", [[[1.5, 0.1], [0, 0.3]], [], [], [], []]),
        ("vertices", [[["1", 0.1]], [], [], [], []]),
        ("vertices", [[[1, "0.1"]], [], [], [], []]),
        ("vertices", [[[1, None]], [], [], [], []]),
        ("vertices", [[[1, 0.1, 5]], [], [], [], []]),
        ("vertices", [{"0": 1}, [], [], [], []]),
        ("positions", [0.0] * 15),
        ("positions", [["0", "0", "0"]] * 5),
        ("triangles", [[0, 1, 2.5]]),
        ("triangles", [0, 1, 2]),
    ],
)
def test_no_number_of_a_json_file_is_rounded_or_guessed(record, kept, name, value):
    content = json.loads(record.to_json(kept)) | {name: value}
    with pytest.raises(record.RecordError):
        record.from_json(json.dumps(content))


def test_damaged_files_are_refused(record, kept):
    """Cut anywhere, any byte changed: a sentence or the same weights, never another exception."""
    content = record.to_npz(kept)
    rng = np.random.default_rng(2)
    for cut in rng.integers(0, len(content), 60):
        with pytest.raises(record.RecordError):
            record.from_npz(content[:cut])
    for at in rng.integers(0, len(content), 300):
        broken = bytearray(content)
        broken[at] ^= 1 << int(rng.integers(8))
        with contextlib.suppress(record.RecordError):
            record.from_npz(bytes(broken))
    text = record.to_json(kept)
    for cut in rng.integers(0, len(text), 60):
        with pytest.raises(record.RecordError):
            record.from_json(text[:cut])
    for junk in ("null", "[]", "{}", '{"vertices": 3}', "[" * 100_000, '{"vertices": [[[0, 1e999]]]}'):
        with pytest.raises(record.RecordError):
            record.from_json(junk)


def test_a_bomb_of_zeros_is_not_special(record, kept):
    """A zip entry that is no array."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("header.npy", b"\x93NUMPY" + bytes(10))
    with pytest.raises(record.RecordError):
        record.from_npz(file.getvalue())
