#!/usr/bin/env python3
"""Sets `simplify-fit` beside quadric collapse by Open3D, MeshLab and fast-simplification on filleted parts.

    python3 examples/compare/fillets.py --corpus meshes [--meshmill target/release/meshmill] [--only relay_shell,fandisk]

Prints the table of papers.md. Every result is counted here, by the same few lines: the share of faces with an aspect
ratio below 20 (longest side by the height on it, over that of the equilateral triangle), stretch, Euler characteristic.
Needs numpy, meshio and the peers of requirements.txt; a peer that is not installed is left out, and said so.
"""
import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import numpy

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
# Millimetres where the part is meant in them, as in the paper.
PARTS = {
    "relay_shell": ("cad/relay_shell.stl", "0.1"),
    "valve_cover": ("cad/valve_cover.stl", "0.1"),
    "phone_panel": ("cad/phone_panel.stl", "0.1%"),
    "casting_part": ("cad/casting_part.stl", "0.1%"),
    "hdd_cover": ("cad/hdd_cover.stl", "0.1%"),
    "pipe_tee": ("cad/pipe_tee.stl", "0.1%"),
    "fandisk": ("public/fandisk.obj", "0.1%"),
}
PEERS = {"Open3D": "open3d", "MeshLab": "pymeshlab", "fast-simplification": "fast-simplification"}


def load(path):
    """Corners joined by their coordinates, and the triangles that are left."""
    mesh = meshio.read(path)
    points, places = numpy.unique(numpy.asarray(mesh.points, dtype=float), axis=0, return_inverse=True)
    faces = places.reshape(-1)[numpy.vstack([cells.data for cells in mesh.cells if cells.type == "triangle"])]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return points, faces[whole]


def counted(path):
    points, faces = load(path)
    corners = points[faces]
    sides = numpy.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
    area = 0.5 * numpy.linalg.norm(numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = sides.max(1)
    stretch = 12**0.5 * area / numpy.maximum(0.5 * sides.sum(1) * longest, 1e-300)
    aspect = 3**0.5 / 2 * longest**2 / numpy.maximum(2 * area, 1e-300)
    edges = numpy.unique(numpy.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    return {"faces": len(faces), "below": float((aspect < 20).mean()), "mean": float(stretch.mean()),
            "least": float(stretch.min()), "euler": len(numpy.unique(faces)) - len(edges) + len(faces)}


def row(part, share, name, count, was, note):
    gone = 1 - count["faces"] / was
    print(f"| {part} | {share} | {name} | {count['faces']} | {100 * gone:.2f} % | {100 * count['below']:.2f} % "
          f"| {count['mean']:.3f} | {count['least']:.4f} | {count['euler']} | {note} |", flush=True)


def ours(arguments, source, share, tolerance, folder):
    """Runs the shipped pipeline; a gate that fails fails the run, and its files lie apart."""
    command = [str(arguments.meshmill), "run", str(ROOT / "pipelines" / "simplify-moulded.toml"), "--input",
               f"part={source}", "--set", f"remove={share}%", "--set", f"tolerance={tolerance}", "--out", str(folder),
               "--json", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=arguments.seconds)
    case = json.loads(done.stdout)["cases"][0]
    stats = next(step["stats"] for step in case["steps"] if step["name"] == "light")
    result = next(path for path in (folder / "result.stl", folder / "failed" / "result.stl") if path.exists())
    bound = stats.get("distance-bound")
    within = f"within {bound:.4g}" if bound is not None else "no bound"
    fits = f"{stats['vertices-on-fits']} vertices on fits"
    return counted(result), f"{stats['status']}, {within}, {fits}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", type=Path, required=True)
    parser.add_argument("--meshmill", type=Path, default=ROOT / "target" / "release" / "meshmill")
    parser.add_argument("--only", help="parts, with commas")
    parser.add_argument("--shares", default="50,75")
    parser.add_argument("--seconds", type=float, default=600, help="the longest that one run may take")
    parser.add_argument("--no-peers", action="store_true")
    arguments = parser.parse_args()
    wanted = arguments.only.split(",") if arguments.only else PARTS
    print("| part | asked | by | faces | gone | Ra < 20 | mean stretch | min stretch | chi | |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in wanted:
            file, tolerance = PARTS[part]
            source = (arguments.corpus / file).resolve()
            before = counted(source)
            row(part, "-", "as it was", before, before["faces"], "")
            for share in arguments.shares.split(","):
                target = int(before["faces"] * (1 - float(share) / 100) + 1e-6)
                try:
                    made, note = ours(arguments, source, share, tolerance, folder / f"{part}-{share}")
                    row(part, f"{share} %", "simplify-fit", made, before["faces"], note)
                except subprocess.TimeoutExpired:
                    print(f"| {part} | {share} % | simplify-fit | | | | | | | not done in {arguments.seconds:g} s |", flush=True)
                for title, peer in {} if arguments.no_peers else PEERS.items():
                    out = folder / f"{peer}.ply"
                    command = [sys.executable, HERE / "peers.py", peer, "simplify", source, out, str(target)]
                    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
                    if done.returncode:
                        sys.stderr.write(f"{title}: {done.stderr.strip().splitlines()[-1:]}\n")
                        continue
                    row(part, f"{share} %", title, counted(out), before["faces"], "")


if __name__ == "__main__":
    main()
