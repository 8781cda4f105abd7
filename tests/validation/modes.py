"""Natural frequencies of solid elements against published benchmarks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from tests.validation.page import Case, Figure, case
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.msh import session

STEEL = Material(200e9, 0.3, 8000.0)
FV31 = ("52.404", "125.69", "140.78", "222.54", "241.41", "255.74")
FV32 = ("44.623", "130.03", "162.70", "246.05", "379.90", "391.44")
SDLS01 = ("3.492", "8.525", "21.43", "27.33", "31.11", "54.44")


def membrane(folder: Path, cells: int, width: float, tip_width: float | None = None) -> np.ndarray:
    """(6,) Hz of a membrane 10 m long and 0.05 m thick, clamped at one end, in its plane.

    The lower half of the thickness with the middle plane on rollers: no bending, free to thin, so plane stress.
    """
    across = round(cells * width / 10.0)
    block = TaperedBlock(10.0, width, 0.025, tip_width, divisions=(cells, across, 1), hexahedra=True)
    path = build(block, folder / "membrane.msh")
    return solve_modes(assemble(path, {"default": STEEL}, {"root": "xyz", "bottom": "z"}, degree=2), 6).frequencies_hz


def square_membrane(folder: Path, cells: int) -> np.ndarray:
    """NAFEMS FV31."""
    return membrane(folder, cells, width=10.0)


def tapered_membrane(folder: Path, cells: int) -> np.ndarray:
    """NAFEMS FV32."""
    return membrane(folder, cells, width=5.0, tip_width=1.0)


def square_plate(folder: Path, cells: int) -> np.ndarray:
    """SDLS01: lambda^2 of a plate of 1 m, 0.01 m thick, clamped on one edge, from its frequencies by thin plates."""
    side, thickness, young, density = 1.0, 0.01, 2.1e11, 7800.0
    block = TaperedBlock(side, side, thickness, divisions=(cells, cells, 1), hexahedra=True)
    path, steel = build(block, folder / "plate.msh"), {"default": Material(young, 0.3, density)}
    frequencies = solve_modes(assemble(path, steel, {"root": "xyz"}, degree=2), 6).frequencies_hz
    return frequencies * 2 * np.pi * side**2 / np.sqrt(young * thickness**2 / (12 * density * (1 - 0.3**2)))


@case(
    "square cantilever membrane, 16 x 16 elements",
    "NAFEMS FV31 (Selected Benchmarks for Natural Frequency Analysis, test 31, 1987)",
    "tests/validation/test_published_modes.py::test_square_membrane_converges",
)
def fv31() -> list[Figure]:
    """The fourth published figure stands 0.7 % below what meshes here and in other programs converge to."""
    return _modes(square_membrane, FV31, "mode {}, Hz", 8e-3)


@case(
    "tapered cantilever membrane, 16 x 8 elements",
    "NAFEMS FV32",
    "tests/modal/test_benchmarks.py::test_tapered_cantilever_membrane",
)
def fv32() -> list[Figure]:
    return _modes(tapered_membrane, FV32, "mode {}, Hz", 2e-3)


@case(
    "square cantilever plate, 16 x 16 elements",
    "SDLS01 (Guide de validation des progiciels de calcul de structures, 1990)",
    "tests/modal/test_benchmarks.py::test_cantilever_square_plate",
)
def sdls01() -> list[Figure]:
    return _modes(square_plate, SDLS01, "lambda^2 of mode {}", 5e-3)


def _modes(
    solve: Callable[[Path, int], np.ndarray], published: tuple[str, ...], label: str, tolerance: float
) -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        found = solve(Path(folder), 16)
    pairs = zip(published, found, strict=True)
    return [Figure(label.format(n), value, here, tolerance) for n, (value, here) in enumerate(pairs, 1)]


@dataclass(frozen=True)
class Tube:
    """A free circular tube, metres."""

    length: float = 1.0
    outer: float = 0.05
    inner: float = 0.025

    def frequencies(self, folder: Path, around: int, across: int, along: int, count: int) -> np.ndarray:
        """(count,) Hz above the six rigid modes, with curved hexahedra of degree 2."""
        path = self._mesh(folder / "tube.msh", around, across, along)
        return solve_modes(assemble(path, {"default": STEEL}, {}, degree=2), 6 + count).frequencies_hz[6:]

    def timoshenko(self, count: int) -> np.ndarray:
        """(count,) Hz of bending by Timoshenko's theory with Hutchinson's shear coefficient.

        Hutchinson (2001), J. Appl. Mech. 68, 87-92, for the hollow circular section. The equations of w, psi, M, V in
        units of length L, E I / L and E I / L^2 are w' = psi + s V, psi' = M, M' = -V - r q psi, V' = -q w, with
        q = omega^2 rho A L^4 / (E I), r = I / (A L^2), s = E I / (kappa G A L^2); both ends are free of M and V.
        """
        a, b, nu = self.inner, self.outer, STEEL.poisson
        area, inertia = np.pi * (b**2 - a**2), np.pi / 4 * (b**4 - a**4)
        kappa = 6 * (a**2 + b**2) ** 2 * (1 + nu) ** 2 / (
            7 * a**4 + 34 * a**2 * b**2 + 7 * b**4 + nu * (12 * a**4 + 48 * a**2 * b**2 + 12 * b**4)
            + nu**2 * (4 * a**4 + 16 * a**2 * b**2 + 4 * b**4)
        )  # fmt: skip
        r = inertia / (area * self.length**2)
        s = 2 * (1 + nu) * r / kappa
        unit = np.sqrt(STEEL.young * inertia / (STEEL.density * area)) / self.length**2

        def free_ends(omega: float) -> float:
            q = omega**2
            flow = expm(np.array([[0, 1, 0, s], [0, 0, 1, 0], [0, -q * r, 0, -1], [-q, 0, 0, 0]], dtype=float))
            return float(flow[2, 0] * flow[3, 1] - flow[2, 1] * flow[3, 0])

        grid = np.arange(1.0, 100.0 * count, 2.0)
        values = np.array([free_ends(omega) for omega in grid])
        brackets = np.flatnonzero(values[:-1] * values[1:] < 0.0)[:count]
        return np.array([brentq(free_ends, grid[i], grid[i + 1], xtol=1e-12) for i in brackets]) * unit / (2 * np.pi)

    def _mesh(self, path: Path, around: int, across: int, along: int) -> Path:
        """Four quarters of the section, swept along x."""
        with session("tube"):
            geo = gmsh.model.geo
            centre = geo.addPoint(0, 0, 0)
            rings = [[geo.addPoint(0, r * y, r * z) for y, z in ((1, 0), (0, 1), (-1, 0), (0, -1))]
                     for r in (self.inner, self.outer)]  # fmt: skip
            arcs = [[geo.addCircleArc(ring[k], centre, ring[(k + 1) % 4]) for k in range(4)] for ring in rings]
            spokes = [geo.addLine(first, second) for first, second in zip(*rings, strict=True)]
            faces = []
            for k in range(4):
                loop = geo.addCurveLoop([spokes[k], arcs[1][k], -spokes[(k + 1) % 4], -arcs[0][k]])
                faces.append((2, geo.addPlaneSurface([loop])))
                for curve, count in ((arcs[0][k], around // 4), (arcs[1][k], around // 4), (spokes[k], across)):
                    geo.mesh.setTransfiniteCurve(curve, count + 1)
                geo.mesh.setTransfiniteSurface(faces[-1][1])
                geo.mesh.setRecombine(2, faces[-1][1])
            solid = geo.extrude(faces, self.length, 0, 0, numElements=[along], recombine=True)
            geo.synchronize()
            volumes = [(dimension, tag) for dimension, tag in solid if dimension == 3]
            gmsh.model.addPhysicalGroup(3, [tag for _, tag in volumes], name="tube")
            skin = gmsh.model.getBoundary(volumes, oriented=False)
            gmsh.model.addPhysicalGroup(2, [tag for _, tag in skin], name="skin")
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.setOrder(2)
            gmsh.write(str(path))
        return path


def bending_pairs(frequencies: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """(n, 2) Hz of the two modes nearest to each expected frequency: bending comes in pairs, torsion does not."""
    nearest = np.abs(frequencies[:, None] - expected).argsort(axis=0)[:2]
    return np.sort(frequencies[nearest.T], axis=1)


@case(
    "free tube in bending, 12 x 2 x 30 curved elements",
    "Timoshenko's theory with the shear coefficient of Hutchinson (2001)",
    "tests/validation/test_published_modes.py::test_tube_bends_in_pairs",
)
def tube() -> list[Figure]:
    hollow = Tube()
    expected = hollow.timoshenko(4)
    with tempfile.TemporaryDirectory() as folder:
        pairs = bending_pairs(hollow.frequencies(Path(folder), 12, 2, 30, 14), expected)
    return [
        Figure(f"bending mode {n}, Hz", float(theory), float(pair[0]), 5e-4)
        for n, (theory, pair) in enumerate(zip(expected, pairs, strict=True), 1)
    ]


CASES: tuple[Case, ...] = (fv31, fv32, sdls01, tube)
