"""The smallest eigenpairs of (stiffness, mass), component by component.

for each connected component:
    A = M^{-1/2} L M^{-1/2}, u = M^{1/2} φ
    if it is small: all eigenpairs by a dense solver; of A, or where rounding spoils these, of (A - σ)⁻¹
    else: shift and invert, S = (A - σ)⁻¹ with the constant projected out
        block Lanczos on S until
            every Ritz pair up to the limit has converged (`RITZ_TOLERANCE`)
            and the first beyond the limit roughly so (`BEYOND_TOLERANCE`)
        if so many eigenvalues are so close together that the start block may have too few columns to find all of
        them: look for others outside the Krylov space, or repeat with twice as many columns
check the residual of every pair
"""

from dataclasses import dataclass
from itertools import islice, pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from heatwalk.numerics.sparse import diagonal_block, permute_symmetric, scale_symmetric
from heatwalk.numerics.threads import one_blas_thread, serial, shared, worth_sharing

if TYPE_CHECKING:
    import scipy.sparse as sp

    from heatwalk.numerics.lanczos import Basis

# Shift σ of the shift-and-invert, for a mesh of area 1. Anything from -1e-3 to -10 gives the same eigenpairs; a larger
# magnitude improves the conditioning of the factorisation and costs a few more Krylov steps.
SHIFT = -10.0

# Largest accepted residual ‖L φ − λ M φ‖ / (‖M φ‖ max(λ, 1)).
MAX_RESIDUAL = 1e-8

# Next to slivers, cotangents are so large that evaluating L φ in double precision alone has an error of more than that.
# Up to so many times the largest residual is then accepted, as long as it is within a few roundings of every product:
# the pairs are as exact as the coordinates, and labels next to slivers do not depend on it.
ROUNDING_FACTOR = 100
ROUNDINGS = 4

# Components of at most this many vertices are solved densely: faster than a factorisation, and complete.
MAX_DENSE_SIZE = 300

# Columns of the Krylov start block, and thus the number of exact copies of an eigenvalue that its space contains. It is
# doubled if it is too small, as on 1 of 38 benchmark models. Even, because the inner loops take two columns at a time.
# A wider block shares each pass over the factor among more columns, but needs more vectors overall, which cost time and
# memory: 82 with 2 columns, 102 with 3 for the same 20 pairs.
BLOCK_WIDTH = 2

# A Ritz pair (θ, u) of S = (A - σ)⁻¹ has converged when ‖S u - θ u‖ is within this of θ. All pairs but the last are
# found some steps earlier: those with a weight in the kernel are exact to working precision …
RITZ_TOLERANCE = 1e-10
# … and the first pair beyond the limit, which only bounds the others, when it is within this.
BEYOND_TOLERANCE = 1e-5

# Growth of the Krylov space between two tests for convergence.
TEST_GROWTH = 1.05

# A Krylov space contains all copies of an eigenvalue, or as many as its block has columns: if as many eigenvalues θ are
# this close to one another (relative), the block width is doubled.
COPY_TOLERANCE = 1e-3
# If they are slightly farther apart, more may exist than were found, and a probe looks for others in this many steps,
# which take an eighth of the time. (Without the probe, none was missed in 80 trials: 3 to 40 spheres in one component,
# each different from the next by 1e-4 to 0.04.)
CLUSTER_TOLERANCE = 0.01
PROBE_STEPS = 4

# Of so many eigenvalues, some are as close as copies by chance, and repeating the iteration with blocks of 4, 8, 16, 32
# columns, as on meshes with hundreds of spikes, would be in vain. The probe goes on instead until the largest
# eigenvalue outside the space is known to BEYOND_TOLERANCE, in a tenth of the time of one repetition, or fails after
# this share of the steps of the iteration.
MANY_PAIRS = 200
LONGEST_PROBE = 0.25

# Rows of eigenvectors that are copied at a time.
STRIPE = 2**13

# Eigenvalues this close to one another (relative) count as one multiple eigenvalue.
MULTIPLICITY_TOLERANCE = 1e-6


