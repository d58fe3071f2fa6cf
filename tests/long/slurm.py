#!/usr/bin/env python3
"""Renders a film by farm/slurm on a Slurm cluster of one node, whose daemons it starts and stops. Needs root, and
Debian's slurm-wlm and munge. KDRAY names the command.

Tasks are requeued on the way, one by Slurm, one because its device has failed and one because the disk has, and the
film has to be, bit for bit, the one that a single process makes. The frames of a chunk are joined when its parts are
there, whatever becomes of other chunks. A film that cannot be rendered ends, and wrong calls are refused.
"""

import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/farm"))
import film  # noqa: E402

CONFIGURATION = """
ClusterName=kdray
SlurmctldHost={host}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldPort={port}
SlurmdPort={next_port}
SwitchType=switch/none
MpiDefault=none
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
JobRequeue=1
MaxArraySize=101
MaxJobCount=400
SchedulerParameters=sched_interval=1,bf_interval=1
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
NodeName={host} CPUs={n_cpus} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def free_ports(n):
    sockets = [socket.socket() for _ in range(n)]
    for each in sockets:
        each.bind(("", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Cluster:
    """The daemons of a cluster of this computer, in a folder of their own."""

    def __init__(self, folder):
        self.folder, self.daemons = folder, []
        for name in ("state", "spool"):
            (folder / name).mkdir()
        host, (port, next_port) = socket.gethostname().split(".")[0], free_ports(2)
        text = CONFIGURATION.format(host=host, folder=folder, port=port, next_port=next_port, n_cpus=os.cpu_count())
        (folder / "slurm.conf").write_text(text)
        os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
        key = folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        munge = [f"--key-file={key}", f"--socket={folder}/munge.socket", f"--pid-file={folder}/munge.pid"]
        munge += [f"--log-file={folder}/munge.log", f"--seed-file={folder}/munge.seed", "--force", "--foreground"]
        self.start("munged", *munge)
        self.wait_for(lambda: (folder / "munge.socket").exists())
        self.start("slurmctld", "-D", "-c")
        self.start("slurmd", "-D", "-N", host)
        self.wait_for(lambda: "idle" in self.query("sinfo", "-h", "-o", "%t"))

    def start(self, *command):
        log = open(self.folder / f"{command[0]}.out", "w")
        self.daemons.append(subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, start_new_session=True))

    def query(self, *command):
        return subprocess.run(command, capture_output=True, text=True).stdout

    def wait_for(self, is_so, seconds=60):
        until = time.monotonic() + seconds
        while not is_so():
            if time.monotonic() > until:
                logs = [path.read_text()[-2000:] for path in self.folder.glob("*.out")]
                raise TimeoutError("\n".join(["the cluster does not get there", *logs]))
            time.sleep(0.1)

    def stop(self):
        for daemon in reversed(self.daemons):
            film.end(daemon)


def requeue_a_running_task(cluster, job):
    """Requeues a task of a job, as Slurm does with tasks of preempted nodes. Returns whether one was running."""
    running = cluster.query("squeue", "-h", "-r", "-j", job, "-t", "running", "-o", "%i").split()
    for task in running:
        # Meanwhile, the task may have ended.
        if subprocess.run(["scontrol", "requeue", task], stderr=subprocess.DEVNULL).returncode == 0:
            print(f"requeued {task} while it ran", flush=True)
            return True
    return False


def submit(out, *words, environment=None):
    """Submits a film, and returns how that ends."""
    command = [ROOT / "farm/slurm/submit", film.FilmCase.pack, out, *words]
    environment = {**os.environ, "KDRAY": film.KDRAY, **(environment or {})}
    return subprocess.run([*map(str, command)], env=environment, capture_output=True, text=True)


def submitted(out, *words, environment=None):
    """Submits a film, and returns the numbers of its jobs: those that render, and the one that joins."""
    done = submit(out, *words, environment=environment)
    assert done.returncode == 0, done.stderr
    *renders, merge = done.stdout.split()
    return renders, merge


def wait_for_jobs(cluster, jobs):
    cluster.wait_for(lambda: not cluster.query("squeue", "-h", "-j", ",".join(jobs)).strip(), seconds=600)


def command(folder, name, text):
    """A shell script in a folder."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def codes_of(out, kind):
    """The exit codes of all units of a kind that were done, in the order of their ends."""
    lines = [line.split("\t") for line in (out / "units.tsv").read_text().splitlines()]
    return [int(code) for _, _, _, code, unit in lines if unit.startswith(kind)]


