"""csr, transfer.merging and transfer.scalar_fields against dense brute force."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import sparse

pytest.importorskip("bpy", reason="needs the bpy wheel")
N, B = 7, 6
RELAXED = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="session")
def merging(addon):
    return addon.transfer.merging


@pytest.fixture(scope="session")
def csr(addon):
    return addon.csr


def rows_of(csr, dense):
    vertex, bone = np.nonzero(dense)
    indptr = np.concatenate([[0], np.cumsum((dense != 0).sum(1))])
    return csr.Rows(indptr.astype(np.uint32), bone.astype(np.uint32), dense[vertex, bone].astype(np.float32))


def dense_of(csr, rows, n_columns=B):
    dense = np.zeros((len(rows.indptr) - 1, n_columns))
    np.add.at(dense, (csr.entry_vertices(rows), rows.bones), rows.values)
    return dense


@st.composite
def weights(draw, normalised):
    """(N, B) with zeros and, where normalised, a row in four without any weight."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    dense = rng.random((N, B)) * (rng.random((N, B)) < 0.5)
    if normalised:
        dense /= np.maximum(dense.sum(1, keepdims=True), 1e-30)
        dense[rng.random(N) < 0.25] = 0
    return dense.astype(np.float32)


def scaled(row, total):
    return row / row.sum() * total if row.sum() else row


def merged_one_vertex(new, old, held, chosen, factor, limit):
    """The rule for a vertex, said again as plainly as can be."""
    if not new.any():
        return np.zeros(B)
    remainder = max(1 - old[held].sum(), 0)
    free = np.where(held, 0, old)
    if chosen[~held].all():
        row = scaled(np.where(held, 0, new), remainder)
        if not row.any():
            row = scaled(free, remainder)
        elif factor < 1:
            row = scaled(factor * row + (1 - factor) * free, remainder)
    else:
        mixed = factor * np.where(held, 0, new) + (1 - factor) * free
        row, others = np.where(chosen, mixed, 0), np.where(chosen, 0, free)
        if others.any():
            share = min(row.sum(), remainder)
            row = scaled(row, share) + scaled(others, remainder - share)
        else:
            row = scaled(row, remainder)
    if limit:
        most = max(limit - (old[held] > 0).sum(), 0)
        order = sorted(range(B), key=lambda bone: (-row[bone], bone))
        row[order[most:]] = 0
        row = scaled(row, remainder)
    return row


BOOLEANS = st.lists(st.booleans(), min_size=B, max_size=B)


@RELAXED
@given(
    new=weights(True),
    old=weights(False),
    locks=BOOLEANS,
    wanted=st.one_of(st.just([True] * B), BOOLEANS),
    factor=st.sampled_from([1.0, 0.5, 0.25, 0.0]),
    limit=st.integers(0, 4),
)
def test_merge_against_brute_force(merging, csr, new, old, locks, wanted, factor, limit):
    held, chosen = np.array(locks), np.array(wanted)
    old[:, held] /= np.maximum(old[:, held].sum(1, keepdims=True), 1) * 1.01
    rows = merging.merge(
        rows_of(csr, new), rows_of(csr, old), held=held, chosen=chosen, factor=factor, max_influences=limit
    )
    expected = [merged_one_vertex(*pair, held, chosen, factor, limit) for pair in zip(new, old, strict=True)]
    assert dense_of(csr, rows) == pytest.approx(np.array(expected), abs=2e-6)


def test_merge_changes_no_bit_without_locks_or_mixing_to_do(merging, csr):
    """A vertex whose locked weights are 0 is scaled by its own sum only."""
    new = np.array([[0.25, 0.75, 0, 0, 0, 0]], np.float32)
    none = np.zeros(B, bool)
    rows = merging.merge(
        rows_of(csr, new), rows_of(csr, new * 0), held=none, chosen=~none, factor=1.0, max_influences=0
    )
    assert rows.values.tolist() == [0.25, 0.75]


def test_overfull(merging, csr):
    old = np.array([[0.6, 0.6, 0, 0, 0, 0], [0.5, 0.5, 1, 0, 0, 0]], np.float32)
    locked = np.array([True, True, False, False, False, False])
    assert merging.overfull(rows_of(csr, old), locked).tolist() == [0]


