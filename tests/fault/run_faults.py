"""Runs the scenario once for each call that may fail, in turn, until there is no such call any more.

    run_faults.py --scenario build/dev/bin/fault_scenario --library …/libvoxeld_fault_points.so --all

Without --all, --points spread over each class. Prints one line for each class and the failures."""
import argparse
import concurrent.futures
import errno
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

# SQLite's codes: SQLITE_BUSY, _NOMEM, _IOERR, _FULL.
CLASSES = [("sync", errno.EIO), ("rename", errno.ENOSPC), ("rename", errno.EIO),
           ("link", errno.EMLINK), ("link", errno.ENOSPC), ("read", errno.EIO),
           ("create", errno.ENOSPC), ("create", errno.EMFILE), ("write", errno.ENOSPC),
           ("write", errno.EIO), ("short-write", 0), ("sqlite", 13), ("sqlite", 10),
           ("sqlite", 7), ("sqlite", 5), ("alloc", errno.ENOMEM), ("alloc-twice", errno.ENOMEM)]
# nlohmann-json 3.11.2 allocates in its destructor, which is noexcept. Memory that is short there once is
# what process/memory_reserve is for; where it stays short (alloc-twice), the process ends, and its
# supervisor starts it again. These are counted apart, and only in that class.
JSON_DESTRUCTOR = re.compile(r"nlohmann\S*basic_json\S*(7destroy|D[12]Ev)")
SECONDS_MAX = 180  # one life; longer is a hang


def name_of(fault_class, code):
    if fault_class == "sqlite":
        return "sqlite " + {5: "BUSY", 7: "NOMEM", 10: "IOERR", 13: "FULL"}[code]
    return fault_class + (" " + errno.errorcode[code] if code else "")


class Runner:
    def __init__(self, arguments):
        self.arguments = arguments
        # fsync on a real disk would take most of the time.
        self.root = tempfile.mkdtemp(prefix="voxeld-fault-", dir=arguments.dir)

    def run(self, fault_class, code, number):
        """(the exit status, or why it failed; whether the fault fired; calls of the class)"""
        directory = pathlib.Path(tempfile.mkdtemp(dir=self.root))
        try:
            done = subprocess.run(
                [self.arguments.scenario, "run", fault_class, str(number), str(code),
                 directory / "data"],
                env={"LD_PRELOAD": self.arguments.library, "PATH": "/usr/bin:/bin"},
                capture_output=True, text=True, timeout=SECONDS_MAX, errors="replace")
        except subprocess.TimeoutExpired as late:
            return f"hangs\n{(late.stderr or b'')[-2000:]}", True, 0
        finally:
            shutil.rmtree(directory, ignore_errors=True)
        match = re.search(r"fired=(\d) calls=(\d+)", done.stdout)
        if done.returncode != 0 or not match:
            return f"exit status {done.returncode}\n{done.stderr[-12000:]}", True, 0
        return "", match[1] == "1", int(match[2])

    def numbers(self, fault_class, code):
        why, _, calls = self.run(fault_class, code, 10 ** 9)
        if why:
            sys.exit(f"{name_of(fault_class, code)}: without any fault: {why}")
        points = 0 if self.arguments.all else self.arguments.points
        if self.arguments.every > 1:
            return range(1, calls + 1, self.arguments.every), calls
        if not points or points >= calls:
            return range(1, calls + calls // 10 + 2), calls  # threads vary a little
        return [1 + i * (calls - 1) // (points - 1) for i in range(points)], calls

    def run_class(self, fault_class, code):
        start = time.monotonic()
        numbers, calls = self.numbers(fault_class, code)
        fired, failures, in_json = 0, [], 0
        with concurrent.futures.ThreadPoolExecutor(self.arguments.jobs) as pool:
            results = pool.map(lambda number: (number, self.run(fault_class, code, number)), numbers)
            for number, (why, was_fired, _) in results:
                fired += was_fired
                if why and fault_class == "alloc-twice" and JSON_DESTRUCTOR.search(why):
                    in_json += 1
                elif why:
                    failures.append((number, why))
                    print(f"FAILED {name_of(fault_class, code)} number {number}: {why}", flush=True)
        if not fired:  # the library is not in use, or does not know the class
            failures.append((0, "no fault"))
            print(f"FAILED {name_of(fault_class, code)}: none of {calls} calls was made to fail", flush=True)
        print(f"{name_of(fault_class, code):16} {calls:7} calls, {fired:7} made to fail, "
              f"{len(failures)} failures, {in_json} in json's destructor, {time.monotonic() - start:.0f} s", flush=True)
        return fired, len(failures)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--library", required=True)
    parser.add_argument("--points", type=int, default=12)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--every", type=int, default=1, help="with --all: only each such call")
    parser.add_argument("--only", help="one class")
    parser.add_argument("--number", type=int, help="one call of it")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--dir", default="/dev/shm" if pathlib.Path("/dev/shm").is_dir() else None)
    arguments = parser.parse_args()
    arguments.library = str(pathlib.Path(arguments.library).resolve())
    runner = Runner(arguments)
    try:
        chosen = [c for c in CLASSES if arguments.only in (None, c[0], name_of(*c))]
        if arguments.number:
            for one in chosen:
                print(name_of(*one), runner.run(*one, arguments.number))
            return 0
        totals = [runner.run_class(*one) for one in chosen]
    finally:
        shutil.rmtree(runner.root, ignore_errors=True)
    fired, failed = (sum(column) for column in zip(*totals))
    print(f"all: {fired} points, {failed} failures")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
