"""Packages of npm that a test needs, as its package-lock.json says."""
import shutil
import subprocess

FILES = ("package.json", "package-lock.json")


def install(here, work):
    """Installs the packages of the folder `here` into the folder `work`, unless they are there already."""
    missing = [name for name in ("node", "npm") if shutil.which(name) is None]
    if missing:
        raise AssertionError(f"{' and '.join(missing)} missing; Debian: apt-get install nodejs npm")
    work.mkdir(parents=True, exist_ok=True)
    stamp = work / "installed"
    wanted = "".join((here / name).read_text() for name in FILES)
    if stamp.exists() and stamp.read_text() == wanted:
        return
    for name in FILES:
        shutil.copyfile(here / name, work / name)
    done = subprocess.run(["npm", "ci", "--prefer-offline", "--ignore-scripts", "--no-audit", "--no-fund",
                           "--fetch-retries=1", "--fetch-timeout=60000"], cwd=work, timeout=600,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise AssertionError(f"npm ci failed: the packages of {here}/package-lock.json are neither in npm's "
                             "cache nor to be had from its registry:\n" + done.stderr[-2000:])
    stamp.write_text(wanted)
