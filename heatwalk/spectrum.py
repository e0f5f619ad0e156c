"""The smallest eigenpairs of (stiffness, mass), component by component."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh, splu

# Shift of the shift-and-invert, in the units of a mesh of area 1. Anything from -1e-3 to -10 gives the same
# eigenpairs; a larger one conditions the factorisation better and costs a few more Krylov steps.
SHIFT = -10.0

# Largest accepted residual ‖L φ − λ M φ‖ / (‖M φ‖ max(λ, 1)).
LARGEST_RESIDUAL = 1e-8

# Components of at most this many vertices are solved densely: quicker than a factorisation, and complete.
LARGEST_DENSE = 300

# Eigenvalues this near one another (relative) count as one multiple eigenvalue.
SAME_EIGENVALUE = 1e-6


class SpectrumError(RuntimeError):
    """The eigensolver did not reach the stated residual; the message says for which component."""


@dataclass(frozen=True)
class Spectrum:
    """Eigenpairs of a mesh with n vertices in c connected components, at most k pairs a component.

    A function that lives on one component is zero elsewhere, so one row of k numbers a vertex holds them all,
    however many components there are.

    Attributes
    ----------
    eigenvalues : (c, k) float array, ascending along each row, padded with inf
    eigenvectors : (n, k) float array, mass-orthonormal on each component, padded with 0; column 0 is the
        exact constant of the component
    component : (n,) int array, the component of each vertex
    mass : (n,) float array
    limit : float, every eigenvalue up to it is there
    residual : float, the largest residual of any pair
    """

    eigenvalues: np.ndarray
    eigenvectors: np.ndarray
    component: np.ndarray
    mass: np.ndarray
    limit: float
    residual: float

    @property
    def fiedler_value(self):
        """Smallest eigenvalue above the null space over all components; inf where none was computed."""
        return float(self.eigenvalues[:, 1:].min(initial=np.inf))


class SpectrumSolver:
    """Eigenpairs of one mesh: factorised once, asked as often as needed.

    Parameters
    ----------
    stiffness : (n, n) sparse array, symmetric positive semi-definite, of a mesh of area 1
    mass : (n,) float array, positive
    component : (n,) int array, 0 … c-1, the connected component of each vertex

    Notes
    -----
    Each component is solved alone, on the symmetric matrix M^{-1/2} L M^{-1/2}, with its constant vector put in
    exactly and projected out of the iteration. One Krylov iteration over a mesh with many components misses part
    of its null space and returns rounding noise in its place. The start vector and the eigenvectors' signs are
    fixed, so that the same mesh gives the same numbers.
    """

    def __init__(self, stiffness, mass, component):
        self.mass = mass
        self.component = component
        symmetric = sp.diags_array(mass**-0.5) @ stiffness.tocsr() @ sp.diags_array(mass**-0.5)
        order = np.argsort(component, kind="stable")
        bounds = np.searchsorted(component[order], np.arange(component.max() + 2))
        self._parts = [_Component(symmetric, mass, order[start:stop]) for start, stop in pairwise(bounds)]

    def up_to(self, limit):
        """Every eigenpair with an eigenvalue of at most ``limit``, and the whole of the last one's eigenspace.

        Returns
        -------
        Spectrum

        Raises
        ------
        SpectrumError
            when a pair misses the residual ``LARGEST_RESIDUAL``
        """
        found = [part.up_to(limit) for part in self._parts]
        width = max(len(values) for values, _, _ in found)
        eigenvalues = np.full((len(found), width), np.inf)
        eigenvectors = np.zeros((len(self.mass), width))
        for i, (part, (values, vectors, _)) in enumerate(zip(self._parts, found, strict=True)):
            eigenvalues[i, : len(values)] = values
            eigenvectors[part.vertices, : len(values)] = vectors
        residual = max(residual for _, _, residual in found)
        return Spectrum(eigenvalues, eigenvectors, self.component, self.mass, float(limit), residual)

    def fiedler_value(self):
        """Smallest eigenvalue above the null space, over all components (inf if each is a single vertex)."""
        limit = 16.0
        while (value := self.up_to(limit).fiedler_value) == np.inf and len(self._parts) < len(self.mass):
            limit *= 4
        return value


class _Component:
    """One connected component: its matrix, its factorisation when first needed, its eigenpairs so far."""

    def __init__(self, symmetric, mass, vertices):
        self.vertices = vertices
        whole = len(vertices) == len(mass)
        self.matrix = symmetric if whole else symmetric[vertices][:, vertices]
        self.root_mass = np.sqrt(mass[vertices])
        self.area = mass[vertices].sum()
        self.constant = self.root_mass / np.linalg.norm(self.root_mass)
        self.values, self.vectors = np.empty(0), np.empty((len(vertices), 0))
        self._inverse = None

    def up_to(self, limit):
        n_others = len(self.vertices) - 1
        if n_others < LARGEST_DENSE:
            if len(self.values) < n_others:
                self.values, self.vectors = self._dense()
        else:
            # Weyl's law for area A: the k-th eigenvalue is about 4πk/A. The rest is margin.
            wanted = 8 + int(limit * self.area / (4 * np.pi))
            while len(self.values) < n_others and (not len(self.values) or self.values[-1] <= limit):
                wanted = min(max(wanted, 3 * len(self.values) // 2), n_others - 1)
                self.values, self.vectors = self._lanczos(wanted)
                if wanted == n_others - 1:
                    self.values, self.vectors = self._dense()
        count = np.searchsorted(self.values, limit, side="right")
        while 0 < count < len(self.values) and self.values[count] <= self.values[count - 1] * (1 + SAME_EIGENVALUE):
            count += 1
        values, vectors = self.values[:count], self.vectors[:, :count]
        residual = self._residual(values, vectors)
        return (
            np.concatenate([[0.0], values]),
            np.column_stack([self.constant, vectors]) / self.root_mass[:, None],
            residual,
        )

    def _residual(self, values, vectors):
        # With u = M^{1/2} φ: L φ = M^{1/2} A u and M φ = M^{1/2} u.
        errors = np.linalg.norm(self.root_mass[:, None] * (self.matrix @ vectors - vectors * values), axis=0)
        errors /= np.linalg.norm(self.root_mass[:, None] * vectors, axis=0) * np.maximum(values, 1)
        largest = float(errors.max(initial=0.0))
        if not largest <= LARGEST_RESIDUAL:
            raise SpectrumError(
                f"the eigenpairs of the component of {len(self.vertices)} vertices around vertex "
                f"{self.vertices[0]} have a residual of {largest:.1e}, more than {LARGEST_RESIDUAL:.0e}; very flat "
                "or very unequal triangles are the usual cause: remesh or clean the mesh"
            )
        return largest

    def _dense(self):
        values, vectors = scipy.linalg.eigh(
            # The constant is moved out of the way, above every other eigenvalue.
            self.matrix.toarray() + 2 * self._norm() * np.outer(self.constant, self.constant)
        )
        return values[:-1], _fixed_signs(vectors[:, :-1])

    def _norm(self):
        return max(float(abs(self.matrix).sum(axis=1).max()), 1.0)

    def _lanczos(self, count):
        n = len(self.vertices)
        if self._inverse is None:
            shifted = (self.matrix - SHIFT * sp.eye_array(n)).tocsc()
            self._inverse = splu(
                shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )

        def without_constant(x):
            return x - self.constant * (self.constant @ x)

        operator = LinearOperator(
            (n, n), matvec=lambda x: without_constant(self._inverse.solve(without_constant(x.ravel())))
        )
        start = without_constant(np.random.default_rng(0).standard_normal(n))
        try:
            values, vectors = eigsh(self.matrix, k=count, sigma=SHIFT, OPinv=operator, which="LM", v0=start, tol=0)
        except ArpackNoConvergence as error:
            raise SpectrumError(
                f"only {len(error.eigenvalues)} of {count} eigenpairs of the component of {n} vertices around "
                f"vertex {self.vertices[0]} converged; remesh or clean the mesh"
            ) from error
        order = np.argsort(values)
        return values[order], _fixed_signs(vectors[:, order])


def _fixed_signs(vectors):
    """Each column times ±1 so that its entry of largest magnitude is positive."""
    largest = np.abs(vectors).argmax(axis=0)
    return vectors * np.where(vectors[largest, np.arange(vectors.shape[1])] < 0, -1.0, 1.0)
