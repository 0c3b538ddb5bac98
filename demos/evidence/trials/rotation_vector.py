"""A rod with incremental rotation vectors, a common formulation of large rotations.

In every load step the unknowns are r and the rotation vector of the step, interpolated in P_p; the rotation before the
step and its curvature are stored at the Gauss points. Since increments are interpolated, the discrete rotation depends
on the load steps. The forms are those of this package (forms/equilibrium.py) with another `Motion`. Units of L and
EI/L^2.
"""

import basix
import numpy as np
import ufl
from comparison.mcre_limit import assembled, assembled_vector, unit_mesh
from dolfinx import fem
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms.law import DiagonalLaw
from cosserat_fenicsx.forms.spatial import rotation_tests_of
from cosserat_fenicsx.models.rod_data import gauss_function
from trials import problems
from trials.cells import Answer, Method, NotForIt, Stopped
from trials.chains import NEXT_TO_INFINITE

_TINY = 1e-12


def rotation_of(theta):
    """exp of the skew matrix of a rotation vector, and the H with exp(-theta) (exp(theta))' = skew(H^T theta')."""
    x = ufl.sqrt(ufl.dot(theta, theta) + _TINY)
    S = ufl.as_matrix([[0, -theta[2], theta[1]], [theta[2], 0, -theta[0]], [-theta[1], theta[0], 0]])
    a, b = ufl.sin(x) / x, 2 * ufl.sin(x / 2) ** 2 / x**2
    return ufl.Identity(3) + a * S + b * S * S, ufl.Identity(3) + b * S + (1 - a) / x**2 * S * S


