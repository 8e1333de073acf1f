#!/usr/bin/env python3
"""What simplification costs an analysis: the same shell, solved on meshes with more and more faces taken away.

    python3 tests/fe/simplify.py --meshmill target/release/meshmill --part part.stl [--shares 0,20,35,50,68,75]
        [--tolerance 0.1%] [--thickness 0.5%] [--max-size 8%] [--most-error 2%] [--work DIR] [--json FILE]

README.md in this folder tells the two cases and why they are what they are. Needs CalculiX (`ccx`) and nothing else.
Exits with 1 when a share asked for is missed, an analysis fails, or an error is above `--most-error`.
"""
import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile

# Newton, millimetre, tonne, second. The device weighs thousands of times as much as the shell: its modes come first.
STEEL = "*MATERIAL, NAME=STEEL\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.85e-9\n"
FORCE = 1.0
MASS = 1e-3
PLANE = 1e-5  # of the height: how near a node of a plane lies
THIN = 1 / 16  # of the thickness, again and again: elements that it would turn inside out
MOST_THINNINGS = 8


def percent(text):
    return float(text.rstrip("%")) / 100 if text.endswith("%") else float(text)


def length(text):
    """A length as a recipe takes it."""
    return f'"{text}"' if text.endswith("%") else text


def recipe(part, kind, arguments):
    """Repair; then the even mesh, and from it what `kind` says: a share to remove, or "reference" for a finer one."""
    size = length(arguments.max_size)
    steps = [f'name = "fe-check"\n[inputs]\npart = "{part}"', '[steps.raw]\nuse = "read"\nfile = "=inputs.part"',
             '[steps.clean]\nuse = "repair"\nfrom = "raw"']
    last = "clean"
    if kind != "raw":
        limits = f'reference = "clean"\ntolerance = {length(arguments.tolerance)}\nmax-size = {size}'
        steps += ['[steps.marked]\nuse = "features"\nfrom = "clean"\nangle = 30',
                  f'[steps.halved]\nuse = "refine"\nfrom = "marked"\nmax-edge = {size}',
                  f'[steps.even]\nuse = "simplify-fit"\nfrom = "halved"\n{limits}\ntarget-faces = {arguments.faces}\n'
                  f'max-aspect = {arguments.even_aspect:g}']
        last = "even"
    if kind == "reference":
        finer = f'"{50 * percent(arguments.max_size):g}%"'
        steps.append(f'[steps.fine]\nuse = "refine"\nfrom = "even"\nmax-edge = {finer}')
        last = "fine"
    elif kind not in ("raw", 0.0):
        left = int(arguments.faces * (1 - kind) + 1e-6)
        steps.append(f'[steps.light]\nuse = "simplify-fit"\nfrom = "even"\n{limits}\ntarget-faces = {left}')
        last = "light"
    steps.append(f'[outputs]\n{last} = [{{ file = "mesh.inp", element = "S6", midside-on = "clean" }}, "mesh.vtu"]')
    return "\n\n".join(steps) + "\n"


