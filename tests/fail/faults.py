"""Failed output operations, failed allocations and kills in the commands of sdmgen.

    faults.py PROGRAM SOURCE OUTPUT_SHIM MEMORY_SHIM [--sample N] [--only CASE] [--seed S]

Each case is a command that writes files, some of which were there before. It is run once without a fault, and then with a fault at the
n-th operation: by the shims fail_output.c and fail_memory.c. Without --sample all output operations are tried, of allocations all n up to 40 and
40 random ones beyond; of single allocations inside cairo and OpenVDB all n up to 1,000 and the primes beyond. With --sample N N random faults
for each case, fewer cases, and each k-th allocation where libraries crash or a part of the result may be missing (STRIDES). Whatever fails:
  - the program does not crash, and it ends: with the exit code 0 and every output complete, or with 1 and a message;
  - a file under its final name is the old one or a complete new one, and no temporary file stays (but after a kill);
  - a training that was killed goes on with --resume to a model of the same bits.
Prints a table of the faults; exit code 1 if one of them broke a promise."""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

TRAIN = """shape: {name: capsule}
grid: {size: [8, 8, 8], spacing: 2}
network: {kind: pod, depth: 1, width: 8, rank: 2, levels: 1, block: 4, modes: 8, degree: 1, input_degree: 1}
data: {static: 0, start: 8, online: 4, holdout: 2, workers: 1}
train: {steps: 30, batch: 2, refine_batch: 2, checkpoint_seconds: 0.001}
"""
EXPERIMENT = """experiment: {title: tiny, samples: 2, engine_samples: 1}
shape: {name: capsule}
grid: {size: [8, 8, 8], spacing: 2}
network: {depth: 1, width: 8, rank: 2, levels: 1, block: 4, modes: 8, degree: 1, input_degree: 1}
data: {static: 0, start: 8, online: 4, holdout: 2}
train: {steps: 20, batch: 2, refine_batch: 2}
methods:
  - {name: POD, network: pod}
  - {name: exact, engine: exact}
"""
POINTS = "x,y,z\n0,0,5\n0,0,-5\n" + "".join(f"{x},{y},{z}\n" for z in (0, 2, -2) for x, y in ((2, 0), (-2, 0), (0, 2), (0, -2)))
OLD = b"the old file\n"
PICTURES = ("png", "svg", "pdf")
FORMATS_SAMPLED = ("npy", "nrrd", "vdb", "ply", "png", "svg", "pdf")
FORMATS = ("npy", "nii", "nii.gz", "nrrd", "mha", "vdb", "ply", "stl", "obj", "off", "vtk", "vtp", "png", "svg", "pdf")
TIME_LIMIT = 200
EVERY, BEYOND, RANDOM_KILLS = 40, 40, 40
DENSE = 1000
# with --sample: each k-th allocation up to the n-th fails alone
STRIDES = {"cairo png": (10, 400), "cairo svg": (8, 400), "cairo pdf": (40, 1000), "libraries vdb": (25, 1000), "report": (6, 120), "experiment": (5, 40)}


class Case:
    """A command, the outputs that it promises, and those that it may leave out."""

    def __init__(self, name, *command, outputs=(), extra=(), where=None):
        self.name, self.command, self.outputs, self.extra = name, command, outputs, extra
        self.where = where  # allocations that fail: of the "program" itself, or of a shared library; None: all
        self.of_libraries = where not in (None, "program") or name == "libraries vdb"
        self.reference = {}


def cases(golden, formats):
    model = str(golden / "pod_i8.sdm")
    # the system's own libraries do not survive that all allocations fail
    foreign = ("vdb", "png", "svg", "pdf")
    made = [Case(f"generate {e}", "generate", model, "-o", f"x.{e}", outputs=(f"x.{e}",), where="program" if e in foreign else None) for e in formats]
    made += [Case(f"cairo {e}", "generate", model, "-o", f"x.{e}", outputs=(f"x.{e}",), where="libcairo.so") for e in formats if e in PICTURES]
    return made + [
        Case("libraries vdb", "generate", model, "-o", "x.vdb", outputs=("x.vdb",)),
        Case("exact", "exact", "--shape", "capsule", "--size", "9,9,9", "--spacing", "1.5", "-o", "x.nrrd", "-o", "x.ply",
             outputs=("x.nrrd", "x.ply")),
        Case("fit", "fit", model, "points.csv", "--translation", "0,0,0", "--rotation", "0,0,0", "--force", "-o", "x.stl", "-o", "x.json",
             outputs=("x.stl", "x.json")),
        Case("report", "report", model, "-o", "x.html", outputs=("x.html",)),
        Case("train", "train", "train.yaml", "--out", "run", outputs=("run/model.sdm", "run/metrics.jsonl", "run/config.yaml"),
             extra=("run/loss.png", "run/slices.png", "run/checkpoint.sdmc"), where="program"),
        Case("experiment", "experiment", "experiment.yaml", "--out", "run", "--peers", "none",
             outputs=("run/table.md", "run/table.csv", "run/table.json", "run/pod/model.sdm"),
             extra=("run/pod/loss.png", "run/pod/slices.png", "run/pod/surfaces.png"), where="program"),
    ]  # fmt: skip


