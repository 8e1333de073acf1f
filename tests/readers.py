#!/usr/bin/env python3
"""Reads every writer's file back with other programs: meshio, Gmsh, VTK, Open3D and CalculiX, whichever know the format.

    python3 tests/readers.py --meshmill target/debug/meshmill

Makes a virtual environment beside the build (target/readers), runs one recipe that writes a part with groups, fields and
second-order elements in every format, and counts nodes, faces, groups and fields of each file as the others see them. What
a program does not know of a format is listed below with its reason; all else must be there. CalculiX is a program of
the system (`ccx`: apt-get install calculix-ccx) and takes each deck into an analysis. What is not there is skipped aloud.
"""
import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "examples" / "compare"))
import environment  # noqa: E402

PACKAGES = ["meshio==5.3.5", "gmsh==4.15.2", "vtk==9.7.2", "open3d==0.20.0"]

# A box. Its sides are in no group, its bottom and its top are.
PART = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 1 2 6
f 1 6 5
f 2 3 7
f 2 7 6
f 3 4 8
f 3 8 7
f 4 1 5
f 4 5 8
g bottom
f 1 3 2
f 1 4 3
g top
f 5 6 7
f 5 7 8
"""
QUADS = PART.split("f ")[0] + "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\ng bottom\nf 1 4 3 2\ng top\nf 5 6 7 8\n"

RECIPE = """
name = "readers"
[inputs]
part = "part.obj"
quads = "quads.obj"
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.bent]
use = "features"
from = "clean"
curvature = true
[steps.rim]
use = "select"
from = "bent"
name = "rim"
of = "edges"
plane = { point = [0, 0, 1], normal = [0, 0, 1] }
[steps.fe]
use = "select"
from = "rim"
name = "dots"
of = "vertices"
box = { min = [-1, -1, -1], max = [0.1, 0.1, 2] }
[steps.square]
use = "read"
file = "=inputs.quads"
[outputs]
fe = ["t.stl", "t.obj", "t.ply", "t.off", "t.vtu", "t.vtp", "t.vtk", "t.inp", "t.msh", "t.msh2", "t.bdf",
    { file = "t6.vtu", element = "S6" }, { file = "t6.vtk", element = "S6" }, { file = "t6.inp", element = "S6" },
    { file = "t6.msh", element = "S6" }, { file = "t6.msh2", element = "S6" }, { file = "t6.bdf", element = "S6" },
    { file = "x.msh", binary = false }, { file = "x.vtu", binary = false }, { file = "x.vtk", binary = false }]
square = ["q.obj", "q.ply", "q.off", "q.vtu", "q.vtp", "q.vtk", "q.inp", "q.msh", "q.bdf",
    { file = "q8.vtu", element = "S8R" }, { file = "q8.inp", element = "S8R" }, { file = "q8.msh", element = "S8R" },
    { file = "q8.bdf", element = "S8R" }]