class SpectrumError(RuntimeError):
    """The eigensolver did not reach the required residual; the message names the component."""


@dataclass(frozen=True)
class Spectrum:
    """Eigenpairs of a mesh with n vertices in c connected components, at most k pairs per component.

    A function on one component is zero elsewhere, so a row of k numbers per vertex represents all of them, however many
    components there are.

    Attributes
    ----------
    eigenvalues : (c, k) float array
        ascending along each row, padded with inf
    eigenvectors : (n, k) float array
        mass-orthonormal on each component, padded with 0; column 0 is the exact constant of the component
    component : (n,) int array
        the component of each vertex
    mass : (n,) float array
    limit : float
        all eigenvalues up to this limit are included
    residual : float
        the largest residual of any pair, relative (see `MAX_RESIDUAL`)
    """

    eigenvalues: NDArray[np.float64]
    eigenvectors: NDArray[np.float64]
    component: NDArray[np.int64]
    mass: NDArray[np.float64]
    limit: float
    residual: float

    @property
    def fiedler_value(self) -> float:
        """Smallest eigenvalue above the null space over all components; inf if none was computed."""
        return float(self.eigenvalues[:, 1:].min(initial=np.inf))


class SpectrumSolver:
    """Eigenpairs of one mesh: factorised once, queried as often as needed.

    Parameters
    ----------
    stiffness : (n, n) scipy.sparse.csc_array
        symmetric positive semi-definite, of a mesh of area 1
    mass : (n,) float array, positive
    component : (n,) int array
        the connected component of each vertex, 0 … c-1
    max_residual : float, optional
        largest residual of a pair that is accepted, relative; by default `MAX_RESIDUAL`

    Raises
    ------
    SpectrumError
        if a component cannot be factorised

    Notes
    -----
    Each component is solved on its own, on the symmetric matrix M^{-1/2} L M^{-1/2}. Its constant vector is known
    exactly and projected out of the iteration: a single Krylov iteration over a mesh of many components would miss part
    of the null space and return rounding errors in its place. The start block is fixed, so that the same mesh always
    gives the same numbers.

    Examples
    --------
    The unit square with insulated boundary, whose eigenvalues are π²(a² + b²):

    >>> from heatwalk.laplacian import stiffness_and_mass, vertex_components
    >>> i, j = np.divmod(np.arange(40 * 40), 40)
    >>> corner = np.flatnonzero((i < 39) & (j < 39))
    >>> faces = np.vstack([corner + [[0], [40], [41]], corner + [[0], [41], [1]]]).T.reshape(-1, 2, 3).reshape(-1, 3)
    >>> vertices = np.column_stack([i, j, 0 * i]) / 39
    >>> solver = SpectrumSolver(*stiffness_and_mass(vertices, faces), vertex_components(len(vertices), faces))
    >>> (solver.up_to(41.0).eigenvalues / np.pi**2).round(2)
    array([[0.  , 1.  , 1.  , 2.  , 3.99, 3.99]])
    """

    @one_blas_thread()
    def __init__(
        self,
        stiffness: "sp.csc_array",
        mass: NDArray[np.float64],
        component: NDArray[np.int64],
        max_residual: float | None = None,
    ) -> None:
        max_residual = MAX_RESIDUAL if max_residual is None else max_residual
        self.mass = mass
        self.component = component
        symmetric = scale_symmetric(stiffness, mass**-0.5)
        if component.max() == 0:
            self._parts = [_Component(symmetric, mass, np.arange(len(mass)), max_residual)]
            return
        order = np.argsort(component, kind="stable")
        bounds = np.searchsorted(component[order], np.arange(component.max() + 2))
        symmetric = permute_symmetric(symmetric, order)  # block diagonal
        self._parts = [
            _Component(diagonal_block(symmetric, start, stop), mass, order[start:stop], max_residual)
            for start, stop in pairwise(bounds)
        ]

    @one_blas_thread()
    def up_to(self, limit: float) -> Spectrum:
        """Compute every eigenpair with an eigenvalue of at most ``limit``, and all of the eigenspace of the last one.

        Parameters
        ----------
        limit : float

        Returns
        -------
        Spectrum

        Raises
        ------
        SpectrumError
            if the residual of a pair exceeds ``max_residual``
        """
        found = [part.up_to(limit) for part in self._parts]
        width = 1 + max(len(values) for values, _, _ in found)
        eigenvalues = np.full((len(found), width), np.inf)
        eigenvalues[:, 0] = 0
        eigenvectors = np.zeros((len(self.mass), width))
        for i, (part, (values, vectors, _)) in enumerate(zip(self._parts, found, strict=True)):
            eigenvalues[i, 1 : 1 + len(values)] = values
            eigenvectors[part.vertices, 0] = 1 / np.linalg.norm(part.root_mass)
            part.copy_functions(vectors, eigenvectors[:, 1 : 1 + len(values)])
        residual = max(residual for _, _, residual in found)
        return Spectrum(eigenvalues, eigenvectors, self.component, self.mass, float(limit), residual)

    def fiedler_value(self) -> float:
        """Smallest eigenvalue above the null space over all components; inf if every component is a single vertex."""
        limit = 16.0
        while (value := self.up_to(limit).fiedler_value) == np.inf and len(self._parts) < len(self.mass):
            limit *= 4
        return value


