#!/usr/bin/env python3
"""Sets `repair` beside pymeshfix, Manifold, Open3D and MeshLab on every mesh of some folders, and prints repair.md's tables.

    cargo build --release
    python3 examples/compare/repair.py --corpus meshes [--folders dirty,public] [--most-faces 100000] [--program PATH]

Wants numpy, open3d, trimesh and of pymeshfix, manifold3d and pymeshlab those that are to be compared (pip install); what does
not load is said and left out. All read the same OFF file, with corners at one place joined, and write one.

Solved is a result that is closed, manifold and oriented, has no two faces that cross or overlap, and has lost nothing: no
sample of the input that a ray finds outside of the result lies farther than half a percent of the diagonal from it. The
first four are counted by `meshmill measure`, exactly. Distances are sampled, in single precision (to a ten-thousandth or so),
in percent of the diagonal: of the input from the result, where what lies inside of it does not count, and of the result
from the input, where what fills holes does. Seconds are those of the processor, for the others of the call alone, for us of the whole process.
"""
import argparse
import json
import os
import resource
import select
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
FOLDERS = "dirty,public,printer,parts"
ENDINGS = {".stl", ".obj", ".ply", ".off"}
SAMPLES = 40_000
SECONDS = 60
LOST = 0.005


def pymeshfix(points, faces):
    import pymeshfix

    fixed = pymeshfix.MeshFix(points, faces)
    fixed.repair(joincomp=False, remove_smallest_components=False)
    return fixed.points, fixed.faces


def manifold3d(points, faces):
    import manifold3d
    import numpy

    mesh = manifold3d.Mesh64(vert_properties=points, tri_verts=faces.astype(numpy.uint64))
    mesh.merge()
    whole = manifold3d.Manifold(mesh)
    if whole.status() != manifold3d.Error.NoError:
        raise ValueError(str(whole.status()))
    united = manifold3d.Manifold.batch_boolean(whole.decompose(), manifold3d.OpType.Add).to_mesh64()
    return united.vert_properties[:, :3], united.tri_verts


def open3d(points, faces):
    import numpy
    import open3d

    mesh = open3d.geometry.TriangleMesh(open3d.utility.Vector3dVector(points), open3d.utility.Vector3iVector(faces))
    mesh.remove_duplicated_triangles()
    mesh.remove_degenerate_triangles()
    mesh.remove_non_manifold_edges()
    mesh.orient_triangles()
    if mesh.is_edge_manifold(allow_boundary_edges=False):
        return numpy.array(mesh.vertices), numpy.array(mesh.triangles)
    filled = open3d.t.geometry.TriangleMesh.from_legacy(mesh).fill_holes()
    return filled.vertex.positions.numpy().copy(), filled.triangle.indices.numpy().astype(numpy.int64)


def pymeshlab(points, faces):
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(points, faces))
    meshes.meshing_remove_duplicate_faces()
    meshes.meshing_remove_null_faces()
    meshes.compute_selection_by_self_intersections_per_face()
    meshes.meshing_remove_selected_faces()
    meshes.meshing_repair_non_manifold_edges()
    meshes.meshing_repair_non_manifold_vertices()
    meshes.meshing_close_holes(maxholesize=100_000)
    meshes.meshing_re_orient_faces_coherently()
    return meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix()


PEERS = {"pymeshfix": pymeshfix, "Manifold": manifold3d, "Open3D": open3d, "MeshLab": pymeshlab}