WORDS = (f"0-{film.FRAMES - 1}", film.TILES, film.BLOCKS, film.SPP, film.OPTIONS)
N_PARTS = film.TILES * film.BLOCKS
CHUNK = 3
N_CHUNKS = -(-film.FRAMES // CHUNK)


def a_film(cluster, folder):
    """Renders a film in chunks of frames. The first task of all and the first merge fail at first, as if the device
    and the disk had. While a task of the last chunk is held, the frames of all other chunks are joined."""
    # Slurm must not take a part of the name for the number of a job.
    out = folder / "out of 100%j"
    fail_once = f"[ $1 != {{}} ] || ! mkdir {folder}/{{}}-failed 2>/dev/null || exit {{}}"
    failures = [fail_once.format("render", "render", 4), fail_once.format("merge", "merge", 5)]
    kdray = command(folder, "kdray", "\n".join([*failures, f'exec {film.KDRAY} "$@"']))
    renders, merge = submitted(out, *WORDS, environment={"CHUNK": str(CHUNK), "KDRAY": str(kdray)})
    held = f"{renders[-1]}_{N_CHUNKS - 1}"
    subprocess.run(["scontrol", "hold", held], check=True)
    print(f"render jobs {' '.join(renders)}, merge job {merge}, held {held}", flush=True)
    cluster.wait_for(lambda: len(list(out.glob("parts/*.exr"))) >= 5)
    cluster.wait_for(lambda: any(requeue_a_running_task(cluster, job) for job in renders))
    n_early = CHUNK * (N_CHUNKS - 1)
    cluster.wait_for(lambda: len(list(out.glob("*.exr"))) == n_early, seconds=600)
    subprocess.run(["scontrol", "release", held], check=True)
    wait_for_jobs(cluster, [*renders, merge])
    assert film.film(out) == film.FilmCase.alone, "the film differs"
    assert (codes_of(out, "frames").count(4), codes_of(out, "merge").count(5)) == (1, 1), out
    logs = [path.read_text() for path in (out / "log").iterdir()]
    assert len(logs) == N_CHUNKS * (N_PARTS + 1), [path.name for path in (out / "log").iterdir()]
    assert sum("the task is done again, try 2 of 4" in log for log in logs) == 2, logs
    print(f"{film.FRAMES} frames in {len(logs)} tasks: the film of a single process")
    subprocess.run([sys.executable, ROOT / "farm/report.py", out], check=True)


def films_that_fail(cluster, folder):
    """A device that always fails is tried RETRIES times more, and wrong options once. Nothing waits for ever."""
    for name, code, n_tries in (("device", 4, 2), ("scene", 3, 1)):
        out, kdray = folder / name, command(folder, f"kdray-{name}", f"echo 'error: a broken {name}' >&2\nexit {code}")
        [render], merge = submitted(out, "0", environment={"KDRAY": str(kdray), "RETRIES": "1"})
        wait_for_jobs(cluster, [render, merge])
        assert codes_of(out, "") == [code] * n_tries, codes_of(out, "")
        assert "JobState=CANCELLED" in cluster.query("scontrol", "show", "job", merge), "the merge is given up"
        print(f"a {name} that is broken is tried {n_tries} times, and the merge is cancelled")


def a_chunk_that_fails(cluster, folder):
    """If one chunk cannot be rendered, the frames of all other chunks are joined all the same."""
    out = folder / "chunk"
    kdray = command(folder, "kdray-chunk", f'case "$*" in *"--frames 3-5 "*) exit 3;; esac\nexec {film.KDRAY} "$@"')
    words = (f"0-{film.FRAMES - 1}", 2, 1, 16, film.OPTIONS)
    renders, merge = submitted(out, *words, environment={"CHUNK": str(CHUNK), "KDRAY": str(kdray)})
    wait_for_jobs(cluster, [*renders, merge])
    joined = sorted(int(path.stem) for path in out.glob("*.exr"))
    assert joined == [frame for frame in range(film.FRAMES) if not 3 <= frame <= 5], joined
    assert codes_of(out, "frames").count(3) == 2, "both tiles of the chunk fail once"
    print("a chunk that cannot be rendered costs its own frames only")


def a_submission_that_fails(cluster, folder):
    """If not all jobs can be submitted, those that are submitted are cancelled."""
    bin = folder / "bin"
    bin.mkdir()
    command(bin, "sbatch", f'mkdir {folder}/first-submitted 2>/dev/null || exit 1\nexec {shutil.which("sbatch")} "$@"')
    path = f"{bin}:{os.environ['PATH']}"
    done = submit(folder / "half", "0-9", "2", environment={"PATH": path, "SBATCH_OPTIONS": "--hold"})
    assert (done.returncode, done.stdout) == (1, ""), done
    assert (folder / "first-submitted").exists()
    cluster.wait_for(lambda: not cluster.query("squeue", "-h").strip())
    assert not list((folder / "half").glob("parts/*"))
    print("a film of which one job cannot be submitted leaves no jobs")


def wrong_calls(folder):
    for words, chunk, named in (
        (["3-1"], "1", "`3-1` are no frames A-B"),
        (["0-9x2"], "1", "`0-9x2` are no frames A-B"),
        (["0-9", "none"], "1", "TILES is `none`"),
        (["0-9", "4", "2", "many"], "1", "SPP is `many`"),
        (["0-9"], "0", "CHUNK is `0`"),
        (["0-101"], "1", "there are 2 jobs of 102 tasks, and the cluster takes 101 in a job (MaxArraySize)"),
        (["0-101"], "1", "take CHUNK=2 frames"),
        (["0-100", "4", "2"], "1", "there are 9 jobs of 101 tasks"),
        (["0-100", "4", "2"], "1", "and 400 in all (MaxJobCount): take CHUNK=3 frames"),
        (["0", "400"], "1", "400 tiles in 1 blocks are 401 jobs, and the cluster takes 400"),
    ):
        done = submit(folder / "refused", *words, environment={"CHUNK": chunk})
        assert done.returncode == 2 and done.stderr.startswith("error: submit: "), (words, done)
        assert named in done.stderr, (named, done.stderr)
    assert not (folder / "refused").exists()


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="kdray-slurm-"))
    cluster = None
    try:
        film.FilmCase.setUpClass()
        cluster = Cluster(folder)
        wrong_calls(folder)
        a_submission_that_fails(cluster, folder)
        films_that_fail(cluster, folder)
        a_chunk_that_fails(cluster, folder)
        a_film(cluster, folder)
    finally:
        if cluster:
            cluster.stop()
        shutil.rmtree(folder, ignore_errors=True)
        film.FilmCase.doClassCleanups()


if __name__ == "__main__":
    main()
