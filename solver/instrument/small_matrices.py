"""Small matrices and dot products in compiled code.

numba's wrappers of LAPACK take seconds to compile and longer than a small system to run.
"""

import math

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.compiled import FAST, njit


@njit(fastmath=FAST)
def dot(a: Floats, b: Floats) -> float:
    """Compute the dot product of `a` (n,) with the first n entries of `b`."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@njit
def solve(matrix: Floats, right: Floats) -> bool:
    """Replace `right` (n,) by the solution of matrix (n, n) x = right; the matrix is lost.

    Return False if the matrix is singular. By Gaussian elimination with partial pivoting.
    """
    n = len(right)
    for j in range(n):
        pivot = j
        for i in range(j + 1, n):
            if abs(matrix[i, j]) > abs(matrix[pivot, j]):
                pivot = i
        if not abs(matrix[pivot, j]) > 0:
            return False
        for k in range(j, n):
            matrix[j, k], matrix[pivot, k] = matrix[pivot, k], matrix[j, k]
        right[j], right[pivot] = right[pivot], right[j]
        for i in range(j + 1, n):
            factor = matrix[i, j] / matrix[j, j]
            for k in range(j, n):
                matrix[i, k] -= factor * matrix[j, k]
            right[i] -= factor * right[j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    return True


@njit
def cholesky(matrix: Floats) -> bool:
    """Replace the lower triangle (n, n) by its Cholesky factor; return False if not definite."""
    for j in range(len(matrix)):
        for i in range(j, len(matrix)):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i > j:
                matrix[i, j] = total / matrix[j, j]
            elif total > 0:
                matrix[j, j] = math.sqrt(total)
            else:
                return False
    return True


@njit
def solve_definite(matrix: Floats, right: Floats) -> bool:
    """Replace `right` (n,) by the solution of matrix (n, n) x = right, and factor the matrix.

    Return False if the matrix is not positive definite.
    """
    if not cholesky(matrix):
        return False
    n = len(right)
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return True


@njit
def whitening(covariance: Floats) -> Floats:
    """Compute the matrix (n, n) that whitens errors: the inverse of the Cholesky factor.

    It is NaN if the covariance is not positive definite.
    """
    n = len(covariance)
    factor, inverse = covariance.copy(), np.zeros((n, n))
    if not cholesky(factor):
        inverse[:] = np.nan
        return inverse
    for j in range(n):
        inverse[j, j] = 1 / factor[j, j]
        for i in range(j + 1, n):
            for k in range(j, i):
                inverse[i, j] -= factor[i, k] * inverse[k, j]
            inverse[i, j] /= factor[i, i]
    return inverse
