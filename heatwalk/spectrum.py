"""The smallest eigenpairs of (stiffness, mass), component by component."""

from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
import scipy.linalg
import scipy.sparse as sp

# Shift σ of the shift-and-invert, in the units of a mesh of area 1. Anything from -1e-3 to -10 gives the same
# eigenpairs; a larger one conditions the factorisation better and costs a few more Krylov steps.
SHIFT = -10.0

# Largest accepted residual ‖L φ − λ M φ‖ / (‖M φ‖ max(λ, 1)).
LARGEST_RESIDUAL = 1e-8

# Components of at most this many vertices are solved densely: quicker than a factorisation, and complete.
LARGEST_DENSE = 300

# Columns of the Krylov start block, and so the exact copies of one eigenvalue that its space holds: doubled where they
# were too few, as on 1 of 38 benchmark models. Even, as the inner loops take two at a time. A wider block shares each
# pass over the factors among more columns, but needs more vectors in all, which cost time and memory: 82 with 2
# columns, 102 with 3 for the same 20 pairs.
BLOCK_WIDTH = 2

# An eigenpair (θ, u) of the inverse counts as found when ‖(A - σ)⁻¹ u - θ u‖ is within this of θ. The pair before the
# last is found some steps earlier: those that weigh in the kernel are exact to working precision …
FOUND = 1e-10
# … and the first beyond the limit, which only bounds the others, when it is within this.
SETTLED = 1e-5

