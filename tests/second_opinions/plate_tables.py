"""Of tables of a plate what only tests ask: regions over a face, gradients of tensors, and signals as expressions."""

import heyoka as hy
import numpy as np

from spinlev.fem.plate.table import Region


def over_face(size, heights, lateral):
    """Heights (m) over the face +z of a plate with edges `size`, and ± `lateral` (m) about its axis."""
    face, reach = float(np.asarray(size, float)[2]) / 2, np.broadcast_to(np.asarray(lateral, float), (2,))
    return Region(np.array([*-reach, face + heights[0]]), np.array([*reach, face + heights[1]]))


def reaction_gradient(table, points, frequency):
    """T (n, 3, 3, 3), T/(A m³): ∂_l B_i = T_lij m_j at the dipole's own place."""
    b, gradient = table.field_functions(points)
    rate = 2j * np.pi * frequency
    return np.einsum("nkil,k,nkj->nlij", gradient, -rate / (table.rates + rate), b, optimize=True)


def signal_expressions(share, variables):
    """s_i of every state of a rotor's share as heyoka expressions of angle and depth."""
    members = [member for row in share.basis(*variables) for member in row]
    columns = share.series.swapaxes(0, 1).reshape(share.series.shape[1], len(members))
    return [hy.sum([float(c) * m for c, m in zip(row, members, strict=True) if c]) for row in columns]