class Runner:
    def __init__(self, options, work):
        self.program, self.shims, self.work = options.program, {"output": options.output_shim, "memory": options.memory_shim}, work

    def folder(self, case):
        """A new folder with the inputs, and an old file in the place of each output that the command names."""
        folder = Path(tempfile.mkdtemp(dir=self.work))
        (folder / "train.yaml").write_text(TRAIN)
        (folder / "experiment.yaml").write_text(EXPERIMENT)
        (folder / "points.csv").write_text(POINTS)
        for name in case.outputs:
            if name in case.command:
                (folder / name).write_bytes(OLD)
        return folder

    def run(self, case, folder, shims=(), at=0, mode="once", more=()):
        """The finished process. The shims write the number of operations to the files of their names."""
        environment = dict(os.environ, LC_ALL="C", OMP_NUM_THREADS="1")
        if shims:
            environment.update(LD_PRELOAD=":".join(self.shims[name] for name in shims), FAIL_AT=str(at), FAIL_MODE=mode, FAIL_COUNT=str(folder / "count"))
            if case.where:
                environment["FAIL_IN"] = case.where
        return subprocess.run([self.program, *case.command, "--quiet", "--threads", "1", *more], cwd=folder, env=environment, timeout=TIME_LIMIT,
                              capture_output=True, text=True, errors="replace")  # fmt: skip

    def is_complete(self, case, folder, name):
        """Whether a file is that of the run without a fault, or, where it holds times or a random number, whether its end is there."""
        content = (folder / name).read_bytes()
        if content == case.reference[name]:
            return True
        text = content.decode(errors="replace")
        if name.endswith(".vdb"):
            return subprocess.run([self.program, "verify", name], cwd=folder, capture_output=True).returncode == 0
        if name.endswith(".json"):
            return bool(json.loads(text))
        if name.endswith((".md", ".csv")):  # a row that failed has no figures
            return text.split("\n")[0] == case.reference[name].decode().split("\n")[0] and text.endswith("\n")
        if name.endswith("pod/model.sdm"):  # whole, but without the figures for which memory was too short; 4: less exact than stated
            return subprocess.run([self.program, "verify", name], cwd=folder, capture_output=True).returncode in (0, 4)
        if name.endswith(".html") or (name.startswith("run/") and name.endswith(".png")):
            return abs(len(content) - len(case.reference[name])) < 200 and content[-4:] == case.reference[name][-4:]
        return False

    def check(self, case, folder, done, killed):
        """What a run with a fault has broken; None: nothing."""
        if killed and done.returncode == -9:
            pass
        elif done.returncode not in (0, 1):
            return f"exit code {done.returncode}: {done.stderr[-300:]}"
        elif done.returncode == 1 and not done.stderr.strip():
            return "exit code 1 without a message"
        for name in case.outputs + case.extra:
            path = folder / name
            if not path.exists():
                if done.returncode == 0 and name in case.outputs:
                    return f"exit code 0 without {name}"
                continue
            if name == "run/checkpoint.sdmc":
                continue
            old = path.read_bytes() == OLD
            if old and done.returncode == 0:
                return f"exit code 0 with the old {name}"
            # lines are added to the metrics while the training runs
            if not old and (done.returncode == 0 or name != "run/metrics.jsonl") and not self.is_complete(case, folder, name):
                return f"{name} is damaged, exit code {done.returncode}"
        left = [str(p.relative_to(folder)) for p in folder.rglob("*.tmp")]
        return f"left over: {left}" if left and done.returncode != -9 else None

    def resume(self, case, folder):
        """Goes on with a training that was killed. None: the model has the same bits as without the kill."""
        run = folder / "run"
        if (run / "model.sdm").exists() and not (run / "checkpoint.sdmc").exists():
            return None if self.is_complete(case, folder, "run/model.sdm") else "another model after a kill"
        done = self.run(case, folder, more=("--resume",))
        if done.returncode:
            return f"--resume after a kill: exit code {done.returncode}: {done.stderr[-300:]}"
        return next((f"{name} differs after a kill and --resume" for name in ("run/model.sdm", "run/metrics.jsonl")
                     if (folder / name).read_bytes() != case.reference[name]), None)  # fmt: skip

    def kill_at_random(self, case, folder, seed):
        """Kills a training, and what goes on with it, at random times."""
        chance = random.Random(seed)
        for more in ((), ("--resume",), ("--resume",)):
            if (folder / "run/model.sdm").exists():
                break
            process = subprocess.Popen([self.program, *case.command, "--quiet", "--threads", "1", *more], cwd=folder,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
            try:
                process.wait(chance.uniform(0, case.seconds))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def fault(self, case, shim, mode, at):
        folder = self.folder(case)
        wrong = None
        try:
            killed = mode in ("kill", "half", "random")
            if mode == "random":
                self.kill_at_random(case, folder, at)
            else:
                wrong = self.check(case, folder, self.run(case, folder, (shim,), at, mode), killed)
            if not wrong and killed and case.name == "train":
                wrong = self.resume(case, folder)
        except (subprocess.TimeoutExpired, ValueError) as error:
            wrong = str(error)
        shutil.rmtree(folder, ignore_errors=True)
        return None if wrong is None else f"{case.name}: {shim} {mode} at {at}: {wrong}"

    def measure(self, case):
        """Runs the command without a fault. Returns how many operations of each kind it has."""
        folder, start = self.folder(case), time.monotonic()
        done = self.run(case, folder, ("output", "memory"))
        case.seconds = time.monotonic() - start
        if done.returncode:
            raise SystemExit(f"{case.name}: exit code {done.returncode} without a fault: {done.stderr}")
        counts = {name: int((folder / f"count.{name}").read_text()) for name in self.shims}
        if not all(counts.values()):
            raise SystemExit(f"{case.name}: a shim counts nothing: {counts}: {done.stderr}")
        case.reference = {name: (folder / name).read_bytes() for name in case.outputs + case.extra if (folder / name).exists()}
        shutil.rmtree(folder)
        return counts


def places(case, shim, mode, n, chance):
    """Those of the operations 1 .. n that fail: all output operations; the first EVERY allocations and BEYOND of the others; of single allocations
    of libraries the first DENSE and, beyond, those whose number is a prime."""
    if shim == "output":
        return list(range(1, n + 1))
    if not case.of_libraries or mode != "once":
        return list(range(1, min(n, EVERY) + 1)) + sorted(chance.sample(range(EVERY + 1, n + 1), min(BEYOND, max(0, n - EVERY))))
    return [at for at in range(1, n + 1) if at <= DENSE or all(at % k for k in range(2, int(at**0.5) + 1))]


def choose(case, counts, sample, chance):
    """The faults of a case: (shim, mode, place)."""
    modes = [("output", mode) for mode in ("once", "lasting", "kill", "half")] + [("memory", mode) for mode in ("once", "lasting")]
    if case.of_libraries:  # the output operations are those of "generate"; OpenVDB does not survive that all allocations fail
        modes = [("memory", "once")] + ([("memory", "lasting")] if case.where else [])
    if sample:
        # cairo forgets that a write of a PDF file failed if later ones succeed
        known = [("output", "once", at) for at in range(1, counts["output"] + 1)] if case.name == "generate pdf" else []
        n = 4 * sample if case.of_libraries else sample
        step, last = STRIDES.get(case.name, (1, 0))
        known += [("memory", "once", at) for at in range(chance.randint(1, step), min(last, counts["memory"]) + 1, step)]
        if case.name == "experiment":  # messages need no memory
            known += [("memory", "lasting", at) for at in (8, 30)]
        return known + [(shim, mode, chance.randint(1, counts[shim])) for shim, mode in (chance.choice(modes) for _ in range(n))]
    faults = [(shim, mode, at) for shim, mode in modes for at in places(case, shim, mode, counts[shim], chance)]
    return faults + [("output", "random", seed) for seed in range(RANDOM_KILLS if case.name == "train" else 0)]


def main():
    parser = argparse.ArgumentParser()
    for name in ("program", "source", "output_shim", "memory_shim"):
        parser.add_argument(name, type=os.path.abspath)
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, wrong, total, start = random.Random(options.seed), [], 0, time.monotonic()
    print(f"{'command':16} {'operations':>10} {'allocations':>11} {'output faults':>13} {'kills':>6} {'memory faults':>13} {'broken':>6}")
    with tempfile.TemporaryDirectory(prefix="faults.") as work, ThreadPoolExecutor(os.cpu_count()) as pool:
        runner = Runner(options, work)
        for case in cases(Path(options.source) / "tests/golden", FORMATS_SAMPLED if options.sample else FORMATS):
            if options.only and case.name not in options.only:
                continue
            counts = runner.measure(case)
            jobs = [(case, *fault) for fault in choose(case, counts, options.sample, chance)]
            broken = [line for line in pool.map(lambda job: runner.fault(*job), jobs) if line]
            number = {kind: sum(1 for _, shim, mode, _ in jobs if (shim if shim == "memory" else "kill" if mode in ("kill", "half", "random") else shim) == kind)
                      for kind in ("output", "kill", "memory")}  # fmt: skip
            print(f"{case.name:16} {counts['output']:10} {counts['memory']:11} {number['output']:13} {number['kill']:6} {number['memory']:13} {len(broken):6}",
                  flush=True)  # fmt: skip
            wrong += broken
            total += len(jobs)
    for line in wrong:
        print("BROKEN:", line)
    print(f"{total} faults, {len(wrong)} broken promises, {time.monotonic() - start:.0f} s")
    sys.exit(1 if wrong or total == 0 else 0)


main()