# A Krylov space holds all the copies of an eigenvalue, or as many as its block has columns: where as many eigenvalues θ
# are this near one another (relative), the block is taken twice as wide.
COPIES = 1e-3
# Where they lie a little apart, there may still be more than were found, and a probe looks for others, in this many
# steps, which take an eighth of the time. (Without the probe, none was missed in 80 trials: 3 to 40 spheres in one
# component, of which each differs from the next by 1e-4 to .04.)
CROWDED = 0.01
PROBE_STEPS = 4

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
    of its null space and returns rounding noise in its place. The start block is fixed, so that the same mesh
    gives the same numbers.
    """

    def __init__(self, stiffness, mass, component):
        self.mass = mass
        self.component = component
        symmetric = _scaled(stiffness, mass**-0.5)
        if component.max() == 0:
            self._parts = [_Component(symmetric, mass, np.arange(len(mass)))]
            return
        order = np.argsort(component, kind="stable")
        bounds = np.searchsorted(component[order], np.arange(component.max() + 2))
        symmetric = _permuted(symmetric, order)  # block diagonal
        self._parts = [
            _Component(_diagonal_block(symmetric, start, stop), mass, order[start:stop])
            for start, stop in pairwise(bounds)
        ]

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
        width = 1 + max(len(values) for values, _, _ in found)
        eigenvalues = np.full((len(found), width), np.inf)
        eigenvalues[:, 0] = 0
        eigenvectors = np.zeros((len(self.mass), width))
        for i, (part, (values, vectors, _)) in enumerate(zip(self._parts, found, strict=True)):
            eigenvalues[i, 1 : 1 + len(values)] = values
            eigenvectors[part.vertices, 0] = 1 / np.linalg.norm(part.root_mass)
            eigenvectors[part.vertices, 1 : 1 + len(values)] = vectors / part.root_mass[:, None]
        residual = max(residual for _, _, residual in found)
        return Spectrum(eigenvalues, eigenvectors, self.component, self.mass, float(limit), residual)

    def fiedler_value(self):
        """Smallest eigenvalue above the null space, over all components (inf if each is a single vertex)."""
        limit = 16.0
        while (value := self.up_to(limit).fiedler_value) == np.inf and len(self._parts) < len(self.mass):
            limit *= 4
        return value


class _Component:
    """One connected component: its matrix A, its factorisation when first needed, its eigenpairs so far."""

    def __init__(self, matrix, mass, vertices):
        self.dense = len(vertices) <= LARGEST_DENSE
        if not self.dense:
            # Imported here: numba takes half a second, which `import heatwalk` should not.
            from heatwalk.numerics.cholesky import Cholesky
            from heatwalk.numerics.dissection import nested_dissection

            order, pieces = nested_dissection(matrix)
            matrix, vertices = _permuted(matrix, order), vertices[order]
            try:
                self._inverse = Cholesky(matrix, pieces, SHIFT)
            except scipy.linalg.LinAlgError as error:
                raise SpectrumError(
                    f"{_named(vertices)} has no factorisation: its stiffness is not positive semi-definite but for "
                    "rounding; very flat or very unequal triangles are the usual cause: remesh or clean the mesh"
                ) from error
            self.width = BLOCK_WIDTH
        self.matrix = matrix
        self.vertices = vertices
        self.root_mass = np.sqrt(mass[vertices])
        self.constant = self.root_mass / np.linalg.norm(self.root_mass)
        self.values, self.vectors, self.reach = np.empty(0), np.empty((len(vertices), 0)), -np.inf

    def up_to(self, limit):
        """Eigenvalues above 0, eigenvectors of A, largest residual."""
        if limit > self.reach:
            if self.dense:
                self.values, self.vectors, self.reach = *self._dense(), np.inf
            else:
                while (found := self._krylov(limit)) is None:
                    self.width *= 2
                self.values, self.vectors, self.reach = *found, limit
        count = _complete(self.values, limit)
        values, vectors = self.values[:count], self.vectors[:, :count]
        return values, vectors, self._residual(values, vectors)

    def _residual(self, values, vectors):
        # With u = M^{1/2} φ: L φ = M^{1/2} A u and M φ = M^{1/2} u. One by one, for the memory's sake.
        largest = 0.0
        for value, u in zip(values, vectors.T, strict=True):
            error = np.linalg.norm(self.root_mass * (self.matrix @ u - value * u))
            largest = max(largest, error / (np.linalg.norm(self.root_mass * u) * max(value, 1.0)))
        if not largest <= LARGEST_RESIDUAL:
            raise SpectrumError(
                f"the eigenpairs of {_named(self.vertices)} have a residual of {largest:.1e}, more than "
                f"{LARGEST_RESIDUAL:.0e}; very flat or very unequal triangles are the usual cause: remesh or clean "
                "the mesh"
            )
        return float(largest)

    def _dense(self):
        values, vectors = scipy.linalg.eigh(
            # The constant is moved out of the way, above every other eigenvalue.
            self.matrix.toarray() + 2 * self._norm() * np.outer(self.constant, self.constant)
        )
        return values[:-1], vectors[:, :-1]

    def _norm(self):
        return max(float(abs(self.matrix).sum(axis=1).max()), 1.0)

    def _krylov(self, limit):
        """Eigenpairs up to ``limit``; None where the start block had too few columns for all copies of one of them."""
        from heatwalk.numerics.lanczos import lanczos

        rng = np.random.default_rng(0)
        width = self.width
        next_look = 0
        try:
            for basis, projected, rest, coupling in lanczos(self._apply_inverse, self._start(rng, width)):
                size = len(projected)
                if 2 * size > len(self.vertices):
                    return self._dense()
                if size < next_look:
                    continue
                next_look = 1.05 * size
                theta, mix = (array[..., ::-1] for array in scipy.linalg.eigh(projected))
                values = 1 / np.maximum(theta, np.finfo(float).tiny) + SHIFT
                error = np.linalg.norm(coupling @ mix[-width:], axis=0)
                count = _complete(values, limit)
                if (
                    count < size
                    and (error[:count] <= FOUND * theta[:count]).all()
                    and error[count] <= SETTLED * theta[count]
                ):
                    basis.append(rest)
                    apart = theta[: max(count - width + 1, 0)] / theta[width - 1 : count] - 1
                    if (apart <= COPIES).any():
                        return None
                    largest_allowed = 1 / (limit * (1 + SAME_EIGENVALUE) - SHIFT)
                    if (apart <= CROWDED).any() and self._largest_outside(basis, rng) > largest_allowed:
                        return None
                    # The inverse once more on each vector, at no cost: S V y = θ V y + rest · coupling · y_last.
                    mix, theta = mix[:, :count], theta[:count]
                    return values[:count], basis.combined(np.vstack([mix, coupling @ mix[-width:] / theta]))
        except scipy.linalg.LinAlgError:  # nothing is left: the space holds all that it ever will
            return self._dense()

    def _start(self, rng, width):
        # Random values of φ: in u = M^{1/2} φ the rows of vertices without mass are tiny and must start so, or
        # their rounding would spoil the residual.
        start = (rng.standard_normal((width, len(self.vertices))) * self.root_mass).T
        start -= np.outer(self.constant, self.constant @ start)
        return start

    def _largest_outside(self, basis, rng):
        """Upper estimate of the largest eigenvalue of the inverse on what is orthogonal to ``basis``.

        No start block has a part in all copies of an eigenvalue when these are more than its columns. New random
        vectors have a part in the copies left over, and in a few steps turn to them: nothing else outside the basis
        is as large.
        """
        from heatwalk.numerics.lanczos import lanczos

        def outside(block):
            return basis.take_out(self._apply_inverse(block))[1]

        start = basis.take_out(self._start(rng, BLOCK_WIDTH))[1]
        *_, (_, projected, _, coupling) = islice(lanczos(outside, start), PROBE_STEPS)
        theta, mix = scipy.linalg.eigh(projected)
        return theta[-1] + np.linalg.norm(coupling @ mix[-BLOCK_WIDTH:, -1])

    def _apply_inverse(self, block):
        """(A - σ)⁻¹, the constant projected out."""
        block = self._inverse.solve(block)
        for side in block.T:
            side -= (self.constant @ side) * self.constant
        return block


def _named(vertices):
    return f"the component of {len(vertices)} vertices around vertex {vertices.min()}"


def _complete(values, limit):
    """How many of the ascending ``values`` are up to ``limit`` or copies of the last that is."""
    count = int(np.searchsorted(values, limit, side="right"))
    while 0 < count < len(values) and values[count] <= values[count - 1] * (1 + SAME_EIGENVALUE):
        count += 1
    return count


def _scaled(matrix, scale):
    """diag(``scale``) @ ``matrix`` @ diag(``scale``) of a symmetric matrix: csr_array that shares its indices."""
    rows = matrix.T.tocsr()  # of a csc_array no copy
    data = rows.data * np.repeat(scale, np.diff(rows.indptr))
    data *= scale[rows.indices]
    return sp.csr_array((data, rows.indices, rows.indptr), shape=matrix.shape)


def _permuted(matrix, order):
    """Rows and columns of a csr_array in this order."""
    rank = np.empty(len(order), matrix.indices.dtype)
    rank[order] = np.arange(len(order), dtype=rank.dtype)
    rows = matrix[order]
    rows.indices = rank[rows.indices]
    rows.has_sorted_indices = False
    return rows


def _diagonal_block(matrix, start, stop):
    """Rows and columns start … stop of a block-diagonal CSR array."""
    first, last = matrix.indptr[start], matrix.indptr[stop]
    parts = matrix.data[first:last], matrix.indices[first:last] - start, matrix.indptr[start : stop + 1] - first
    return sp.csr_array(parts, shape=(stop - start,) * 2)
