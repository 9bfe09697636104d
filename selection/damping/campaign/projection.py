"""Columns with real coefficients fitted to all sensors by least squares, and how what is left changes with them.

Where columns P depend on parameters x, the coefficients a of y = P a + r are solved for at every x (Golub and Pereyra,
SIAM J. Numer. Anal. 10, 1973):

    dr = -(I - P P^+) dP a - (P^+)^T dP^T r.
"""

from dataclasses import dataclass

import numpy as np

from damping.arrays import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class Projection:
    """Of c complex columns: ``columns``, ``inverse`` (sensors, c, 2 n) over the noise, real parts before imaginary.

    ``coefficients`` (sensors, c); ``rest`` (sensors, 2 n): what they leave, over the noise.
    """

    columns: FloatArray
    inverse: FloatArray
    coefficients: FloatArray
    rest: FloatArray

    def differentiate(self, rates: ComplexArray, of: IntArray, sd: FloatArray) -> FloatArray:
        """Derivatives (sensors 2 n, parameters) of ``rest`` by parameters that move one column each.

        Args:
            rates: (parameters, n) of that column.
            of: its place.
            sd: (sensors, n), of the noise.
        """
        moved = stack_parts(rates / sd[:, np.newaxis])
        pushed = moved * self.coefficients[:, of, np.newaxis]
        kept = (pushed @ np.swapaxes(self.inverse, 1, 2)) @ self.columns
        turned = (moved @ self.rest[..., np.newaxis]) * self.inverse[:, of]
        return np.asarray(np.swapaxes(kept - pushed - turned, 1, 2).reshape(-1, len(rates)))


def project(columns: ComplexArray, H: ComplexArray, sd: FloatArray) -> Projection:
    """Columns (n, c) fitted to H (sensors, n), whose real and imaginary parts have the noise ``sd`` (sensors, n)."""
    stacked, target = stack_parts(columns.T / sd[:, np.newaxis]), stack_parts(H / sd)
    size = np.linalg.norm(stacked, axis=2, keepdims=True)
    size[size == 0.0] = 1.0
    least = stacked.shape[2] * np.finfo(float).eps
    inverse = np.swapaxes(np.linalg.pinv(stacked / size, rcond=least), 1, 2) / size
    coefficients = (inverse @ target[..., np.newaxis])[..., 0]
    return Projection(stacked, inverse, coefficients, target - (coefficients[:, np.newaxis] @ stacked)[:, 0])


def solve_residues(columns: ComplexArray, H: ComplexArray, sd: FloatArray) -> tuple[FloatArray, ComplexArray]:
    """Real coefficients (sensors, columns), and residuals (sensors, n) over the noise."""
    fitted = project(columns, H, sd)
    real, imaginary = np.split(fitted.rest, 2, axis=1)
    return fitted.coefficients, real + 1j * imaginary


def stack_parts(values: ComplexArray) -> FloatArray:
    """Real, then imaginary parts (..., 2 n) of values (..., n)."""
    return np.concatenate([values.real, values.imag], axis=-1)