def read_off(path):
    """Points and triangles of an OFF file, corners at one place joined."""
    import numpy

    with open(path) as file:
        words = [line.split("#")[0] for line in file]
    head, *rest = [line for line in words if line.strip()]
    rest = rest if head.strip() == "OFF" else [head.replace("OFF", ""), *rest]
    vertices, count = (int(word) for word in rest[0].split()[:2])
    points = numpy.array([line.split()[:3] for line in rest[1:1 + vertices]], dtype=float)
    faces = []
    for line in rest[1 + vertices:1 + vertices + count]:
        size, *corners = (int(word) for word in line.split()[:5])
        faces += [[corners[0], corners[k], corners[k + 1]] for k in range(1, min(size, len(corners)) - 1)]
    points, numbers = numpy.unique(points, axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[numpy.array(faces, dtype=numpy.int64).reshape(-1, 3)]
    kept = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return points, faces[kept].astype(numpy.int32)


def write_off(path, points, faces):
    with open(path, "w") as file:
        file.write(f"OFF\n{len(points)} {len(faces)} 0\n")
        file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        file.writelines(f"3 {a} {b} {c}\n" for a, b, c in faces.tolist())


def work(name):
    """Repairs the files named on standard input, one after the other, and tells the seconds of each."""
    import time

    PEERS[name](*cube())
    print("ready", flush=True)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        source, target = line.rstrip("\n").split("\t")
        points, faces = read_off(source)
        start = time.process_time()
        try:
            made = PEERS[name](points, faces)
            cpu = time.process_time() - start
            if len(made[1]) and not (0 <= made[1].min() <= made[1].max() < len(made[0]) and abs(made[0]).max() < 1e30):
                raise ValueError("faces name corners that are not there")
            write_off(target, *made)
            answer = {"cpu": cpu}
        except Exception as error:
            answer = {"cpu": time.process_time() - start, "error": str(error)}
        print(json.dumps(answer), file=answers, flush=True)


def cube():
    import numpy

    points = numpy.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return points, numpy.array([[q[0], *q[k:k + 2]] for q in quads for k in (1, 2)], dtype=numpy.int32)


class Worker:
    """A process of a peer, started again where it ended."""

    def __init__(self, name):
        self.name, self.process = name, None
        self.start()

    def start(self):
        command = [sys.executable, __file__, "--work", self.name]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                        text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
        return self.process.stdout.readline().strip() == "ready"

    def repair(self, source, target):
        """The seconds, or None where the peer gave no result in time."""
        if self.process.poll() is not None:
            self.start()
        try:
            self.process.stdin.write(f"{source}\t{target}\n")
            self.process.stdin.flush()
            answer = json.loads(self.process.stdout.readline()) if self.answers() else {"cpu": SECONDS, "error": "time"}
        except (BrokenPipeError, json.JSONDecodeError):
            answer = {"cpu": 0.0, "error": "it crashed"}
        if answer.get("error") in ("time", "it crashed"):
            self.process.kill()
            self.process.wait()
        return answer

    def answers(self):
        return bool(select.select([self.process.stdout], [], [], SECONDS)[0])


def ours(program, source, target, folder):
    """The seconds of `pipelines/repair.toml`; its result, whether its gates held or not, goes to the target."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, "run", ROOT / "pipelines" / "repair.toml", "--input", f"part={source}", "--set", "joints=cut",
                    "--jobs", "1", "--quiet", "--pictures", "none", "--cache", folder / "cache", "--out", folder / "out"],
                   stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    made = next((path for sub in ("failed", ".") if (path := folder / "out" / sub / "result.vtu").exists()), None)
    if made is None:
        return {"cpu": cpu, "error": "no result"}
    subprocess.run([program, "convert", made, target], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    return {"cpu": cpu}


def counted(program, path):
    """What `meshmill measure` counts."""
    told = subprocess.run([program, "measure", path, "--json"], capture_output=True, text=True)
    text = json.loads(told.stdout) if told.returncode == 0 else {}
    values = text.get("metrics", text).get("values", text.get("metrics", text)) if text else {}
    return values


def scene(points, faces):
    import open3d as library

    made = library.t.geometry.RaycastingScene()
    made.add_triangles(library.core.Tensor(points.astype("float32")), library.core.Tensor(faces.astype("uint32")))
    return made


def samples(points, faces):
    import numpy

    middles = points[faces].mean(axis=1)
    every = numpy.vstack([points[numpy.unique(faces)], middles])
    return every[:: max(1, len(every) // SAMPLES)].astype("float32")


def distances(first, made):
    """Of the input from the result but for what is inside of it, and of the result from the input; of the diagonal."""
    import numpy

    low, high = first[0].min(axis=0), first[0].max(axis=0)
    size = numpy.linalg.norm(high - low)
    first, made = [((points - low) / size, faces) for points, faces in (first, made)]
    target, points = scene(*made), samples(*first)
    away = target.compute_distance(points).numpy()
    far = away > 1e-5
    if far.any():
        away[far] *= target.compute_occupancy(points[far], nsamples=3).numpy() == 0
    back = scene(*first).compute_distance(samples(*made)).numpy()
    return float(away.max()), float(back.max())


def judged(program, first, target, answer):
    """A result with what is known of it."""
    if "error" in answer or not target.exists():
        return answer
    made = read_off(target)
    if len(made[1]) == 0:
        return {**answer, "error": "nothing is left"}
    values = counted(program, target)
    answer["sound"] = all(values.get(name) in (True, 1) for name in ("closed", "manifold", "oriented"))
    answer["crossings"] = values.get("self-intersections")
    answer["lost"], answer["added"] = distances(first, made)
    answer["solved"] = answer["sound"] and answer["crossings"] == 0 and answer["lost"] <= LOST
    return answer


def table(results, title):
    print(f"\n## {title}\n")
    print("| program | meshes | results | closed, manifold, oriented | and nothing crosses | and nothing lost | "
          "lost, median and 95 % | added, median | CPU s |\n|" + "---|" * 9)
    for name, answers in results.items():
        made = [a for a in answers if "sound" in a]
        sound = [a for a in made if a["sound"]]
        simple = [a for a in sound if a["crossings"] == 0]
        solved = [a for a in simple if a["solved"]]

        def share(some):
            return f"{len(some)} ({100 * len(some) / max(1, len(answers)):.0f} %)"

        lost, added = (sorted(a[key] for a in made) or [0.0] for key in ("lost", "added"))
        percent = [f"{100 * lost[len(lost) // 2]:.5f}", f"{100 * lost[int(0.95 * (len(lost) - 1))]:.3f}"]
        print(f"| {name} | {len(answers)} | {len(made)} | {share(sound)} | {share(simple)} | {share(solved)} | "
              f"{percent[0]}, {percent[1]} | {100 * added[len(added) // 2]:.5f} | {sum(a['cpu'] for a in answers):.0f} |")


def compare(program, files, most):
    workers = {name: Worker(name) for name in PEERS}
    for name in [name for name, worker in workers.items() if worker.process.poll() is not None]:
        print(f"{name} does not load here and is left out.")
        del workers[name]
    results = {name: [] for name in ("meshmill", *workers)}
    hard = {name: [] for name in results}
    with tempfile.TemporaryDirectory() as place:
        for number, file in enumerate(files):
            folder = Path(place) / str(number)
            folder.mkdir()
            source = folder / "input.off"
            read = subprocess.run([program, "convert", file, source], capture_output=True)
            first = read_off(source) if read.returncode == 0 else ([], [])
            if not 0 < len(first[1]) <= most:
                print(f"Left out: {file.name} ({len(first[1])} faces).", flush=True)
                continue
            before = counted(program, source)
            is_hard = not (before.get("closed") and before.get("self-intersections") == 0)
            for name in results:
                target = folder / f"{name}.off"
                answer = ours(program, source, target, folder) if name == "meshmill" else workers[name].repair(source, target)
                answer = judged(program, first, target, answer)
                results[name].append(answer)
                if is_hard:
                    hard[name].append(answer)
                print(f"{number} {file.name} {name} {answer}", file=sys.stderr, flush=True)
    table(results, "All meshes")
    table(hard, "Those that were open or ran through themselves")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    corpus = os.environ.get("MESHMILL_CORPUS")
    parser.add_argument("--work", choices=PEERS, help=argparse.SUPPRESS)
    parser.add_argument("--corpus", type=Path, default=corpus)
    parser.add_argument("--folders", default=FOLDERS)
    parser.add_argument("--most-faces", type=int, default=100_000)
    parser.add_argument("--program", type=Path, default=ROOT / "target" / "release" / "meshmill")
    arguments = parser.parse_args()
    if arguments.work:
        work(arguments.work)
        return
    if arguments.corpus is None:
        parser.error("name the folder of the meshes with --corpus")
    folders = [arguments.corpus / folder for folder in arguments.folders.split(",")]
    files = sorted(file for folder in folders for file in folder.iterdir() if file.suffix.lower() in ENDINGS)
    compare(arguments.program.resolve(), files, arguments.most_faces)


if __name__ == "__main__":
    main()
