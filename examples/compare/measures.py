"""What all results are measured with: VTK's cell quality, and sampled distances; nothing of meshmill's own."""
import hashlib

import numpy
import pyvista
from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator
from vtkmodules.vtkCommonCore import mutable

# Points that a distance is sampled at, each way.
SAMPLES = 60_000


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def load(path):
    """The triangles of a file, corners of equal coordinates joined."""
    mesh = pyvista.read(path).extract_surface(algorithm=None) if path.endswith(".vtu") else pyvista.read(path)
    return mesh.triangulate().clean(tolerance=0.0)


def sorted_triangles(path):
    """One row of nine coordinates a triangle, from its least corner on, in order."""
    mesh = load(path)
    corners = numpy.asarray(mesh.points)[mesh.regular_faces]
    order = numpy.lexsort((corners[..., 2], corners[..., 1], corners[..., 0]), axis=1)
    turned = (order[:, :1] + numpy.arange(3)) % 3
    rows = numpy.take_along_axis(corners, turned[:, :, None], axis=1).reshape(-1, 9)
    return rows[numpy.lexsort(rows.T[::-1])]


def samples(mesh):
    points = numpy.vstack([mesh.points, mesh.cell_centers().points])
    return points[:: max(1, len(points) // SAMPLES)]


def distance(points, mesh):
    """The largest distance of the points from the surface."""
    locator = vtkStaticCellLocator()
    locator.SetDataSet(mesh)
    locator.BuildLocator()
    near, cell, part, squared = [0.0] * 3, mutable(0), mutable(0), mutable(0.0)
    worst = 0.0
    for point in points:
        locator.FindClosestPoint(point, near, cell, part, squared)
        worst = max(worst, float(squared))
    return worst**0.5


def quality(path, original):
    """Counts, VTK's quality of the cells, and the sampled two-sided distance as a part of the diagonal."""
    mesh, first = load(path), load(original)
    names = ["radius_ratio", "min_angle", "scaled_jacobian"]
    cells = mesh.cell_quality(names)
    ratio, angle = cells["radius_ratio"], cells["min_angle"]
    edges = mesh.extract_feature_edges(
        boundary_edges=True, non_manifold_edges=True, feature_edges=False, manifold_edges=False)
    far = max(distance(samples(mesh), first), distance(samples(first), mesh))
    return {
        "faces": mesh.n_cells,
        "angle": float(angle.min()),
        "mean_angle": float(angle.mean()),
        "ratio": float(1.0 / ratio.max()) if ratio.max() > 0 else 0.0,
        "mean_ratio": float((1.0 / ratio).mean()),
        "slivers": int((angle < 7.0).sum()),
        "bad_edges": edges.n_cells,
        "distance": far / mesh.length,
    }
