#!/usr/bin/env python3
"""Sets the meshes of `fe-surface` beside MeshLab's isotropic remeshing and Open3D's quadric collapse, part by part.

    MESHMILL_CORPUS=meshes cargo run --release --example acceptance
    python3 examples/compare/remeshers.py --corpus meshes [--results target/acceptance] [--only fandisk,joint]

Prints the table of fe-surface.md. MeshLab gets the edge length that gives our number of faces, 5 iterations, its feature
angle at ours, 30 degrees; Open3D, which cannot refine, our number of faces where that is fewer; both the part as it is. Every result is counted here: stretch, the
sampled distance both ways, edges that have not exactly two faces.
"""
import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE))
PARTS = [
    "public/rocker-arm.obj", "public/fandisk.obj", "public/joint.off", "cad/simple_part.stl", "cad/l_bracket.stl",
    "cad/pipe_tee.stl", "cad/casting_part.stl", "cad/crankshaft.stl", "cad/hdd_cover.stl", "cad/phone_panel.stl",
    "cad/valve_cover.stl", "cad/relay_shell.stl", "cad/textured_mouse.stl", "cad/vase_scan.stl",
    "public/i4_crankshaft.stl", "public/i4_cylinder_head.stl", "public/turbineblade.ply",
]


def shape(path):
    """Stretch of every face, and edges without exactly two faces."""
    import measures
    import numpy

    mesh = measures.load(str(path))
    points, faces = numpy.asarray(mesh.points, dtype=float), mesh.regular_faces
    corners = points[faces]
    sides = numpy.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
    area = 0.5 * numpy.linalg.norm(numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    stretch = 12**0.5 * area / numpy.maximum(0.5 * sides.sum(1) * sides.max(1), 1e-300)
    edges = numpy.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, times = numpy.unique(edges, axis=0, return_counts=True)
    return stretch, int((times != 2).sum())


def row(part, name, path, original, cpu):
    import measures

    stretch, bad = shape(path)
    mesh, first = measures.load(str(path)), measures.load(str(original))
    far = max(measures.distance(measures.samples(mesh), first), measures.distance(measures.samples(first), mesh))
    print(f"| {part} | {name} | {len(stretch)} | {stretch.min():.4f} | {stretch.mean():.3f} | {(stretch < 0.2).sum()} "
          f"| {100 * far / first.length:.3f} | {bad} | {cpu} |", flush=True)
    return len(stretch)


def peer(part, title, call, source, out, number):
    done = subprocess.run([sys.executable, str(HERE / "peers.py"), *call, str(source), str(out), str(number)],
                          capture_output=True, text=True)
    if done.returncode:
        print(f"| {part} | {title} | fails | | | | | | |", flush=True)
        return
    import json

    cpu = json.loads(done.stdout.strip().splitlines()[-1])["cpu"]
    row(part, title, out, source, f"{cpu:.1f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    corpus = os.environ.get("MESHMILL_CORPUS")
    parser.add_argument("--corpus", type=Path, default=corpus, required=corpus is None)
    parser.add_argument("--results", type=Path, default=ROOT / "target" / "acceptance")
    parser.add_argument("--only", help="parts, with commas")
    arguments = parser.parse_args()
    import measures

    print("| part | program | faces | min stretch | mean stretch | faces < 0.2 | distance % | bad edges | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for file in PARTS:
            part, source = Path(file).name, (arguments.corpus / file).resolve()
            if arguments.only and Path(file).stem not in arguments.only.split(","):
                continue
            places = [arguments.results / part / "out" / sub / "result.vtu" for sub in ("failed", ".")]
            made = next((path for path in places if path.exists()), None)
            if made is None:
                print(f"| {part} | meshmill | not run | | | | | | |", flush=True)
                continue
            faces = row(part, "meshmill `fe-surface`", made, source, "")
            edge = (measures.load(str(source)).area / faces * 4 / 3**0.5) ** 0.5
            out = Path(name) / "peer.ply"
            peer(part, "MeshLab isotropic remeshing", ["pymeshlab", "remesh"], source, out, edge)
            if faces < measures.load(str(source)).n_cells:
                peer(part, "Open3D quadric collapse", ["open3d", "simplify"], source, out, faces)


if __name__ == "__main__":
    main()
