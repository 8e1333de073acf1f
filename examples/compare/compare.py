#!/usr/bin/env python3
"""Sets meshmill beside Open3D, MeshLab and fast-simplification on the same inputs, and writes comparison.md.

    python3 examples/compare/compare.py                   all tables; wants more meshes, see --corpus
    python3 examples/compare/compare.py --small           shipped and generated meshes only: a check for CI

Makes a virtual environment with the pinned peers beside the build (target/compare), runs everything in alternating order
on one thread, and sets down medians of CPU seconds. A peer's time is that of its call alone; meshmill's is that of a
whole process that reads a repaired mesh from its cache, runs the step, and writes the result. Every result is measured
with VTK. What disagrees is an error.
"""
import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
from pathlib import Path

import environment

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
WORK = ROOT / "target" / "compare"
SOURCES = {
    "crankshaft_scan.stl": "own work, a scan simulated by marching cubes",
    "skull.obj": "odedstein/meshes, objects/skull, CC BY 3.0",
    "l_bracket.stl": "own work, shipped in examples/meshes",
    "pipe_tee.stl": "own work, shipped in examples/meshes",
}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", action="store_true", help="shipped and generated meshes, one run each")
    parser.add_argument("--repeat", type=int, default=3, help="runs of which the median counts (default 3)")
    parser.add_argument("--meshmill", type=Path, default=ROOT / "target" / "release" / "meshmill")
    parser.add_argument("--corpus", type=Path, default=os.environ.get("MESHMILL_CORPUS"),
                        help="folder with cad/crankshaft_scan.stl and public/skull.obj (default: MESHMILL_CORPUS)")
    parser.add_argument("--out", type=Path, help="default: comparison.md beside this script; --small: only printed")
    parser.add_argument("--only", nargs="*", help="tables: agreement, subdivision, simplify, remesh, growth")
    return parser.parse_args()


def enter_environment():
    """Goes on in the virtual environment with the peers."""
    home = os.environ.get("MESHMILL_COMPARE_VENV", WORK / "venv")
    installs = [["-r", str(HERE / "requirements.txt")]]
    environment.enter(home, installs, "open3d, pymeshlab, fast_simplification", may_skip="--small" in sys.argv)


def peer(name, task, source, target, number=""):
    """Runs a peer in a process of its own."""
    command = [sys.executable, str(HERE / "peers.py"), name, task, str(source), str(target), str(number)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.strip().splitlines()[-1])


