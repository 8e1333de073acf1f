#!/usr/bin/env python3
"""Sets `fe-surface` beside MMG, MeshLab's isotropic remeshing and Open3D's quadric collapse, part by part, in one run.

    cargo build --release
    python3 examples/compare/remeshers.py --corpus meshes [--program target/release/meshmill] [--only fandisk,joint]

Prints the table of fe-surface.md. MMG gets our tolerance, our largest size and our feature angle: `hausd` 0.2 % of the
diagonal, `hmax` 4 %, 30 degrees; MeshLab the edge length that gives our number of faces, 5 iterations and 30 degrees;
Open3D, which cannot refine, our number of faces where that is fewer; all the part as it is. Every result is counted here:
stretch, the sampled distance both ways, edges that have not exactly two faces.

Seconds are those of the processor, everyone on one thread: for the others of the call alone, for us of the whole process
with reading, repair, gates and files. `times MMG` and `times MeshLab` are ours by theirs.
"""
import argparse
import json
import os
import resource
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
    """A row of the table and the number of faces."""
    import measures

    stretch, bad = shape(path)
    mesh, first = measures.load(str(path)), measures.load(str(original))
    far = max(measures.distance(measures.samples(mesh), first), measures.distance(measures.samples(first), mesh))
    cells = [part, name, len(stretch), f"{stretch.min():.4f}", f"{stretch.mean():.3f}", (stretch < 0.2).sum(),
             f"{100 * far / first.length:.3f}", bad, f"{cpu:.2f}"]
    return cells, len(stretch)


def peer(part, title, call, source, out, number):
    """A row of the table and the processor seconds of the call; no seconds where it fails."""
    done = subprocess.run([sys.executable, str(HERE / "peers.py"), *call, str(source), str(out), str(number)],
                          capture_output=True, text=True)
    if done.returncode:
        return [part, title, "fails"] + [""] * 6, None
    cpu = json.loads(done.stdout.strip().splitlines()[-1])["cpu"]
    return row(part, title, out, source, cpu)[0], cpu


def ours(program, source, folder):
    """Our result, or what failed its gates, and the processor seconds of the whole process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, "run", ROOT / "pipelines" / "fe-surface.toml", "--input", f"part={source}", "--jobs", "1",
                    "--quiet", "--pictures", "none", "--cache", folder / "cache", "--out", folder / "out"],
                   stderr=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    places = [folder / "out" / sub / "result.vtu" for sub in ("failed", ".")]
    return next((path for path in places if path.exists()), None), cpu


def compare(program, part, source, folder):
    """The rows of one part, ours first."""
    import measures

    made, cpu = ours(program, source, folder)
    if made is None:
        return [[part, "meshmill `fe-surface`", "fails"] + [""] * 5 + [f"{cpu:.2f}"]]
    first, faces = row(part, "meshmill `fe-surface`", made, source, cpu)
    original, out = measures.load(str(source)), folder / "peer.ply"
    edge = (original.area / faces * 4 / 3**0.5) ** 0.5
    mmg, by_mmg = peer(part, "MMG", ["mmg", "remesh"], source, out, 0.04 * original.length)
    lab, by_lab = peer(part, "MeshLab isotropic remeshing", ["pymeshlab", "remesh"], source, out, edge)
    rows = [first + [f"{cpu / theirs:.1f}" if theirs else "" for theirs in (by_mmg, by_lab)], mmg, lab]
    if faces < original.n_cells:
        rows.append(peer(part, "Open3D quadric collapse", ["open3d", "simplify"], source, out, faces)[0])
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    corpus = os.environ.get("MESHMILL_CORPUS")
    parser.add_argument("--corpus", type=Path, default=corpus, required=corpus is None)
    parser.add_argument("--program", type=Path, default=ROOT / "target" / "release" / "meshmill")
    parser.add_argument("--only", help="parts, with commas")
    arguments = parser.parse_args()

    head = ["part", "program", "faces", "min stretch", "mean stretch", "faces < 0.2", "distance %", "bad edges", "CPU s",
            "times MMG", "times MeshLab"]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for file in PARTS:
        part, source = Path(file).name, (arguments.corpus / file).resolve()
        if arguments.only and Path(file).stem not in arguments.only.split(","):
            continue
        with tempfile.TemporaryDirectory() as folder:
            for cells in compare(arguments.program.resolve(), part, source, Path(folder)):
                print("| " + " | ".join(map(str, cells + [""] * (len(head) - len(cells)))) + " |", flush=True)


if __name__ == "__main__":
    main()
