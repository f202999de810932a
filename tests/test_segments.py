"""Pieces of chain form a monoid, and joining them in a buffer is composing them."""

import numpy as np
from helpers import relative_error
from hypothesis import given
from hypothesis import strategies as st

from mp2a.segments import affine

seeds = st.integers(0, 2**32 - 1)


def piece(rng, *lead):
    """Random affine maps."""
    return rng.normal(size=(*lead, 6, 6)), rng.normal(size=(*lead, 6))


def filled(rng, nodes, samples):
    """Window of random numbers."""
    return affine.view(rng.normal(size=(nodes, 42 * samples)))


@given(seeds)
def test_compose_is_associative(seed):
    rng = np.random.default_rng(seed)
    x, y, z = (piece(rng, 3, 2) for _ in range(3))
    left = affine.compose(affine.compose(x, y), z)
    right = affine.compose(x, affine.compose(y, z))
    for a, b in zip(left, right, strict=True):
        assert relative_error(a, b) < 1e-13


@given(seeds)
def test_compose_is_one_map_after_the_other(seed):
    rng = np.random.default_rng(seed)
    outer, inner, entering = piece(rng), piece(rng), rng.normal(size=6)
    matrix, vector = affine.compose(outer, inner)
    between = inner[0] @ entering + inner[1]
    assert relative_error(matrix @ entering + vector, outer[0] @ between + outer[1]) < 1e-13


@given(seeds)
def test_identity_changes_nothing(seed):
    some, identity = piece(np.random.default_rng(seed)), (np.eye(6), np.zeros(6))
    for both in (affine.compose(some, identity), affine.compose(identity, some)):
        assert all(np.array_equal(a, b) for a, b in zip(both, some, strict=True))


@given(nodes=st.integers(1, 5), samples=st.integers(1, 4), seed=seeds)
def test_join_is_compose(nodes, samples, seed):
    rng = np.random.default_rng(seed)
    current, arrived, out = (filled(rng, nodes, samples) for _ in range(3))
    before = current.buffer.copy()
    matrix, vector = affine.compose(current[1:], arrived[1:])
    affine.join(current, affine.VECTOR, slice(0, nodes), arrived.outbox()[affine.VECTOR], out)
    assert relative_error(out.vector, vector) < 1e-14
    affine.join(current, affine.MATRIX_AND_VECTOR, slice(0, nodes), arrived.buffer, out)
    assert relative_error(out.vector, vector) < 1e-14
    assert relative_error(out.matrix, matrix) < 1e-14
    assert np.array_equal(current.buffer, before)


@given(data=st.data(), samples=st.integers(1, 3), seed=seeds)
def test_join_leaves_other_nodes_alone(data, samples, seed):
    rng = np.random.default_rng(seed)
    nodes = data.draw(st.integers(1, 6))
    first = data.draw(st.integers(0, nodes - 1))
    some = slice(first, data.draw(st.integers(first + 1, nodes)))
    current, out = filled(rng, nodes, samples), filled(rng, nodes, samples)
    before = out.buffer.copy()
    arrived = filled(rng, some.stop - some.start, samples)
    affine.join(current, affine.MATRIX_AND_VECTOR, some, arrived.buffer, out)
    untouched = np.delete(np.arange(nodes), some)
    assert np.array_equal(out.buffer[untouched], before[untouched])
    matrix, _ = affine.compose((current.matrix[some], current.vector[some]), arrived[1:])
    assert relative_error(out.matrix[some], matrix) < 1e-14


@given(nodes=st.integers(1, 5), samples=st.integers(1, 4))
def test_window_is_one_buffer(nodes, samples):
    window = affine.window(nodes, samples)
    window.matrix[:], window.vector[:] = 1.0, 2.0
    assert window.buffer.shape == (nodes, 42 * samples)
    assert (window.buffer[:, : 36 * samples] == 1.0).all()
    assert (window.buffer[:, 36 * samples :] == 2.0).all()
    for view in (affine.view(window.buffer).matrix, affine.view(window.buffer).vector, *window.outbox().values()):
        assert np.shares_memory(view, window.buffer)


@given(nodes=st.integers(1, 5), samples=st.integers(1, 4))
def test_messages_have_the_papers_sizes(nodes, samples):
    outbox = affine.window(nodes, samples).outbox()
    assert {kind: box.shape for kind, box in outbox.items()} == {
        kind: (nodes, numbers * samples) for kind, numbers in affine.DOUBLES.items()
    }
