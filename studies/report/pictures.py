"""Pictures of mode shapes, rendered off-screen, and mode shapes for ParaView."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vanedamp.files.interrupts import uninterrupted
from vanedamp.files.store import load, replacing
from vanedamp.studies.report.mode_chart import viewpoint
from vanedamp.studies.report.response_curves import RELATIVE
from vanedamp.studies.workers import run_module

if TYPE_CHECKING:
    from vanedamp.modal.eigen import Modes
    from vanedamp.studies.report.forced_response import ForcedResponse

#: largest displacement in a picture, as a share of the structure's size
_EXAGGERATION = 0.06


def mode_picture(modes_file: str | Path, mode: int) -> bytes | None:
    """Return the PNG of a mode in a file of `vanedamp modal`: deformed, coloured by displacement.

    None where no picture can be rendered. VTK has a process of its own: it aborts without a graphics library, and its
    C++ library does not get on with those of the finite elements.
    """
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "mode.png"
        # what VTK complains of need not be text
        finished = run_module(
            "vanedamp.studies.report.pictures", str(modes_file), str(mode), str(picture), errors="replace"
        )
        return picture.read_bytes() if finished.returncode == 0 else None


def summary_picture(mode_png: bytes | None, response: ForcedResponse, path: Path) -> None:
    """Write a PNG of the mode beside the forced response: undamped, with bodies, with the bodies fixed."""
    from matplotlib.image import imread

    from vanedamp.studies.figures import GREY, draw_grid, save, subplots

    figure, (left, right) = subplots(1, 2, size=(12, 4.6), width_ratios=[1, 1.25])
    left.axis("off")
    if mode_png is not None:
        left.imshow(imread(io.BytesIO(mode_png)))
        left.set_title("first bending mode of the cluster", fontsize=11)
    curves: list[tuple[np.ndarray, str, dict[str, Any]]] = [
        (response.undamped, "without bodies", {"color": GREY, "linestyle": ":"}),
        (response.fixed, "bodies fixed", {"color": GREY, "linestyle": "--"}),
        (response.damped_max, "loose bodies, maximum", {"color": "#9fc1ea", "marker": ".", "linewidth": 0.8}),
        (response.damped_mean, "loose bodies, mean of peaks", {"color": "#1f5fa8", "linewidth": 2.0}),
    ]
    for amplitude, label, look in curves:
        right.plot(response.x, amplitude / response.reference, label=label, **look)
    right.set_xlabel("excitation frequency, Hz")
    right.set_ylabel(RELATIVE)
    right.set_title(f"forced response, {response.name}", fontsize=11)
    right.set_ylim(bottom=0.0)
    draw_grid(right)
    right.legend(frameon=False)
    save(figure, path, dpi=110)


def save_vtk(modes: Modes, coordinates: np.ndarray, cells: np.ndarray, cell_type: int, path: str | Path) -> None:
    """Write all mode shapes as point data on their mesh (.vtu or .vtk, for ParaView)."""
    with uninterrupted():  # an interrupt within VTK may crash the process as it ends
        grid = _grid(coordinates, cells, cell_type)
        for number, (frequency, shape) in enumerate(zip(modes.frequencies_hz, modes.shapes, strict=True), start=1):
            grid.point_data[f"mode {number}: {frequency:.6g} Hz"] = shape.reshape(-1, 3)
        content = _vtk_bytes(grid, xml=Path(path).suffix == ".vtu")
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _vtk_bytes(grid: Any, xml: bool) -> bytes:
    """Return the content of a .vtu (xml) or .vtk file; VTK's writers end the process on a full disk, or are silent."""
    from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer: Any = vtkXMLUnstructuredGridWriter() if xml else vtkUnstructuredGridWriter()
    writer.SetInputDataObject(grid)
    writer.SetWriteToOutputString(True)
    if xml:
        writer.SetDataModeToBinary()
    else:
        writer.SetFileTypeToBinary()
    writer.Write()
    content = writer.GetOutputString() if xml else writer.GetOutputStdString()
    # VTK gives text where the bytes are some
    return content if isinstance(content, bytes) else content.encode()


def _grid(coordinates: np.ndarray, cells: np.ndarray, cell_type: int) -> Any:
    import pyvista

    lines = np.column_stack([np.full(len(cells), cells.shape[1]), cells])
    return pyvista.UnstructuredGrid(lines.ravel(), np.full(len(cells), cell_type, np.uint8), coordinates)


def _render(modes_file: str, mode: int, picture: str) -> None:
    import pyvista

    values, attributes = load(modes_file, "modes")
    grid = _grid(values["coordinates"], values["cell"], attributes["vtk_cell_type"])
    shape = values["shape"][mode].reshape(-1, 3)
    magnitude = np.linalg.norm(shape, axis=1)
    grid.point_data["shape"] = shape / magnitude.max()
    title = "displacement / largest displacement"
    grid.point_data[title] = magnitude / magnitude.max()
    surface = grid.extract_surface(nonlinear_subdivision=1)
    moved = surface.warp_by_vector("shape", factor=_EXAGGERATION * grid.length)
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=[1500, 900])
    plotter.set_background("white")
    plotter.add_mesh(surface.extract_feature_edges(30), color="#9aa0a6", line_width=1.5)
    bar = {
        "title": " ", "color": "black", "label_font_size": 24, "n_labels": 5, "fmt": "%.2f",
        "vertical": False, "width": 0.5, "height": 0.07, "position_x": 0.25, "position_y": 0.01,
    }  # fmt: skip
    look = {"cmap": "viridis", "clim": [0, 1], "ambient": 0.3, "smooth_shading": True, "split_sharp_edges": True}
    plotter.add_mesh(moved, scalars=title, scalar_bar_args=bar, **look)
    plotter.add_text(title, position=(0.33, 0.09), viewport=True, font_size=14, color="black")
    plotter.add_axes(color="black", line_width=4)
    plotter.view_vector(viewpoint(values["coordinates"], shape), viewup=(0.0, 0.0, 1.0))
    plotter.camera.zoom(1.2)
    # the colour bar takes the lower edge
    plotter.camera.SetWindowCenter(0.0, -0.08)
    plotter.screenshot(picture)
    plotter.close()


if __name__ == "__main__":
    _render(sys.argv[1], int(sys.argv[2]), sys.argv[3])
