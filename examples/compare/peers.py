"""One peer, one task, one process: `python peers.py PEER TASK IN OUT [NUMBER]`.

Prints one JSON line: CPU seconds of the call alone, without reading and writing, and the largest memory of the process.
All libraries get one thread.
"""
import json
import os
import resource
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "TBB_NUM_THREADS"):
    os.environ[name] = "1"


def timed(call):
    start = time.process_time()
    result = call()
    return result, time.process_time() - start


def open3d(task, source, target, number):
    import open3d

    mesh = open3d.io.read_triangle_mesh(source)
    mesh.remove_duplicated_vertices()
    if task == "simplify":
        result, cpu = timed(lambda: mesh.simplify_quadric_decimation(int(number)))
    elif task == "subdivide":
        result, cpu = timed(lambda: mesh.subdivide_midpoint(1))
    else:
        facts, cpu = timed(lambda: {
            "vertices": len(mesh.vertices),
            "faces": len(mesh.triangles),
            "closed": mesh.is_watertight() or not mesh.get_non_manifold_edges(allow_boundary_edges=False),
            "manifold": mesh.is_edge_manifold() and mesh.is_vertex_manifold(),
            "area": mesh.get_surface_area(),
            "volume": mesh.get_volume() if mesh.is_watertight() else None,
        })
        return facts, cpu
    # Coordinates with all digits: PLY keeps doubles.
    open3d.io.write_triangle_mesh(target, result, write_vertex_normals=False, write_vertex_colors=False)
    return {}, cpu


def pymeshlab(task, source, target, number):
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.load_new_mesh(source)
    meshes.meshing_remove_duplicate_vertices()
    if task == "simplify":
        _, cpu = timed(lambda: meshes.meshing_decimation_quadric_edge_collapse(
            targetfacenum=int(number), qualitythr=1.0, preservenormal=True, preservetopology=True, planarquadric=True))
    elif task == "remesh":
        edge = pymeshlab.PureValue(float(number))
        _, cpu = timed(lambda: meshes.meshing_isotropic_explicit_remeshing(iterations=5, targetlen=edge))
    else:
        def measure():
            shape = meshes.get_geometric_measures()
            kind = meshes.get_topological_measures()
            closed = kind["boundary_edges"] == 0
            return {
                "vertices": meshes.current_mesh().vertex_number(),
                "faces": meshes.current_mesh().face_number(),
                "closed": closed,
                "manifold": kind["non_two_manifold_edges"] == 0 and kind["non_two_manifold_vertices"] == 0,
                "area": shape["surface_area"],
                "volume": shape.get("mesh_volume") if closed else None,
            }
        return timed(measure)
    meshes.save_current_mesh(target, save_vertex_normal=False, save_face_color=False, save_vertex_color=False)
    return {}, cpu


def mmg(task, source, target, number):
    """MMG's surface remesher: 0.2 % of the diagonal off at most, edges of `number` at most, sharp from 30 degrees on."""
    import mmgpy
    import numpy
    import pyvista

    mesh = pyvista.read(source).clean(tolerance=0.0)
    points, faces = numpy.asarray(mesh.points, dtype=float), numpy.asarray(mesh.regular_faces, dtype=numpy.int32)
    made = mmgpy.MmgMeshS()

    def remesh():
        made.set_mesh_size(vertices=len(points), triangles=len(faces))
        made.set_vertices(points)
        made.set_triangles(faces)
        made.remesh(hausd=0.002 * mesh.length, hmax=float(number), hgrad=1.3, angle=30, verbose=-1)

    _, cpu = timed(remesh)
    pyvista.PolyData.from_regular_faces(made.get_vertices(), made.get_triangles()).save(target)
    return {}, cpu


def fast_simplification(task, source, target, number):
    import fast_simplification
    import numpy
    import pyvista

    mesh = pyvista.read(source).clean(tolerance=0.0)
    faces = mesh.regular_faces
    points = numpy.asarray(mesh.points, dtype=numpy.float64)
    (points, faces), cpu = timed(lambda: fast_simplification.simplify(points, faces, target_count=int(number)))
    pyvista.PolyData.from_regular_faces(points, faces).save(target)
    return {}, cpu


def main():
    peer, task, source, target, number = (sys.argv[1:] + [""])[:5]
    facts, cpu = {"open3d": open3d, "pymeshlab": pymeshlab, "mmg": mmg, "fast-simplification": fast_simplification}[peer](
        task, source, target, number)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(json.dumps({"cpu": cpu, "peak": peak, **facts}))


if __name__ == "__main__":
    main()