"""

NODES = {"t": 8, "x": 8, "t6": 8 + 18, "q": 8, "q8": 8 + 12}
FACES = {"t": ("triangle", 12), "x": ("triangle", 12), "t6": ("triangle6", 12), "q": ("quad", 6), "q8": ("quad8", 6)}

# What a program does not know, and so is not asked.
UNKNOWN = {
    ("meshio", "vtp"): "meshio does not know the format",
    ("meshio", "t.ply"): "meshio reads no edges in it",
    ("meshio", "q.ply"): "meshio does not know the type ushort",
    ("meshio", "q.off"): "meshio knows triangles only",
    ("meshio", "t6.inp"): "meshio does not know the element S6",
    ("meshio", "q8.inp"): "meshio does not know the element S8R",
    ("gmsh", "t.vtk"): "Gmsh reads text only",
    ("gmsh", "t6.vtk"): "Gmsh reads text only",
    ("gmsh", "q.vtk"): "Gmsh reads text only",
    ("gmsh", "inp"): "Gmsh only writes it",
    ("gmsh", "vtu"): "Gmsh only writes it",
    ("gmsh", "vtp"): "Gmsh does not know the format",
    ("gmsh", "obj"): "Gmsh makes it discrete surfaces of its own",
    ("gmsh", "off"): "Gmsh makes it discrete surfaces of its own",
    ("gmsh", "ply"): "Gmsh makes it discrete surfaces of its own",
    ("vtk", "inp"): "VTK does not know the format",
    ("vtk", "msh"): "VTK does not know the format",
    ("vtk", "msh2"): "VTK does not know the format",
    ("vtk", "bdf"): "VTK does not know the format",
    ("vtk", "off"): "VTK does not know the format",
    ("open3d", "q.obj"): "Open3D passes over the quads in it",
    **{("open3d", ending): "Open3D does not know the format" for ending in "vtu vtp vtk inp msh msh2 bdf".split()},
    **{("ccx", ending): "CalculiX does not know the format"
       for ending in "stl obj ply off vtu vtp vtk msh msh2 bdf".split()},
}
GROUPS_OF = {
    "meshio": {"vtu", "vtk", "inp"},
    "gmsh": {"msh", "msh2"},
    "vtk": {"vtu", "vtp", "vtk"},
    "open3d": set(),
    "ccx": {"inp"},
}
FIELDS_OF = {
    "meshio": {"vtu", "vtk", "msh", "msh2"},
    "gmsh": {"msh", "msh2"},
    "vtk": {"vtu", "vtp", "vtk"},
    "open3d": set(),
    "ccx": set(),
}

# An analysis without loads, which prints what CalculiX took in: every node, every element, and the groups.
ANALYSIS = """*INCLUDE, INPUT={deck}
*MATERIAL, NAME=any
*ELASTIC
1, 0.3
*SHELL SECTION, ELSET=Eall, MATERIAL=any
0.01
*BOUNDARY
Nall, 1, 3
*STEP
*STATIC
*NODE PRINT, NSET=Nall
U
*EL PRINT, ELSET=Eall
S
{groups}*END STEP
"""


def read_meshio(file):
    import meshio

    mesh = meshio.read(file, file_format="gmsh" if file.suffix == ".msh2" else None)
    faces = Counter()
    for block in mesh.cells:
        faces[block.type] += len(block.data)
    names = {*mesh.point_sets, *mesh.cell_sets, *mesh.field_data}
    names |= {name.split(":", 1)[1] for name in [*mesh.point_data, *mesh.cell_data] if "group:" in name}
    return len(mesh.points), faces, names, {*mesh.point_data}


def read_gmsh(file):
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("part")
    path = file
    if file.suffix == ".msh2":  # Gmsh goes by the ending
        path = file.with_name(file.stem + "-2.msh")
        path.write_bytes(file.read_bytes())
    gmsh.merge(str(path))
    kinds = {2: "triangle", 3: "quad", 9: "triangle6", 16: "quad8"}
    faces = Counter()
    for kind, tags in zip(*gmsh.model.mesh.getElements(2)[:2]):
        faces[kinds.get(int(kind), str(kind))] += len(tags)
    nodes = len(set(map(int, gmsh.model.mesh.getNodes()[0])))
    names = {gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()}
    fields = {gmsh.view.option.getString(tag, "Name") for tag in gmsh.view.getTags()}
    gmsh.finalize()
    return nodes, faces, names, fields


def read_vtk(file):
    import vtk

    reader = {
        ".vtu": vtk.vtkXMLUnstructuredGridReader,
        ".vtp": vtk.vtkXMLPolyDataReader,
        ".vtk": vtk.vtkGenericDataObjectReader,
        ".stl": vtk.vtkSTLReader,
        ".obj": vtk.vtkOBJReader,
        ".ply": vtk.vtkPLYReader,
    }[file.suffix]()
    reader.SetFileName(str(file))
    reader.Update()
    mesh = reader.GetOutput()
    kinds = {5: "triangle", 9: "quad", 22: "triangle6", 23: "quad8"}
    types = (mesh.GetCellType(i) for i in range(mesh.GetNumberOfCells()))
    faces = Counter(kinds.get(kind, str(kind)) for kind in types)
    name = lambda data: {data.GetArrayName(i) for i in range(data.GetNumberOfArrays())}
    arrays = name(mesh.GetPointData()) | name(mesh.GetCellData())
    return mesh.GetNumberOfPoints(), faces, {a.split(":", 1)[1] for a in arrays if "group:" in a}, arrays


def read_open3d(file):
    import open3d

    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    mesh = open3d.io.read_triangle_mesh(str(file))
    if file.suffix == ".stl":  # each triangle has corners of its own
        mesh.remove_duplicated_vertices()
    count = len(mesh.triangles)
    # Quads come in as two triangles each.
    faces = Counter(quad=count // 2) if file.stem.startswith("q") else Counter(triangle=count)
    return len(mesh.vertices), faces, set(), set()


def read_ccx(file):
    folder = file.parent / f"ccx-{file.stem}"
    folder.mkdir()
    shutil.copy(file, folder)
    sets = ["bottom", "top"], [] if file.stem.startswith("q") else ["rim", "dots"]
    groups = "".join(f"*EL PRINT, ELSET={name}\nS\n" for name in sets[0])
    groups += "".join(f"*NODE PRINT, NSET={name}\nU\n" for name in sets[1])
    (folder / "analysis.inp").write_text(ANALYSIS.format(deck=file.name, groups=groups))
    done = subprocess.run(["ccx", "-i", "analysis"], cwd=folder, capture_output=True, text=True, timeout=60)
    complaints = [line.strip() for line in done.stdout.splitlines() if "ERROR" in line or "WARNING" in line]
    if complaints:
        raise ValueError("; ".join(complaints))
    printed, block = {}, None
    for words in map(str.split, (folder / "analysis.dat").read_text().splitlines()):
        if "set" in words:
            block = printed.setdefault(words[words.index("set") + 1].lower(), set())
        elif words:
            block.add(int(words[0]))
    kind = {"t": "triangle", "t6": "triangle6", "q": "quad", "q8": "quad8"}[file.stem]
    return len(printed["nall"]), Counter({kind: len(printed["eall"])}), set(printed), set()


READERS = {"meshio": read_meshio, "gmsh": read_gmsh, "vtk": read_vtk, "open3d": read_open3d, "ccx": read_ccx}


def faults(program, file):
    """What the program does not see in the file."""
    ending, stem = file.suffix[1:], file.stem
    nodes, faces, groups, fields = READERS[program](file)
    kind, count = FACES[stem]
    if nodes != NODES[stem]:
        yield f"{nodes} nodes, not {NODES[stem]}"
    if faces[kind] != count:
        yield f"{dict(faces)}, not {count} {kind}"
    if ending in GROUPS_OF[program]:
        wanted = {"bottom", "top"} | (set() if stem.startswith("q") else {"rim", "dots"})
        if not wanted <= groups:
            yield f"lacks the groups {sorted(wanted - groups)}"
    if ending in FIELDS_OF[program] and not stem.startswith("q") and not {"curvature-max", "curvature-min"} <= fields:
        yield f"lacks fields, has {sorted(fields)}"


def one(program, file):
    try:
        if program != "ccx":
            __import__(program)
        elif shutil.which(program) is None:
            raise ImportError("there is no `ccx` here (apt-get install calculix-ccx)")
    except (ImportError, OSError) as error:
        return ["SKIPPED", str(error)]
    try:
        return list(faults(program, file))
    # A reader may end in any way, and meshio does so with an exit.
    except BaseException as error:
        return [f"{type(error).__name__}: {error}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--meshmill", type=Path, default=ROOT / "target" / "release" / "meshmill")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print("\n" + json.dumps(one(arguments.one[0], Path(arguments.one[1]))))
        return 0
    bad, read, skipped = 0, 0, set()
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        (folder / "part.obj").write_text(PART)
        (folder / "quads.obj").write_text(QUADS)
        (folder / "recipe.toml").write_text(RECIPE)
        command = [arguments.meshmill.resolve(), "--cache", folder / "cache", "-q", "run", "recipe.toml", "--out", "o"]
        subprocess.run([*map(str, command), "--pictures", "none"], cwd=folder, check=True)
        files = sorted(file for file in (folder / "o").iterdir() if file.suffix != ".ron")
        for program in READERS:
            for file in files:
                if (program, file.name) in UNKNOWN or (program, file.suffix[1:]) in UNKNOWN or program in skipped:
                    continue
                # A process each: what one file leaves behind in a reader is not the fault of the next one.
                run = [sys.executable, __file__, "--one", program, str(file)]
                done = subprocess.run(run, capture_output=True, text=True)
                lines = done.stdout.strip().splitlines()
                found = json.loads(lines[-1]) if done.returncode == 0 and lines else [done.stderr.strip()[-300:]]
                if found[:1] == ["SKIPPED"]:
                    print(f"SKIPPED: {program} does not load here: {found[1]}")
                    skipped.add(program)
                    continue
                read += 1
                for fault in found:
                    bad += 1
                    print(f"{program} reads {file.name}: {fault}")
    print(f"{read} files read by other programs, {bad} faults")
    return 1 if bad else 0


if __name__ == "__main__":
    environment.enter(os.environ.get("MESHMILL_READERS_VENV", ROOT / "target" / "readers" / "venv"), [[name] for name in PACKAGES])
    sys.exit(main())
