"""Tree-cotree gauge: the unknowns that make the vector potential unique in air, without any regularisation.

High-order gradients are left out of the finite-element space in air.  What curl cannot see is then spanned by the
gradients of the lowest-order vertex functions that vanish in the conductors up to one constant in each, and on the
boundary where the tangential potential is fixed.  With each conductor and that boundary shrunk to one vertex, the
edges of a spanning tree are as many as those functions; fixing their unknowns at zero leaves a unique potential
with the same curl and the same field in the conductors.  Exact for any number of conductors of any topology.

R. Albanese, G. Rubinacci, IEE Proc. A 135 (1988) 457; O. Bíró, Comput. Methods Appl. Mech. Engrg. 169 (1999) 391.
"""

from __future__ import annotations

import ngsolve
import numpy as np
import scipy
from numpy.typing import NDArray

IntArray = NDArray[np.int64]


def edge_vertices(mesh: ngsolve.Mesh) -> IntArray:
    """(n, 2) vertex numbers of all edges."""
    return np.array([[v.nr for v in edge.vertices] for edge in mesh.edges], dtype=np.int64)


def region_edges(mesh: ngsolve.Mesh, region: ngsolve.Region) -> NDArray[np.bool_]:
    """Which edges belong to a volume or boundary region."""
    found = np.zeros(mesh.nedge, bool)
    for element in region.Elements():
        found[[edge.nr for edge in element.edges]] = True
    return found


def tree_edges(edges: IntArray, shrunk: NDArray[np.bool_]) -> IntArray:
    """Numbers of the edges of a spanning tree of the graph in which all `shrunk` edges have length zero.

    Parameters
    ----------
    edges : (n, 2) vertex numbers
    shrunk : (n,) which edges join their ends to one vertex
    """
    vertices = int(edges.max()) + 1
    joined = scipy.sparse.coo_matrix((np.ones(int(shrunk.sum())), edges[shrunk].T), shape=(vertices, vertices))
    count, label = scipy.sparse.csgraph.connected_components(joined, directed=False)
    ends = np.sort(label[edges], axis=1)
    numbers = np.flatnonzero(ends[:, 0] != ends[:, 1])
    _, first = np.unique(ends[numbers], axis=0, return_index=True)
    numbers = numbers[first]
    graph = scipy.sparse.coo_matrix((numbers + 1.0, ends[numbers].T), shape=(count, count))
    return np.asarray(np.rint(scipy.sparse.csgraph.minimum_spanning_tree(graph.tocsr()).data).astype(np.int64) - 1)