def mesh(folder, kind, arguments):
    path = os.path.join(folder, "recipe.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(recipe(os.path.abspath(arguments.part), kind, arguments))
    out = os.path.join(folder, "out")
    command = [os.path.abspath(arguments.meshmill), "run", path, "--out", out, "-q"]
    done = subprocess.run(command, capture_output=True, text=True,
                          env={**os.environ, "MESHMILL_CACHE": os.path.join(arguments.work, "cache")})
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    return os.path.join(out, "mesh.inp")


def read(path):
    """Nodes and elements of a deck of quadratic triangles."""
    nodes, elements, section = {}, {}, None
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line.startswith("**"):
                continue
            if line.startswith("*"):
                keyword = line.split(",")[0].strip().upper()
                section = {"*NODE": nodes, "*ELEMENT": elements}.get(keyword)
                if keyword == "*ELEMENT" and "S6" not in line.upper():
                    sys.exit(f"{path}: {line.strip()} is no quadratic triangle")
                continue
            if section is None or not line.strip():
                continue
            numbers = line.replace(",", " ").split()
            if section is nodes:
                nodes[int(numbers[0])] = tuple(map(float, numbers[1:4]))
            else:
                elements[int(numbers[0])] = tuple(map(int, numbers[1:]))
    return nodes, elements


def planes(nodes):
    """The nodes of the lowest and of the highest plane: by where they lie, so that every mesh has the same."""
    low = min(p[2] for p in nodes.values())
    high = max(p[2] for p in nodes.values())
    near = PLANE * (high - low)
    return ([n for n, p in sorted(nodes.items()) if p[2] - low <= near],
            [n for n, p in sorted(nodes.items()) if high - p[2] <= near])


def areas(nodes, elements):
    """The area of the faces in each of the two planes: what is held and what is moved must be the same in all meshes."""
    held = []
    for plane in map(set, planes(nodes)):
        area = 0.0
        for corners in elements.values():
            if plane.issuperset(corners[:3]):
                (ax, ay, _), (bx, by, _), (cx, cy, _) = (nodes[n] for n in corners[:3])
                area += abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2
        held.append(area)
    return held


def deck(nodes, elements, thickness, analysis, thin):
    """The foot is held; the lid is a stiff body that moves without turning: one node, tied by equations."""
    foot, lid = planes(nodes)
    master = max(nodes) + 1
    text = ["*NODE, NSET=ALL\n"]
    text += [f"{n}, {x:.12g}, {y:.12g}, {z:.12g}\n" for n, (x, y, z) in sorted(nodes.items())]
    text += ["*NODE, NSET=LID\n", f"{master}, 0., 0., {2 * max(p[2] for p in nodes.values()) + 1:.12g}\n"]
    levels = sorted({0, *thin.values()})
    for level in levels:
        text.append(f"*ELEMENT, TYPE=S6, ELSET=SHELL{level}\n")
        some = [e for e in sorted(elements) if thin.get(e, 0) == level]
        text += [f"{e}, " + ", ".join(map(str, elements[e])) + "\n" for e in some]
    text.append(f"*ELEMENT, TYPE=MASS, ELSET=DEVICE\n{max(elements) + 1}, {master}\n*MASS, ELSET=DEVICE\n{MASS}\n")
    text.append(STEEL)
    text += [f"*SHELL SECTION, ELSET=SHELL{n}, MATERIAL=STEEL\n{THIN**n * thickness:.9g}\n" for n in levels]
    text.append("*NSET, NSET=FOOT\n")
    text += [f"{n},\n" for n in foot]
    text.append("*BOUNDARY\nFOOT, 1, 3\n")
    text += [f"*EQUATION\n2\n{n}, {axis}, 1., {master}, {axis}, -1.\n" for n in lid for axis in (1, 2, 3)]
    if analysis == "static":
        load = "".join(f"{master}, {axis}, {FORCE}\n" for axis in (1, 2, 3))
        text.append(f"*STEP\n*STATIC\n*CLOAD\n{load}*NODE PRINT, NSET=LID\nU\n*END STEP\n")
    else:
        text.append("*STEP\n*FREQUENCY\n3\n*END STEP\n")
    return "".join(text)


class Inverted(Exception):
    """Elements that the thickness turns inside out."""

    def __init__(self, elements):
        super().__init__(elements)
        self.elements = elements


def solve(folder, name, text):
    """Runs CalculiX; it exits with 0 even when it fails, so its output is searched. Gives the results and CPU seconds."""
    results = os.path.join(folder, name + ".dat")
    if os.path.exists(results):
        os.remove(results)
    with open(os.path.join(folder, name + ".inp"), "w", encoding="utf-8") as file:
        file.write(text)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True,
                          env={**os.environ, "OMP_NUM_THREADS": "1"})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    inverted = set(map(int, re.findall(r"nonpositive jacobian\s+determinant in element\s+(\d+)", done.stdout)))
    if inverted:
        raise Inverted(inverted)
    if "*ERROR" in done.stdout + done.stderr or not os.path.exists(results) or not os.path.getsize(results):
        sys.exit(f"{folder}/{name}: the analysis failed\n{done.stdout[-2000:]}")
    with open(results, encoding="utf-8") as file:
        return file.read(), after.ru_utime - before.ru_utime


def displacement(text):
    """Of the lid, along the three axes."""
    for line in text.splitlines():
        part = line.split()
        if len(part) == 4 and part[0].isdigit():
            return [float(x) for x in part[1:]]
    sys.exit("no displacement was printed")


def frequencies(text):
    found = [float(line.split()[3]) for line in text.splitlines() if re.match(r"\s+[123]\s+-?[0-9.]+E", line)]
    if len(found) < 3:
        sys.exit("no frequencies were printed")
    return found[:3]


