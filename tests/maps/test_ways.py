"""Ways through grids, against Dijkstra's search over all nodes."""

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from armguard.maps.ways import crosses, quickest, steps_from_start, steps_to_end


def random_blocks(seed, shape=(17, 23)):
    """A grid with some blocked boxes, free at both ends."""
    rng = np.random.default_rng(seed)
    blocked = np.zeros(shape, dtype=bool)
    for _ in range(6):
        i, j = rng.integers(0, shape)
        blocked[i : i + rng.integers(1, 6), j : j + rng.integers(1, 6)] = True
    blocked[0, 0] = blocked[-1, -1] = False
    return blocked


def steps_of(blocked, waits=(0.0, 0.0)):
    """All steps between nodes, by looking at the cells about each, and their costs."""
    k, m = blocked.shape

    def free(i, j):
        return 0 <= i < k and 0 <= j < m and not blocked[i, j]

    def pinched(i, j):
        inside = 0 < i < k and 0 < j < m
        return inside and blocked[i - 1, j] and blocked[i, j - 1]

    for i in range(k + 1):
        for j in range(m + 1):
            if pinched(i, j):
                continue
            if free(i, j):
                yield (i, j), (i + 1, j + 1), 1.0
            if i < k and (free(i, j) or free(i, j - 1)):
                yield (i, j), (i + 1, j), 1.0 + (waits[1] if j < m else 0.0)
            if j < m and (free(i, j) or free(i - 1, j)):
                yield (i, j), (i, j + 1), 1.0 + (waits[0] if i < k else 0.0)


def by_dijkstra(blocked, waits=(0.0, 0.0)):
    """Least cost from each node to the last."""
    nodes = np.array(blocked.shape) + 1
    rows, columns, costs = zip(
        *(
            (np.ravel_multi_index(b, nodes), np.ravel_multi_index(a, nodes), cost)
            for a, b, cost in steps_of(blocked, waits)
        ),
        strict=True,
    )
    graph = csr_matrix((costs, (rows, columns)), shape=(nodes.prod(),) * 2)
    return dijkstra(graph, indices=nodes.prod() - 1).reshape(nodes)


@pytest.mark.parametrize("waits", [(0.0, 0.0), (3.0, 0.0), (0.0, 0.5)])
def test_steps_to_the_end_are_those_of_dijkstra(waits):
    closed = 0
    for seed in range(60):
        blocked = random_blocks(seed)
        expected = by_dijkstra(blocked, waits)
        np.testing.assert_allclose(steps_to_end(blocked, waits), expected)
        way = quickest(blocked, waits)
        closed += way is None
        assert (way is None) == bool(np.isinf(expected[0, 0]))
        if way is not None:
            assert not crosses(way, blocked)
            taken = {tuple(map(tuple, both)) for both in itertools.pairwise(way)}
            costs = {(a, b): cost for a, b, cost in steps_of(blocked, waits)}
            assert sum(costs[one] for one in taken) == pytest.approx(expected[0, 0])
    assert 0 < closed < 60


def test_what_is_reached_from_the_start_is_what_a_search_reaches():
    for seed in range(20):
        blocked = random_blocks(seed)
        turned = by_dijkstra(blocked[::-1, ::-1])[::-1, ::-1]
        np.testing.assert_allclose(steps_from_start(blocked), turned)


def test_a_way_crosses_each_cell_that_it_leads_through():
    """Blocking any cell on the quickest way, or beside it, is noticed if it matters."""
    free = np.zeros((9, 12), dtype=bool)
    way = quickest(free)
    steps = {tuple(map(tuple, both)) for both in itertools.pairwise(way)}
    for cell in np.ndindex(free.shape):
        blocked = free.copy()
        blocked[cell] = True
        left = {(a, b) for a, b, _ in steps_of(blocked)}
        assert crosses(way, blocked) == (not steps <= left)
