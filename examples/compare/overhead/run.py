#!/usr/bin/env python3
"""What a runner costs: N trivial tasks, each one input file to one output file, with meshmill and its neighbours.

    python3 examples/compare/overhead/run.py [--tasks 1000] [--limit 900] [--tools meshmill,meshmill-shared,ninja,snakemake,dvc]

The neighbours copy each file with `cp`; meshmill, which runs mesh steps and no commands, reads each file as a mesh,
caches it and writes it out again. Each tool runs first on an empty state, then three times with nothing to do, and once
with one input changed. ninja comes from the package of that name; Snakemake and DVC from `pip install snakemake dvc`.
A tool that is not there, or is not done within the limit, is said so. Prints the table of overhead.md.
"""

import argparse
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
MESH = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 {}\nf 1 2 3\nf 1 3 4\n"


def inputs(folder, count):
    (folder / "in").mkdir(parents=True)
    (folder / "out").mkdir()
    for i in range(count):
        (folder / "in" / f"{i}.obj").write_text(MESH.format(i))


def meshmill(folder, count, binary):
    text = ['name = "many"']
    text += [f'[steps.t{i}]\nuse = "read"\nfile = "in/{i}.obj"' for i in range(count)]
    text += ["[outputs]"] + [f't{i} = "{i}.obj"' for i in range(count)]
    (folder / "many.toml").write_text("\n".join(text) + "\n")
    return [binary, "run", "many.toml", "-q", "--cache", "cache", "--out", "out"]


def ninja(folder, count, binary):
    text = ["rule cp\n  command = cp $in $out"]
    text += [f"build out/{i}.obj: cp in/{i}.obj" for i in range(count)]
    (folder / "build.ninja").write_text("\n".join(text) + "\n")
    return [binary, "--quiet"]


def snakemake(folder, count, binary):
    (folder / "Snakefile").write_text(
        f'rule all:\n    input: expand("out/{{i}}.obj", i=range({count}))\n'
        'rule copy:\n    input: "in/{i}.obj"\n    output: "out/{i}.obj"\n    shell: "cp {input} {output}"\n'
    )
    return [binary, "--cores", str(os.cpu_count()), "--quiet", "all"]


def dvc(folder, count, binary):
    text = ["stages:"]
    for i in range(count):
        text.append(f"  t{i}:\n    cmd: cp in/{i}.obj out/{i}.obj\n    deps: [in/{i}.obj]\n    outs: [out/{i}.obj]")
    (folder / "dvc.yaml").write_text("\n".join(text) + "\n")
    subprocess.run([binary, "init", "--no-scm", "-q"], cwd=folder, check=True)
    return [binary, "repro", "-q"]


def shared(folder, count, binary):
    """The same with a second level of the cache, as a lab has one (docs/shared-cache.md)."""
    (folder / "lab").mkdir()
    return meshmill(folder, count, binary) + ["--cache", "lab"]


TOOLS = {"meshmill": meshmill, "meshmill-shared": shared, "ninja": ninja, "snakemake": snakemake, "dvc": dvc}


def timed(command, folder, limit):
    """Seconds, processor seconds and the largest process in MB; None when the limit was reached."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()
    with open(folder / "log", "a") as log:
        child = subprocess.Popen(command, cwd=folder, stdout=log, stderr=log)
        try:
            _, status, usage = wait(child, start + limit)
        except TimeoutError:
            child.kill()
            child.wait()
            return None
    seconds = time.monotonic() - start
    if status != 0:
        sys.exit(f"{command} failed; see {folder}/log")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, cpu, usage.ru_maxrss / 1024


def wait(child, end):
    while time.monotonic() < end:
        pid, status, usage = os.wait4(child.pid, os.WNOHANG)
        if pid:
            child.returncode = os.waitstatus_to_exitcode(status)
            return pid, status, usage
        time.sleep(0.0005)
    raise TimeoutError


def measure(name, count, binary, limit):
    folder = pathlib.Path(tempfile.mkdtemp(prefix=f"overhead-{name}-"))
    try:
        inputs(folder, count)
        # Files that were written just before are looked at twice by careful tools.
        time.sleep(3)
        command = TOOLS[name](folder, count, binary)
        first = timed(command, folder, limit)
        if first is None:
            made = len(list((folder / "out").iterdir()))
            return [name, f"> {limit} ({made} done)", "", "", "", "", "", ""]
        time.sleep(3)
        idle = [timed(command, folder, limit) for _ in range(3)]
        (folder / "in" / "0.obj").write_text(MESH.format(-1))
        changed = timed(command, folder, limit)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return [
        name,
        f"{first[0]:.2f}",
        f"{first[1] * 1000 / count:.2f}",
        f"{statistics.median(run[0] for run in idle) * 1000:.0f}",
        f"{statistics.median(run[1] for run in idle) * 1000:.0f}",
        f"{changed[0] * 1000:.0f}",
        f"{changed[1] * 1000:.0f}",
        f"{max(run[2] for run in [first, *idle]):.0f}",
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=1000)
    parser.add_argument("--limit", type=int, default=900, help="seconds for one run")
    parser.add_argument("--tools", default=",".join(TOOLS))
    parser.add_argument("--meshmill", default=str(ROOT / "target" / "release" / "meshmill"))
    arguments = parser.parse_args()
    head = ["tool", "first run s", "processor ms a task", "nothing to do ms", "of it processor ms", "one changed ms", "of it processor ms", "largest process MB"]
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for name in arguments.tools.split(","):
        binary = str(pathlib.Path(arguments.meshmill).resolve()) if name.startswith("meshmill") else shutil.which(name)
        if not binary or not pathlib.Path(binary).exists():
            print(f"| {name} | not installed | | | | | | |")
            continue
        print("| " + " | ".join(measure(name, arguments.tasks, binary, arguments.limit)) + " |", flush=True)


if __name__ == "__main__":
    main()