def solve_thinned(folder, nodes, elements, thickness):
    """The static case, with what turns inside out made thinner until nothing does; and how often each element was."""
    thin = {}
    for _ in range(MOST_THINNINGS):
        try:
            return solve(folder, "static", deck(nodes, elements, thickness, "static", thin)), thin
        except Inverted as inverted:
            for e in inverted.elements:
                thin[e] = thin.get(e, 0) + 1
    raise Inverted(set(thin))


def case(kind, arguments):
    name = kind if isinstance(kind, str) else f"removed-{100 * kind:g}"
    folder = os.path.join(arguments.work, name)
    os.makedirs(folder, exist_ok=True)
    nodes, elements = read(mesh(folder, kind, arguments))
    box = [max(p[a] for p in nodes.values()) - min(p[a] for p in nodes.values()) for a in range(3)]
    # From the first mesh, so that all have the same.
    arguments.diagonal = arguments.diagonal or sum(side * side for side in box) ** 0.5
    arguments.faces = arguments.faces or len(elements)
    thickness = percent(arguments.thickness) * arguments.diagonal
    (text, static_time), thin = solve_thinned(folder, nodes, elements, thickness)
    moved = displacement(text)
    text, modal_time = solve(folder, "modal", deck(nodes, elements, thickness, "modal", thin))
    return {"kind": kind, "faces": len(elements), "displacement": moved, "compliance": sum(moved) / FORCE,
            "nodes": len(nodes), "areas": areas(nodes, elements), "frequencies": frequencies(text),
            "thin": len(thin), "static_seconds": static_time, "modal_seconds": modal_time}


def errors(row, reference):
    """Signed errors: of the compliance, and the largest of the three frequencies."""
    by_mode = [f / g - 1 for f, g in zip(row["frequencies"], reference["frequencies"])]
    return row["compliance"] / reference["compliance"] - 1, max(by_mode, key=abs)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshmill", required=True)
    parser.add_argument("--part", required=True)
    parser.add_argument("--shares", default="0,20,35,50,68,75")
    parser.add_argument("--tolerance", default="0.1%")
    parser.add_argument("--thickness", default="0.5%")
    parser.add_argument("--max-size", default="8%", help="of faces, in percent of the diagonal")
    parser.add_argument("--even-aspect", type=float, default=4.0, help="the worst aspect ratio of the even mesh")
    parser.add_argument("--most-error", default="2%")
    parser.add_argument("--work")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    if not shutil.which("ccx"):
        sys.exit("CalculiX is missing: apt-get install calculix-ccx")
    arguments.work = arguments.work or tempfile.mkdtemp(prefix="fe-check-")
    arguments.diagonal = arguments.faces = None
    raw = as_read(arguments)
    reference = case("reference", arguments)
    reference["errors"] = [0.0, 0.0]
    rows, failed, dense = [], False, None
    print("| mesh | faces | thinned | compliance | error | frequency 1 | worst error of 3 | static s | modal s | faster |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for share in [float(share) / 100 for share in arguments.shares.split(",")]:
        row = case(share, arguments)
        dense = dense or row
        row["errors"] = errors(row, reference)
        missed = share > 0 and row["faces"] > arguments.faces * (1 - share) + 1
        rows.append(row)
        show(row, f"{100 * share:g} %" + (" missed" if missed else ""), dense)
        for own_area, area in zip(row["areas"], reference["areas"]):
            if abs(own_area - area) > 0.01 * area:
                print(f"the planes of this mesh measure {row['areas']}, those of the reference {reference['areas']}")
                failed = True
        failed |= missed or max(map(abs, row["errors"])) > percent(arguments.most_error)
    if raw:
        raw["errors"] = errors(raw, reference)
        show(raw, "as read", dense)
    show(reference, "reference", dense)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump([raw, reference, *rows], file, indent=1)
    return int(failed)


def as_read(arguments):
    """The mesh of the part itself, where its needles can be solved; gives its faces and size to the other cases."""
    try:
        return case("raw", arguments)
    except Inverted as inverted:
        print(f"as read: {len(inverted.elements)} of {arguments.faces} elements turn inside out, however thin\n")
        return None


def show(row, name, dense):
    total = row["static_seconds"] + row["modal_seconds"]
    gain = (dense["static_seconds"] + dense["modal_seconds"]) / max(total, 1e-3)
    print(f"| {name} | {row['faces']} | {row['thin']} | {row['compliance']:.5g} | {100 * row['errors'][0]:+.2f} % | "
          f"{row['frequencies'][0]:.5g} | {100 * row['errors'][1]:+.2f} % | {row['static_seconds']:.1f} | "
          f"{row['modal_seconds']:.1f} | {gain:.1f} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
