#!/usr/bin/env python3
"""Damaged meshes and recipes through the real program: whatever comes in, it ends soon, small and with a code of its own.

    python3 tests/mutants.py --meshmill target/release/meshmill --meshes 300 --recipes 600

Each reader gets `--meshes` mutants of a small mesh in its format, each of them through `measure` and through
`run pipelines/repair.toml`; `check` and `plan` get `--recipes` mutants of the shipped and test recipes. Exit codes must
be among 0, 2, 3, 4; nothing may take more than 20 s of processor time or 2 GB. What breaks a rule is kept under `--keep`
and named. The same seed makes the same mutants. Linux only, since it sets limits of resources.
"""

import argparse
import pathlib
import random
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
FORMATS = ["stl", "obj", "ply", "off", "msh", "vtk", "vtu", "vtp", "inp", "bdf"]
ALLOWED = {0, 2, 3, 4}
SECONDS, BYTES = 20, 2 << 30
BAIT = [b"-1", b"0", b"99999999999999999999", b"nan", b"1e999", b"-1e-320", b"\n", b"\r", b"\0", b"/", b"-", b",", b"*",
        b"$", b"<", b"&#0;", b"=", b"==", b"[", b"]", b"{", b"'", b"\"", b"\xff\xff\xff\xff", b"list", b"\\\n", b"%"]

CUBE = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
g floor\nf 1 3 2\nf 1 4 3\ng roof\nf 5 6 7\nf 5 7 8\ng walls
f 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n"""


def mutant(data, chance):
    """One to four changes: a bit, a byte, a digit, bait put in, a piece cut out, doubled or moved, the tail cut off.

    Half of the mutants change digits only, so that what comes in is often read and goes deeper.
    """
    data = bytearray(data)
    digits = [at for at, byte in enumerate(data) if 48 <= byte <= 57]
    if digits and chance.random() < 0.5:
        for at in chance.choices(digits, k=chance.randint(1, 4)):
            data[at] = chance.randrange(48, 58)
        return bytes(data)
    for _ in range(chance.choice([1, 1, 2, 4])):
        at, kind = chance.randrange(len(data) + 1), chance.randrange(7)
        end = min(len(data), at + chance.choice([1, 2, 8, 40]))
        if kind == 0 and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif kind == 1 and at < len(data):
            data[at] = chance.randrange(256)
        elif kind == 2:
            data[at:at] = chance.choice(BAIT)
        elif kind == 3:
            data[at:at] = data[at:end] * chance.choice([1, 2, 50])
        elif kind == 4:
            del data[at:end]
        elif kind == 5:
            piece = data[at:end]
            del data[at:end]
            to = chance.randrange(len(data) + 1)
            data[to:to] = piece
        elif chance.random() < 0.3:
            del data[at:]
    return bytes(data)


def limits():
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 2))


class Bench:
    def __init__(self, options, folder):
        self.program, self.folder, self.keep = options.meshmill.resolve(), folder, options.keep
        self.passed, self.faults = 0, []

    def run(self, what, *arguments, kept=None):
        """Runs the program and judges how it ended. The address space is limited, so threads are few."""
        command = [self.program, "--cache", self.folder / "cache", *arguments]
        ended = subprocess.run(command, cwd=self.folder, capture_output=True, preexec_fn=limits, check=False,
                               env={"RAYON_NUM_THREADS": "1", "HOME": str(self.folder), "PATH": "/usr/bin:/bin"})
        if ended.returncode in ALLOWED and b"panicked" not in ended.stderr:
            self.passed += 1
            return
        note = f"{what}: ended with {ended.returncode}: {ended.stderr[-300:].decode(errors='replace')}"
        if kept is not None and self.keep:
            self.keep.mkdir(parents=True, exist_ok=True)
            name = f"{len(self.faults)}-{kept.name}"
            (self.keep / name).write_bytes(kept.read_bytes())
            note += f" (kept as {self.keep / name})"
        self.faults.append(note)


def meshes(bench, count, seed):
    (bench.folder / "cube.obj").write_text(CUBE)
    for ending in FORMATS:
        whole = bench.folder / f"cube.{ending}"
        if ending != "obj":
            subprocess.run([bench.program, "-q", "convert", "cube.obj", whole], cwd=bench.folder, check=True)
        data, chance = whole.read_bytes(), random.Random(f"{seed} {ending}")
        for number in range(count):
            file = bench.folder / f"mutant.{ending}"
            file.write_bytes(mutant(data, chance))
            what = f"{ending} mutant {number}"
            bench.run(f"measure of {what}", "-q", "measure", file, kept=file)
            bench.run(f"repair of {what}", "-q", "run", ROOT / "pipelines/repair.toml", "--input", f"part={file}",
                      "--out", bench.folder / "out", "--pictures", "none", kept=file)


def recipes(bench, count, seed):
    sources = sorted([*(ROOT / "pipelines").glob("*.toml"), *(ROOT / "tests/recipes").rglob("*.toml")])
    chance = random.Random(f"{seed} recipes")
    (bench.folder / "pipelines").mkdir()
    (bench.folder / "examples").symlink_to(ROOT / "examples")
    for number in range(count):
        source = chance.choice(sources)
        file = bench.folder / "pipelines" / "mutant.toml"
        file.write_bytes(mutant(source.read_bytes(), chance))
        for command in ("check", "plan"):
            bench.run(f"{command} of recipe mutant {number} of {source.name}", command, file, kept=file)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshmill", type=pathlib.Path, default=ROOT / "target/release/meshmill")
    parser.add_argument("--meshes", type=int, default=300, help="mutants of each format")
    parser.add_argument("--recipes", type=int, default=600, help="mutants of recipes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the mutants that broke a rule")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(options, pathlib.Path(folder))
        meshes(bench, options.meshes, options.seed)
        recipes(bench, options.recipes, options.seed)
    for fault in bench.faults:
        print(fault)
    print(f"{bench.passed} passed, {len(bench.faults)} failed")
    return 1 if bench.faults else 0


if __name__ == "__main__":
    sys.exit(main())
