"""A virtual environment with other programs, and the script that goes on in it."""
import os
import subprocess
import sys
import venv
from pathlib import Path


def enter(home, installs, imports="", may_skip=True):
    """Goes on in the virtual environment `home`; makes it first where it is not there, and installs what is missing.

    Each of `installs` is what pip is told to install. What cannot be installed, and what then does not load, is said. Where
    `imports` names modules they must all load; else every install may fail by itself. A skip is no failure if it may be one.
    """
    home = Path(home)
    if Path(sys.prefix).resolve() == home.resolve():
        return
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        try:
            venv.create(home, with_pip=True)
        except (OSError, subprocess.CalledProcessError) as error:
            skip(f"no virtual environment can be made here (apt-get install python3-venv): {error}", may_skip)
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    for what in installs:
        if subprocess.run([*pip, *what]).returncode != 0:
            reason = f"{' '.join(what)} cannot be installed here (no network, or no wheel for this platform)"
            if imports:
                skip(reason, may_skip)
            print(f"SKIPPED: {reason}")
    if imports:
        # Open3D is linked to libraries that a bare server has not.
        loaded = subprocess.run([python, "-c", f"import {imports}"], capture_output=True, text=True)
        if loaded.returncode != 0:
            last = loaded.stderr.strip().splitlines()[-1]
            skip(f"a peer does not load (apt-get install libusb-1.0-0 libgl1 libgomp1): {last}", may_skip)
    os.execv(python, [str(python), *sys.argv])


def skip(reason, may_skip):
    print(f"SKIPPED: {reason}")
    sys.exit(0 if may_skip else 1)