class _Component:
    """One connected component: its matrix A, its factorisation unless it is small, and its eigenpairs so far."""

    def __init__(
        self,
        matrix: "sp.csr_array",
        mass: NDArray[np.float64],
        vertices: NDArray[np.int64],
        max_residual: float,
    ) -> None:
        self.max_residual = max_residual
        self.is_dense = len(vertices) <= MAX_DENSE_SIZE
        if not self.is_dense:
            from heatwalk.numerics.solver import PositiveDefiniteSolver  # imports numba

            try:
                self._solver = PositiveDefiniteSolver(matrix, SHIFT)
            except np.linalg.LinAlgError as error:
                raise SpectrumError(
                    f"{_describe(vertices)} cannot be factorised: its stiffness matrix is not positive semi-definite "
                    "up to rounding, usually because of very flat or very unequal triangles; remesh or clean the mesh"
                ) from error
            matrix, vertices = self._solver.matrix, vertices[self._solver.order]
            self.width = BLOCK_WIDTH
        self.matrix = matrix
        self.vertices = vertices
        self.root_mass = np.sqrt(mass[vertices])
        self.constant = self.root_mass / np.linalg.norm(self.root_mass)
        self.values, self.vectors, self.limit = np.empty(0), np.empty((len(vertices), 0)), -np.inf

    def up_to(self, limit: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Positive eigenvalues up to ``limit``, eigenvectors of A, largest residual."""
        if limit > self.limit:
            if self.is_dense:
                (self.values, self.vectors), self.limit = self._solve_small(limit), np.inf
            else:
                while (found := self._iterate(limit)) is None:
                    self.width *= 2
                (self.values, self.vectors), self.limit = found, limit
        count = _count_complete(self.values, limit)
        values, vectors = self.values[:count], self.vectors[:, :count]
        return values, vectors, self._check_residual(values, vectors)

    def copy_functions(self, vectors: NDArray[np.float64], target: NDArray[np.float64]) -> None:
        """Put the functions φ = M^{-1/2} u of ``vectors`` u of A into the rows of a target at its vertices."""

        def copy_rows(start: int) -> None:
            rows = slice(start, start + STRIPE)
            target[self.vertices[rows]] = vectors[rows] / self.root_mass[rows, None]

        shared(copy_rows, range(0, len(vectors), STRIPE))

    def _check_residual(self, values: NDArray[np.float64], vectors: NDArray[np.float64]) -> float:
        """The largest residual; SpectrumError if it is too large."""
        # One pair at a time in each thread, to save memory.
        each = shared if worth_sharing(len(vectors)) else serial
        return max(each(self._residual, values, vectors.T), default=0.0)

    def _residual(self, value: float, u: NDArray[np.float64]) -> float:
        """The residual of a pair; SpectrumError if it is too large."""
        residual, is_small = self._measure_residual(value, u)
        if not is_small:
            raise SpectrumError(
                f"the eigenpairs of {_describe(self.vertices)} have a residual of {residual:.1e}, more than "
                f"{self.max_residual:.0e}, usually because of very flat or very unequal triangles; remesh or clean "
                "the mesh"
            )
        return residual

    def _measure_residual(self, value: float, u: NDArray[np.float64]) -> tuple[float, bool]:
        """The residual of a pair, and whether it is small enough."""
        # With u = M^{1/2} φ: L φ = M^{1/2} A u and M φ = M^{1/2} u.
        scale = np.linalg.norm(self.root_mass * u) * max(value, 1.0)
        residual = float(np.linalg.norm(self.root_mass * (self.matrix @ u - value * u)) / scale)
        if residual <= self.max_residual:
            return residual, True
        rounding = float(np.linalg.norm(self.root_mass * (abs(self.matrix) @ abs(u))) / scale) * np.finfo(float).eps
        return residual, residual <= min(ROUNDINGS * rounding, ROUNDING_FACTOR * self.max_residual)

    def _solve_small(self, limit: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """All positive eigenvalues and their eigenvectors, those up to ``limit`` with small residuals if possible."""
        values, vectors = self._solve_densely()
        count = _count_complete(values, limit)
        if all(self._measure_residual(*pair)[1] for pair in zip(values[:count], vectors.T[:count], strict=True)):
            return values, vectors
        return self._solve_inverse()

    def _solve_inverse(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As `_solve_densely`, but rounding errors are relative to the smallest eigenvalues instead of to the largest.

        The latter are enormous where masses are tiny. The factor is as exact as if all diagonal elements were 1.
        """
        factor = scipy.linalg.cho_factor(self.matrix.toarray() - SHIFT * np.eye(len(self.vertices)))
        inverse = scipy.linalg.cho_solve(factor, np.eye(len(self.vertices)))
        theta, vectors = scipy.linalg.eigh(inverse + 2 * np.outer(self.constant, self.constant) / SHIFT)
        theta, vectors = theta[:0:-1], vectors[:, :0:-1]
        # Applied once more, for the rows of vertices with tiny masses.
        vectors = scipy.linalg.cho_solve(factor, vectors) / theta
        return 1 / theta + SHIFT, vectors

    def _solve_densely(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """All positive eigenvalues and their eigenvectors."""
        norm = max(float(abs(self.matrix).sum(axis=1).max()), 1.0)
        values, vectors = scipy.linalg.eigh(
            # The eigenvalue of the constant is moved above all others.
            self.matrix.toarray() + 2 * norm * np.outer(self.constant, self.constant)
        )
        return values[:-1], vectors[:, :-1]

    def _iterate(self, limit: float) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Eigenpairs up to ``limit`` by Lanczos iteration; None if the start block may have too few columns."""
        from heatwalk.numerics.lanczos import lanczos

        rng = np.random.default_rng(0)
        width = self.width
        next_test: float = 0
        try:
            for basis, projected, rest, coupling in lanczos(self._apply_inverse, self._start_block(rng, width)):
                size = len(projected)
                if 2 * size > len(self.vertices):
                    return self._solve_densely()
                if size < next_test:
                    continue
                next_test = TEST_GROWTH * size
                theta, mix = (array[..., ::-1] for array in scipy.linalg.eigh(projected))
                values = 1 / np.maximum(theta, np.finfo(float).tiny) + SHIFT
                error = np.linalg.norm(coupling @ mix[-width:], axis=0)
                count = _count_complete(values, limit)
                if _has_converged(theta, error, count):
                    basis.append(rest)
                    if self._may_have_missed(theta, count, limit, basis, rng):
                        return None
                    # S applied once more to each vector, at no cost: S V y = θ V y + rest · coupling · y_last.
                    mix, theta = mix[:, :count], theta[:count]
                    return values[:count], basis.combine(np.vstack([mix, coupling @ mix[-width:] / theta]))
        except np.linalg.LinAlgError:  # the space contains everything that it ever will
            pass
        return self._solve_densely()

    def _may_have_missed(
        self, theta: NDArray[np.float64], count: int, limit: float, basis: "Basis", rng: np.random.Generator
    ) -> bool:
        """Whether eigenvalues close to the ``count`` found ones may be missing, for lack of columns of the block."""
        spread = theta[: max(count - self.width + 1, 0)] / theta[self.width - 1 : count] - 1
        if not (spread <= CLUSTER_TOLERANCE).any():
            return False
        largest_allowed = 1 / (limit * (1 + MULTIPLICITY_TOLERANCE) - SHIFT)
        if not (spread <= COPY_TOLERANCE).any():
            return self._largest_outside(basis, rng, PROBE_STEPS, 0.0) > largest_allowed
        if count < MANY_PAIRS:
            return True
        longest = int(LONGEST_PROBE * len(theta) / BLOCK_WIDTH)
        return self._largest_outside(basis, rng, longest, BEYOND_TOLERANCE) > largest_allowed

    def _start_block(self, rng: np.random.Generator, width: int) -> NDArray[np.float64]:
        """Random block, orthogonal to the constant."""
        # Random values of φ, not of u = M^{1/2} φ: rows of vertices without mass must start tiny, or their rounding
        # errors would spoil the residual.
        start = (rng.standard_normal((width, len(self.vertices))) * self.root_mass).T
        start -= np.outer(self.constant, self.constant @ start)
        return start

    def _largest_outside(self, basis: "Basis", rng: np.random.Generator, steps: int, tolerance: float) -> float:
        """Upper estimate of the largest eigenvalue of S on the orthogonal complement of ``basis``.

        If an eigenvalue has more copies than the start block has columns, some of them have no component in the Krylov
        space. New random vectors do have components in these copies, and turn towards them in a few steps, because
        nothing else outside the basis is as large. Ends after so many steps, or once the error of the estimate is
        within ``tolerance`` (relative).
        """
        from heatwalk.numerics.lanczos import lanczos

        def apply_outside(block: NDArray[np.float64]) -> NDArray[np.float64]:
            return basis.remove_components(self._apply_inverse(block))[1]

        start = basis.remove_components(self._start_block(rng, BLOCK_WIDTH))[1]
        largest = np.inf
        for _, projected, _, coupling in islice(lanczos(apply_outside, start), steps):
            theta, mix = scipy.linalg.eigh(projected)
            error = float(np.linalg.norm(coupling @ mix[-BLOCK_WIDTH:, -1]))
            largest = float(theta[-1]) + error
            if error <= tolerance * theta[-1]:
                break
        return largest

    def _apply_inverse(self, block: NDArray[np.float64]) -> NDArray[np.float64]:
        """(A - σ)⁻¹ ``block``, with the constant projected out."""
        block = self._solver.solve(block)

        def project(side: NDArray[np.float64]) -> None:
            side -= (self.constant @ side) * self.constant

        (shared if worth_sharing(*block.shape) else serial)(project, block.T)
        return block


def _has_converged(theta: NDArray[np.float64], error: NDArray[np.float64], count: int) -> bool:
    """Whether the first ``count`` Ritz pairs and the one after them have converged."""
    return bool(
        count < len(theta)
        and (error[:count] <= RITZ_TOLERANCE * theta[:count]).all()
        and error[count] <= BEYOND_TOLERANCE * theta[count]
    )


def _describe(vertices: NDArray[np.int64]) -> str:
    """A component, for error messages."""
    return f"the component of {len(vertices)} vertices around vertex {vertices.min()}"


def _count_complete(values: NDArray[np.float64], limit: float) -> int:
    """Number of the ascending ``values`` that are up to ``limit``, or copies of the last of these."""
    count = int(np.searchsorted(values, limit, side="right"))
    while 0 < count < len(values) and values[count] <= values[count - 1] * (1 + MULTIPLICITY_TOLERANCE):
        count += 1
    return count