class Meshmill:
    """Runs meshmill, one recipe a task, with a cache of its own that is filled with the repaired inputs first."""

    def __init__(self, binary):
        if not binary.exists():
            sys.exit(f"{binary} is not there: run `cargo build --release`, or give --meshmill")
        self.binary = str(binary)

    def run(self, source, target, steps, warm=True):
        """CPU seconds and peak memory of the last step with reading from the cache and writing."""
        recipe = WORK / f"{target.stem}.toml"
        head = ['name = "compare"', "[steps.raw]", 'use = "read"', f'file = "{source}"',
                "[steps.clean]", 'use = "repair"', 'from = "raw"', "[steps.last]", 'from = "clean"', *steps,
                "[outputs]", f'last = ["{target.name}"]']
        recipe.write_text("\n".join(head) + "\n")
        cache = WORK / "cache"
        base = [self.binary, "--quiet", "--cache", str(cache), "run", str(recipe), "--jobs", "1",
                "--out", str(target.parent)]
        subprocess.run([self.binary, "cache", "clear", "--cache", str(cache)], capture_output=True)
        if warm:
            subprocess.run([*base, "--only", "clean"], check=True, capture_output=True)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        # The child's own peak: the parent's figure is the largest of all children so far.
        timed = ["/usr/bin/time", "-f", "%M", *base] if Path("/usr/bin/time").exists() else base
        done = subprocess.run(timed, check=True, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        peak = int(done.stderr.strip().splitlines()[-1]) // 1024 if timed is not base else 0
        return {"cpu": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, "peak": peak}

    def measure(self, source):
        done = subprocess.run([self.binary, "measure", str(source), "--json"], capture_output=True, text=True, check=True)
        values = json.loads(done.stdout)["metrics"]
        return {"vertices": values["vertices"], "faces": values["faces"], "closed": values["closed"],
                "manifold": values["manifold"], "area": values["area"],
                "volume": values["volume"] if values["closed"] else None}


def alternate(rivals, repeat):
    """Runs the rivals in turn, `repeat` times; medians of time and largest memory by name."""
    runs = {name: [] for name in rivals}
    for turn in range(repeat):
        order = list(rivals) if turn % 2 == 0 else list(rivals)[::-1]
        for name in order:
            runs[name].append(rivals[name]())
    return {name: {"cpu": statistics.median(r["cpu"] for r in done), "peak": max(r["peak"] for r in done)}
            for name, done in runs.items()}


def torus(quads):
    """Writes a closed torus of `4 quads²` triangles as OBJ; returns its file."""
    import numpy

    path = WORK / f"torus_{4 * quads * quads}.obj"
    along, around = numpy.meshgrid(numpy.arange(2 * quads), numpy.arange(quads), indexing="ij")
    u, v = numpy.pi * along / quads, 2 * numpy.pi * around / quads
    radius = 3 + numpy.cos(v) + 0.05 * numpy.sin(9 * u) * numpy.cos(4 * v)
    points = numpy.stack([radius * numpy.cos(u), radius * numpy.sin(u), numpy.sin(v)], -1).reshape(-1, 3)
    place = lambda i, j: (i % (2 * quads)) * quads + j % quads
    a, b = place(along, around), place(along + 1, around)
    c, d = place(along + 1, around + 1), place(along, around + 1)
    faces = numpy.concatenate([numpy.stack(t, -1).reshape(-1, 3) for t in ([a, b, c], [a, c, d])])
    with open(path, "w") as file:
        numpy.savetxt(file, points, fmt="v %.17g %.17g %.17g")
        numpy.savetxt(file, faces + 1, fmt="f %d %d %d")
    return path


def agreement(meshmill, meshes):
    """Counts, flags, area and volume by three programs; they must agree. Open3D tests every pair of faces for
    intersections before it calls a mesh closed, so the meshes are small."""
    lines = ["| mesh | program | vertices | faces | closed | manifold | area | volume |", "|---|---|---|---|---|---|---|---|"]
    for mesh in meshes:
        facts = {"meshmill": meshmill.measure(mesh), "Open3D": peer("open3d", "measure", mesh, "-"),
                 "MeshLab": peer("pymeshlab", "measure", mesh, "-")}
        ours = facts["meshmill"]
        for name, fact in facts.items():
            exact = all(fact[k] == ours[k] for k in ("vertices", "faces", "closed", "manifold"))
            close = lambda k: fact[k] is None or abs(fact[k] - ours[k]) <= 1e-5 * abs(ours[k])
            if not (exact and close("area") and close("volume")):
                sys.exit(f"DISAGREEMENT on {mesh}: {name} {fact}, meshmill {ours}")
            volume = "-" if fact["volume"] is None else f"{fact['volume']:.6g}"
            lines.append(f"| {mesh.name} | {name} | {fact['vertices']} | {fact['faces']} | {fact['closed']} "
                         f"| {fact['manifold']} | {fact['area']:.6g} | {volume} |")
    return lines


def subdivision(meshmill, mesh, repeat):
    """1-to-4 subdivision by Open3D and by meshmill: the same vertices and the same triangles."""
    import numpy
    import measures

    theirs, ours = WORK / "subdivided_open3d.ply", WORK / "subdivided_meshmill.ply"
    # Doubles as they are: text is not read alike to the last bit.
    exact = WORK / "subdivide.ply"
    subprocess.run([meshmill.binary, "convert", str(mesh), str(exact)], check=True, capture_output=True)
    times = alternate({
        "Open3D `subdivide_midpoint`": lambda: peer("open3d", "subdivide", exact, theirs),
        "meshmill `subdivide`": lambda: meshmill.run(exact, ours, ['use = "subdivide"']),
    }, repeat)
    left, right = measures.sorted_triangles(str(theirs)), measures.sorted_triangles(str(ours))
    if left.shape != right.shape or not numpy.array_equal(left, right):
        sys.exit(f"DISAGREEMENT: subdivisions of {mesh} differ")
    lines = [f"{mesh.name}: {len(left)} triangles, equal corner for corner.", "", "| program | CPU s | peak MB |", "|---|---|---|"]
    return lines + [f"| {name} | {t['cpu']:.2f} | {t['peak']} |" for name, t in times.items()]


HEAD = ["| program | CPU s | times meshmill | peak MB | faces | min angle | mean min angle | radius ratio min | mean "
        "| faces < 7° | bad edges | distance / diagonal |", "|---|---|---|---|---|---|---|---|---|---|---|---|"]


def rows(times, results, original):
    import measures

    ours = next(t["cpu"] for name, t in times.items() if name.startswith("meshmill"))
    for name, t in times.items():
        q = measures.quality(str(results[name]), str(original))
        yield (f"| {name} | {t['cpu']:.2f} | {t['cpu'] / ours:.1f} | {t['peak']} | {q['faces']} | {q['angle']:.2f} "
               f"| {q['mean_angle']:.1f} | {q['ratio']:.3f} | {q['mean_ratio']:.3f} | {q['slivers']} "
               f"| {q['bad_edges']} | {q['distance']:.2e} |")


def simplify(meshmill, mesh, faces, repeat):
    """Quadric simplification to a number of faces."""
    out = {name: WORK / f"simplified_{place}.ply" for place, name in enumerate((
        "Open3D `simplify_quadric_decimation`", "MeshLab quadric collapse, quality 1",
        "fast-simplification (checks nothing)", "meshmill `control-properties`, `quadric-rms`"))}
    files = list(out.values())
    steps = ['use = "control-properties"', 'tolerance-mode = "quadric-rms"', 'tolerance = "0.2%"', f"target-faces = {faces}"]
    calls = (lambda: peer("open3d", "simplify", mesh, files[0], faces),
             lambda: peer("pymeshlab", "simplify", mesh, files[1], faces),
             lambda: peer("fast-simplification", "simplify", mesh, files[2], faces),
             lambda: meshmill.run(mesh, files[3], steps))
    times = alternate(dict(zip(out, calls)), repeat)
    return [f"{mesh.name} to {faces} faces.", "", *HEAD, *rows(times, out, mesh)]


def remesh(meshmill, mesh, faces, repeat):
    """Remeshing to a number of faces: the peer by edge length, meshmill within 0.2 % of the diagonal."""
    import measures

    area = measures.load(str(mesh)).area
    edge = (area / faces * 4 / 3**0.5) ** 0.5
    out = {"MeshLab isotropic remeshing, 5 iterations": WORK / "remeshed_meshlab.ply",
           "meshmill `control-properties`, `distance`, `optimize`": WORK / "remeshed_meshmill.ply"}
    files = list(out.values())
    steps = ['use = "control-properties"', 'tolerance = "0.2%"', "optimize = true", f"target-faces = {faces}"]
    calls = (lambda: peer("pymeshlab", "remesh", mesh, files[0], edge), lambda: meshmill.run(mesh, files[1], steps))
    times = alternate(dict(zip(out, calls)), repeat)
    return [f"{mesh.name} to about {faces} faces.", "", *HEAD, *rows(times, out, mesh)]


def growth(meshmill, sizes, repeat):
    """Time over the number of faces, at the same share left."""
    from math import log2

    lines = ["| faces | left | CPU s | ns a face and level (n log n) | peak MB |", "|---|---|---|---|---|"]
    for quads in sizes:
        mesh, count = torus(quads), 4 * quads * quads
        steps = ['use = "control-properties"', 'tolerance-mode = "quadric-rms"', 'tolerance = "1%"',
                 f"target-faces = {count // 20}"]
        target = WORK / f"grown_{count}.ply"
        time = alternate({"meshmill": lambda: meshmill.run(mesh, target, steps)}, repeat)["meshmill"]
        lines.append(f"| {count} | {count // 20} | {time['cpu']:.2f} | {1e9 * time['cpu'] / (count * log2(count)):.0f} "
                     f"| {time['peak']} |")
    return lines


def version(binary):
    return subprocess.run([str(binary), "--version"], capture_output=True, text=True).stdout.strip()


def main():
    args = arguments()
    enter_environment()
    sys.path.insert(0, str(HERE))
    import measures

    WORK.mkdir(parents=True, exist_ok=True)
    meshmill = Meshmill(args.meshmill.resolve())
    shipped = ROOT / "examples" / "meshes"
    repeat = 1 if args.small else args.repeat
    small = torus(60)
    tables = {
        "agreement": ("Do they read the same mesh?", lambda: agreement(meshmill, [shipped / "l_bracket.stl", shipped / "pipe_tee.stl", small])),
        "subdivision": ("1-to-4 subdivision", lambda: subdivision(meshmill, subdivided, repeat)),
        "simplify": ("Simplification by quadrics", lambda: simplify(meshmill, large[0], target, repeat)),
        "remesh": ("Better elements within a distance", lambda: remesh(meshmill, large[-1], 20_000 if not args.small else 4_000, repeat)),
        "growth": ("Growth with the size of the input", lambda: growth(meshmill, (125, 250, 500) if not args.small else (40, 80), repeat)),
    }
    if args.small:
        large, target, subdivided = [small], 2_000, shipped / "pipe_tee.stl"
    else:
        if not args.corpus:
            sys.exit("give --corpus, or --small for shipped and generated meshes only")
        large, target = [args.corpus / "cad" / "crankshaft_scan.stl", args.corpus / "public" / "skull.obj"], 50_000
        subdivided = large[1]
    lines = ["# Beside other programs", "", "Written by `python3 examples/compare/compare.py`; do not edit.", "",
             f"{version(args.meshmill)}, {platform.machine()}, Python {platform.python_version()}; "
             + "; ".join(l for l in (HERE / "requirements.txt").read_text().split("\n") if "==" in l) + ".",
             f"One thread. CPU seconds, {'one run' if repeat == 1 else f'the median of {repeat}'}. A peer's time is that of its call alone; meshmill's is "
             "that of a whole process, with reading the repaired mesh from the cache and writing the result.",
             "Quality by VTK (`radius_ratio` inverted: 1 is best); distance sampled both ways, so a lower bound; bad "
             "edges are those without exactly two faces."]
    for name, (title, run) in tables.items():
        if args.only and name not in args.only:
            continue
        print(f"{name} ...", flush=True)
        lines += ["", f"## {title}", "", *run()]
    lines += ["", "## The meshes", "", "| mesh | source | sha256 |", "|---|---|---|"]
    for mesh in dict.fromkeys([*large, small, shipped / "l_bracket.stl", shipped / "pipe_tee.stl", subdivided]):
        lines.append(f"| {mesh.name} | {SOURCES.get(mesh.name, 'generated by compare.py')} | `{measures.sha256(mesh)}` |")
    text = "\n".join(lines) + "\n"
    target = args.out or (None if args.small else HERE / "comparison.md")
    if target:
        target.write_text(text)
        print(f"wrote {target}")
    else:
        print(text)


if __name__ == "__main__":
    main()
