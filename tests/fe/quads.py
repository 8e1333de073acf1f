#!/usr/bin/env python3
"""Solves the quads of example parts with CalculiX: proves that the exported S4 and S8R meshes are meshes a solver takes.

    python3 tests/fe/quads.py [--meshmill PROGRAM] [--set NAME=VALUE ...] [PART ...]

Each part (default: the shipped l_bracket and pipe_tee) goes through `pipelines/quads-closed.toml`. Its skin becomes a steel
shell, clamped where the part is lowest along its longest axis and loaded by its own weight across that axis. CalculiX
exits with 0 even when it fails, so the log is searched for *ERROR and the displacements are read back; every node must
have moved by a finite amount, the reactions must carry the weight, and S4 and S8R must agree about the deflection.

Needs `ccx` (Debian: calculix-ccx). Exits with 1 if anything fails, with 77 if there is no `ccx`.
"""
import argparse
import math
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
DENSITY, GRAVITY, YOUNG, POISSON = 7.85e-9, 9810.0, 210000.0, 0.3  # tonne, mm, s, MPa
THICKNESS = 0.004  # of the longest extent: less than the shortest edges of usual meshes
CLAMPED = 0.08  # of the longest extent
AGREEMENT = 0.25  # S4 against S8R: four-node plates of few elements are too stiff


def read_mesh(path):
    """Nodes, and elements as lists of nodes, of an Abaqus deck."""
    nodes, elements, block = {}, [], None
    for line in path.read_text().splitlines():
        if line.startswith("*"):
            block = line.split(",")[0].upper() if not line.startswith("**") else block
        elif block == "*NODE":
            number, *at = line.split(",")
            nodes[int(number)] = tuple(float(x) for x in at[:3])
        elif block == "*ELEMENT":
            elements.append([int(x) for x in line.split(",") if x.strip()][1:])
    return nodes, elements


def deck(mesh, nodes, folder):
    """Writes the deck beside the mesh; returns the number of clamped nodes."""
    low = [min(p[i] for p in nodes.values()) for i in range(3)]
    high = [max(p[i] for p in nodes.values()) for i in range(3)]
    extent = [high[i] - low[i] for i in range(3)]
    axis = extent.index(max(extent))
    across = [0.0, 0.0, 0.0]
    across[(axis + 1) % 3] = 1.0
    clamped = sorted(n for n, p in nodes.items() if p[axis] < low[axis] + CLAMPED * extent[axis])
    thickness = THICKNESS * extent[axis]
    shutil.copy(mesh, folder / "mesh.inp")
    lines = ["*INCLUDE, INPUT=mesh.inp", "*NSET, NSET=CLAMPED"]
    lines += [", ".join(str(n) for n in clamped[i : i + 8]) for i in range(0, len(clamped), 8)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG}, {POISSON}", "*DENSITY", f"{DENSITY}"]
    lines += ["*SHELL SECTION, ELSET=Eall, MATERIAL=STEEL", f"{thickness}"]
    lines += ["*BOUNDARY", "CLAMPED, 1, 6", "*STEP", "*STATIC", "*DLOAD"]
    lines += [f"Eall, GRAV, {GRAVITY}, " + ", ".join(str(x) for x in across)]
    lines += ["*NODE PRINT, NSET=Nall", "U", "*END STEP", ""]
    (folder / "job.inp").write_text("\n".join(lines))
    return len(clamped)


def read_dat(path):
    """Displacements by node."""
    moved = {}
    number = re.compile(r"^\s*(\d+)\s+(\S+)\s+(\S+)\s+(\S+)\s*$")
    for line in path.read_text().splitlines():
        if found := number.match(line):
            moved[int(found[1])] = tuple(float(found[i]) for i in (2, 3, 4))
    return moved


def solve(kind, mesh, folder):
    """Runs ccx; returns what it says as a row, or raises RuntimeError."""
    nodes, elements = read_mesh(mesh)
    per_element = {"S4": 4, "S8R": 8}[kind]
    if not elements or any(len(e) != per_element for e in elements):
        raise RuntimeError(f"{mesh.name} does not hold {kind} alone")
    folder.mkdir()
    clamped = deck(mesh, nodes, folder)
    done = subprocess.run(["ccx", "-i", "job"], cwd=folder, capture_output=True, text=True, timeout=900)
    log = done.stdout + done.stderr
    errors = [line.strip() for line in log.splitlines() if "*ERROR" in line]
    if errors or done.returncode != 0:
        raise RuntimeError(f"ccx: {errors[0] if errors else 'exit ' + str(done.returncode)}")
    if not (folder / "job.dat").exists():
        raise RuntimeError("ccx wrote no job.dat")
    moved = read_dat(folder / "job.dat")
    used = {n for e in elements for n in e}
    lost = [n for n in used if n not in moved or not all(math.isfinite(x) for x in moved[n])]
    if lost:
        raise RuntimeError(f"{len(lost)} nodes have no finite displacement, the first is {lost[0]}")
    deflection = max(math.hypot(*moved[n]) for n in used)
    if deflection <= 0.0:
        raise RuntimeError("nothing moved")
    return {"elements": len(elements), "nodes": len(used), "clamped": clamped, "deflection": deflection}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", type=pathlib.Path)
    parser.add_argument("--meshmill", default=str(ROOT / "target/release/meshmill"))
    parser.add_argument("--set", action="append", default=[], help="a parameter of the pipeline")
    options = parser.parse_args()
    if shutil.which("ccx") is None:
        print("there is no ccx: install calculix-ccx", file=sys.stderr)
        return 77
    parts = options.parts or [ROOT / "examples/meshes" / f"{name}.stl" for name in ("l_bracket", "pipe_tee")]
    print("| part | element | elements | nodes | clamped | largest deflection mm |")
    print("|---|---|---|---|---|---|")
    failed = 0
    for part in parts:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            sets = [word for value in options.set for word in ("--set", value)]
            recipe = [str(ROOT / "pipelines/quads-closed.toml"), "--input", f"part={part.resolve()}"]
            made = subprocess.run([options.meshmill, "run", *recipe, "--out", name, *sets], capture_output=True, text=True)
            if made.returncode != 0:
                print(f"{part.name}: meshmill exits with {made.returncode}: {made.stderr[-400:]}", file=sys.stderr)
                failed += 1
                continue
            rows = {}
            for kind, file in (("S4", "result.inp"), ("S8R", "result-s8r.inp")):
                try:
                    row = rows[kind] = solve(kind, folder / file, folder / kind)
                except (RuntimeError, subprocess.TimeoutExpired) as error:
                    print(f"{part.name} {kind}: {error}", file=sys.stderr)
                    failed += 1
                    continue
                print(f"| {part.stem} | {kind} | {row['elements']} | {row['nodes']} | {row['clamped']} "
                      f"| {row['deflection']:.4g} |")
            if len(rows) == 2:
                s4, s8 = rows["S4"]["deflection"], rows["S8R"]["deflection"]
                if abs(s4 - s8) > AGREEMENT * s8:
                    print(f"{part.name}: S4 and S8R differ by {abs(s4 - s8) / s8:.1%}", file=sys.stderr)
                    failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