class Rod:
    """The clamped rod on a mesh, in the state after its last step. problem: see `trials.problems`; elements, degree: of
    the mesh."""

    def __init__(self, problem, elements, degree=1):
        L = self.length = problem["length"]
        unit = problem["EI"] / L**2
        mesh = unit_mesh(elements)
        space = compat.function_space(mesh, compat.lagrange(mesh, degree, 6))
        self.U = U = fem.Function(space)  # displacement, rotation vector of the step
        self._points = gauss_function(mesh, degree, 1)
        self.R, self.curvature, R_R = (gauss_function(mesh, degree, size) for size in (9, 3, 9))
        s = ufl.SpatialCoordinate(mesh)[0]
        rule = ufl.dx(domain=mesh, metadata={"quadrature_degree": 2 * degree - 1})

        def matrix(f):
            return ufl.as_matrix([[f[3 * i + j] for j in range(3)] for i in range(3)])

        theta = ufl.as_vector([U[3], U[4], U[5]])
        u_s, theta_s = (ufl.as_vector([U[i + k].dx(0) for i in range(3)]) for k in (0, 3))
        E, H = rotation_of(theta)
        reference = matrix(R_R)
        curvature = self.curvature + matrix(self.R).T * H.T * theta_s
        motion = equilibrium.Motion(reference[:, 2] + u_s, E * matrix(self.R), curvature)
        numbers = [min(problem[key] / unit, NEXT_TO_INFINITE) for key in ("GA", "GA", "EA")]
        bending = [1.0, 1.0, problem["GJ"] / problem["EI"]]
        K, K_inv, J = (fem.Constant(mesh, np.array(a)) for a in (numbers, 1 / np.array(numbers), bending))
        section = equilibrium.Section(DiagonalLaw(K, K_inv, J), reference, ufl.as_vector([0, 0, 1]))
        w = ufl.TestFunction(space)
        test = rotation_tests_of(w, w.dx(0))
        residual = equilibrium.displacement(motion, section, test, lambda a: a * rule)
        points = self._quadrature(degree)
        with compat.quiet_compiler():
            self._residual, self._tangent = fem.form(residual), fem.form(ufl.derivative(residual, U))
            kept = [E[i, k] * self.R[3 * k + j] for i in range(3) for j in range(3) for k in range(3)]
            rows = [sum(kept[3 * n : 3 * n + 3]) for n in range(9)]
            self._next = fem.Expression(ufl.as_vector([*rows, *(curvature[i] for i in range(3))]), points)
            where = compat.evaluate(fem.Expression(ufl.as_vector([s]), points), mesh, self._cells(mesh))
        self.mesh = mesh
        self._nodes = compat.cell_nodes(self._points.function_space).ravel()
        self._put(R_R, problems.frames(L * where.ravel(), problem["radius"]).reshape(-1, 9))
        self._put(self.R, np.tile(np.eye(3).ravel(), (len(self._nodes), 1)))
        at = space.tabulate_dof_coordinates()[:, 0]
        self._clamp, self._tip = 6 * np.argmin(at) + np.arange(6), 6 * np.argmax(at) + np.arange(6)
        self._free = np.setdiff1d(np.arange(len(U.x.array)), self._clamp)

    @staticmethod
    def _quadrature(degree):
        return basix.make_quadrature(basix.CellType.interval, 2 * degree - 1)[0]

    @staticmethod
    def _cells(mesh):
        return np.arange(mesh.topology.index_map(1).size_local, dtype=np.int32)

    def _put(self, function, values):
        size = values.shape[1]
        function.x.array.reshape(-1, size)[self._nodes] = values

    def step(self, load, turn=(0.0, 0.0, 0.0), most=30):
        """Newton's method to a tip load (force, moment) in units of EI/L^2, L; the clamp rotates by a rotation vector.
        Raises Stopped: Newton's method does not converge."""
        x, free = self.U.x.array, self._free
        before = x.copy()
        x[self._clamp[3:]] = turn
        for _ in range(most):
            b = assembled_vector(self._residual)
            b[self._tip] -= load
            K = assembled(self._tangent, free)
            change = splu(K.tocsc()).solve(-b[free]) if np.isfinite(K.data).all() else np.full(len(free), np.inf)
            if not np.abs(change).max() < 10:
                break
            x[free] += change
            if np.abs(change).max() < 1e-10:
                self._keep()
                return
        x[:] = before
        raise Stopped("Newton's method does not converge")

    def _keep(self):
        """Add the step's rotation to that at the Gauss points; the next step starts from zero."""
        values = compat.evaluate(self._next, self.mesh, self._cells(self.mesh)).reshape(-1, 12)
        self._put(self.R, values[:, :9])
        self._put(self.curvature, values[:, 9:])
        self.U.x.array.reshape(-1, 6)[:, 3:] = 0.0

    @property
    def tip(self):
        """(3,) displacement of the tip, m."""
        return self.length * self.U.x.array[self._tip[:3]]


class RotationVector(Method):
    """See `cells.Method`."""

    key, title = "rotation_vector", "rotation vector,\nincremental"
    what = (
        "a rod in space with two-node elements and incremental rotation vectors, 32 elements, one Gauss point each; one"
        " Newton solution a load factor"
    )

    def solve(self, problem, jump=False):
        """An `Answer`, with one step per load factor."""
        if problem.get("guided") or problem.get("follower"):
            raise NotForIt("written for a cantilever under dead loads")
        rod = Rod(problem, (8 if problem.get("coarse") else 32) * problem.get("finer", 1))
        L = problem["length"]
        unit = problem["EI"] / L**2
        whole = np.array([*problem["force"], *(np.array(problem["moment"]) / L)]) / unit
        tips = []
        factors = [(f, f) for f in problem["load_factors"]]
        for k, (force, moment) in enumerate(problem.get("history", factors)):
            try:
                if "turn" in problem:
                    turn = np.array(problem["turn"])
                    Q = Rotation.from_rotvec(turn).as_matrix()
                    turned = np.append(Q @ whole[:3], Q @ whole[3:])
                    rod.step(force * turned, turn / len(factors))
                else:
                    rod.step(whole * np.repeat([force, moment], 3))
            except Stopped as stop:
                raise Stopped(stop, factors[k - 1][0] if k else 0.0) from None
            tips.append(rod.tip.copy())
        return Answer(np.array(tips), "", "no count of negative modes")