@RELAXED
@given(new=weights(False), old=weights(False), factor=st.floats(0, 1))
def test_mix(merging, csr, new, old, factor):
    rows = merging.mix(rows_of(csr, new), rows_of(csr, old), factor)
    assert dense_of(csr, rows) == pytest.approx(factor * new + (1 - factor) * old, abs=1e-6)


@RELAXED
@given(fields=weights(False))
def test_scalar_fields_round_trip_through_rows_of_sum_one(addon, csr, fields):
    scalar_fields = addon.transfer.scalar_fields
    packed = scalar_fields.pack(rows_of(csr, fields), B)
    assert csr.row_sums(packed) == pytest.approx(np.ones(N), abs=1e-6)
    assert (packed.values >= 0).all()
    assert dense_of(csr, scalar_fields.unpack(packed, B)) == pytest.approx(fields, abs=1e-6)


@RELAXED
@given(dense=weights(False), columns=st.lists(st.booleans(), min_size=B, max_size=B), most=st.integers(0, 4))
def test_csr_against_dense(csr, dense, columns, most):
    rows, kept = rows_of(csr, dense), np.array(columns)
    assert csr.row_sums(rows) == pytest.approx(dense.sum(1), abs=1e-6)
    assert np.array_equal(dense_of(csr, csr.keep_columns(rows, kept)), np.where(kept, dense, 0))
    assert np.array_equal(dense_of(csr, csr.take_columns(rows, kept), kept.sum()), dense[:, kept])
    assert np.array_equal(dense_of(csr, csr.take_rows(rows, np.array([3, 0]))), dense[[3, 0]])
    assert np.array_equal(dense_of(csr, csr.beside(rows, B, rows), 2 * B), np.hstack([dense, dense]))
    largest = dense_of(csr, csr.keep_largest(rows, np.full(N, most)))
    expected = [np.where(row >= np.sort(row)[::-1][most - 1] if most else False, row, 0) for row in dense]
    assert np.array_equal(largest, np.array(expected))


def test_equal_entries_keep_the_lower_bone(csr):
    dense = np.array([[0.25, 0.25, 0.5, 0.25, 0, 0]], np.float32)
    assert csr.keep_largest(rows_of(csr, dense), np.array([2])).bones.tolist() == [0, 2]


def test_entries_of_one_place_are_added(csr):
    rows = csr.from_entries(np.array([1, 0, 1]), np.array([2, 0, 2]), np.array([0.25, 0.0, 0.5]), 3)
    assert rows.indptr.tolist() == [0, 0, 1, 1]
    assert rows.values.tolist() == [0.75]


@pytest.mark.parametrize("n_columns", [3, 5000], ids=["dense", "sparse"])
def test_entries_are_added_as_scipy_adds_them(csr, n_columns):
    rng = np.random.default_rng(8)
    vertex, bone = rng.integers(0, 40, 300), rng.integers(0, n_columns, 300)
    value = rng.integers(0, 4, 300) / 4  # sums are exact, some entries are 0
    rows = csr.from_entries(vertex, bone, value, 41)
    expected = sparse.coo_array((value, (vertex, bone)), shape=(41, n_columns)).toarray()
    assert np.array_equal(dense_of(csr, rows, n_columns), expected)
    assert (rows.values != 0).all()


def test_a_factor_of_zero_adds_nothing_where_nobody_has_old_weights(merging, csr):
    new, old = np.zeros((2, B), np.float32), np.zeros((2, B), np.float32)
    new[:, 4], old[:, 0] = 1, 0.9
    held, chosen = np.arange(B) != 4, np.full(B, True)
    options = {"held": held, "chosen": chosen, "max_influences": 0}
    for factor, expected in [(0.0, 0.0), (0.5, 0.1), (1.0, 0.1), (np.array([0.0, 0.5]), [0.0, 0.1])]:
        rows = merging.merge(rows_of(csr, new), rows_of(csr, old), factor=factor, **options)
        assert dense_of(csr, rows)[:, 4] == pytest.approx(np.broadcast_to(expected, 2), abs=1e-6)
