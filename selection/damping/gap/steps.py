"""One damped Gauss-Newton step of several fits, with the deviations of many sweeps eliminated sweep by sweep."""

import numpy as np

from damping.arrays import FloatArray
from damping.gap.model import Model
from damping.gap.wild import robust_weights

#: Largest change of a variable (prior standard deviation 1) in one step, beyond which residuals are far from linear.
_LONGEST_STEP = 1.5
#: With more sweeps, their deviations, two of each, are eliminated sweep by sweep; with fewer, one dense solution is a
#: tenth faster.
_MANY = 24


def solve_step(
    r: FloatArray,
    J: FloatArray,
    y: FloatArray,
    damping: FloatArray,
    scale: FloatArray,
    weights: FloatArray | None,
    model: Model,
) -> tuple[FloatArray, FloatArray]:
    """The damped step of each start, and about the decrease of minus the log posterior that an undamped one gives."""
    counts = robust_weights(r / scale[:, np.newaxis]) if weights is None else np.broadcast_to(weights, r.shape)
    if model.sweeps > _MANY:
        step, gradient = _solve_by_sweeps(r, J, y, damping, counts, model)
    else:
        weighted = J * counts[..., np.newaxis]
        H = np.swapaxes(weighted, 1, 2) @ J
        diagonal = np.arange(H.shape[1])
        H[:, diagonal, diagonal] += 1.0
        gradient = (r[:, np.newaxis] @ weighted)[:, 0] + y
        H[:, diagonal, diagonal] *= 1.0 + damping[:, np.newaxis]
        step = np.asarray(-np.linalg.solve(H, gradient[:, :, np.newaxis])[:, :, 0])
    return np.clip(step, -_LONGEST_STEP, _LONGEST_STEP), -0.5 * np.sum(gradient * step, axis=1) * (1.0 + damping)


def _solve_by_sweeps(
    r: FloatArray, J: FloatArray, y: FloatArray, damping: FloatArray, counts: FloatArray, model: Model
) -> tuple[FloatArray, FloatArray]:
    """The damped step and the gradient of each start: a value moves with both deviations of its own sweep alone.

    With blocks D (2, 2) of the deviations z of each sweep and B beside the variables x, D is eliminated (Schur):
    (A - sum B^T D^-1 B) x = g_x - sum B^T D^-1 g_z, then z = D^-1 (g_z - B x). The cost grows with the rows alone.
    """
    k, sweeps, of_value = model.size, model.sweeps, model.problem.rows.sweep_of_values
    order = np.argsort(of_value, kind="stable")
    first = np.searchsorted(of_value[order], np.arange(sweeps))
    places = k + of_value[order, np.newaxis] + [0, sweeps]
    Jx, Jz = J[:, order, :k], J[:, order[:, np.newaxis], places]
    weighted, stiff = counts[:, order, np.newaxis] * np.concatenate([Jz, Jx], axis=2), 1.0 + damping
    both = np.concatenate([Jz, Jx, r[:, order, np.newaxis]], axis=2)
    of_sweeps = np.add.reduceat(weighted[:, :, :2, np.newaxis] * both[:, :, np.newaxis], first, axis=1)
    D, B, g_z = of_sweeps[..., :2], of_sweeps[..., 2:-1], of_sweeps[..., -1]
    products = np.swapaxes(weighted[:, :, 2:], 1, 2) @ both[:, :, 2:]
    A, g_x = products[..., :-1], products[..., -1] + y[:, :k]
    g_z = g_z + np.swapaxes(y[:, k:].reshape(len(y), 2, sweeps), 1, 2)
    for block in (A, D):
        size = np.arange(block.shape[-1])
        block[..., size, size] = (block[..., size, size] + 1.0) * stiff.reshape(-1, *[1] * (block.ndim - 2))
    freed = np.linalg.solve(D, np.concatenate([B, g_z[..., np.newaxis]], axis=-1))
    reduced = np.einsum("bsik,bsij->bkj", B, freed)
    x = np.linalg.solve(A - reduced[..., :-1], (g_x - reduced[..., -1])[..., np.newaxis])
    z = freed[..., -1] - (freed[..., :-1] @ x[:, np.newaxis])[..., 0]
    step, gradient = (
        np.hstack([of_x, np.swapaxes(of_z, 1, 2).reshape(len(y), 2 * sweeps)])
        for of_x, of_z in ((-x[..., 0], -z), (g_x, g_z))
    )
    return step, gradient
