#!/usr/bin/env python3
"""Renders a film by farm/slurm on a Slurm cluster of one node, whose daemons it starts and stops. Needs root, and
Debian's slurm-wlm and munge. KDRAY names the command.

Tasks are requeued on the way, one by Slurm and one because its device has failed, and the film has to be, bit for bit,
the one that a single process makes. A film that cannot be rendered ends, and wrong calls are refused.
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


def wait_for_jobs(cluster, jobs):
    cluster.wait_for(lambda: not cluster.query("squeue", "-h", "-j", ",".join(jobs)).strip(), seconds=600)


def a_film(cluster, folder):
    """Renders a film in chunks of frames. The first task of all fails at first, as if its device had."""
    # Slurm must not take a part of the name for the number of a job.
    out, kdray = folder / "out of 100%j", folder / "kdray"
    failure = f"[ $1 = render ] && mkdir {folder}/failed 2>/dev/null && exit 4"
    kdray.write_text(f'#!/bin/sh\n{failure}\nexec {film.KDRAY} "$@"\n')
    kdray.chmod(0o755)
    words = (f"0-{film.FRAMES - 1}", film.TILES, film.BLOCKS, film.SPP, film.OPTIONS)
    done = submit(out, *words, environment={"CHUNK": "3", "KDRAY": str(kdray)})
    assert done.returncode == 0, done.stderr
    render, merge = done.stdout.split()
    print(f"render job {render}, merge job {merge}", flush=True)
    cluster.wait_for(lambda: len(list(out.glob("parts/*.exr"))) >= 5)
    cluster.wait_for(lambda: requeue_a_running_task(cluster, render))
    wait_for_jobs(cluster, [render, merge])
    assert film.film(out) == film.FilmCase.alone, "the film differs"
    codes = [line.split("\t")[3] for line in (out / "units.tsv").read_text().splitlines()]
    assert codes.count("4") == 1, codes
    logs = [path.read_text() for path in (out / "log").iterdir()]
    n_tasks = -(-film.FRAMES // 3) * film.TILES * film.BLOCKS
    assert len(logs) == n_tasks + 1, [path.name for path in (out / "log").iterdir()]
    assert sum("the task is done again, try 2 of 4" in log for log in logs) == 1, logs
    print(f"{film.FRAMES} frames in {n_tasks} tasks: the film of a single process")
    subprocess.run([sys.executable, ROOT / "farm/report.py", out], check=True)


def films_that_fail(cluster, folder):
    """A device that always fails is tried RETRIES times more, and wrong options once. Nothing waits for ever."""
    for name, code, n_tries in (("device", 4, 2), ("scene", 3, 1)):
        out, kdray = folder / name, folder / f"kdray-{name}"
        kdray.write_text(f"#!/bin/sh\necho 'error: the {name} is broken' >&2\nexit {code}\n")
        kdray.chmod(0o755)
        done = submit(out, "0", environment={"KDRAY": str(kdray), "RETRIES": "1"})
        assert done.returncode == 0, done.stderr
        jobs = done.stdout.split()
        wait_for_jobs(cluster, jobs)
        codes = [line.split("\t")[3] for line in (out / "units.tsv").read_text().splitlines()]
        assert codes == [str(code)] * n_tries, codes
        assert "JobState=CANCELLED" in cluster.query("scontrol", "show", "job", jobs[1]), "the merge is given up"
        print(f"a {name} that is broken is tried {n_tries} times, and the merge is cancelled")


def wrong_calls(folder):
    for words, chunk, named in (
        (["3-1"], "1", "`3-1` are no frames A-B"),
        (["0-9x2"], "1", "`0-9x2` are no frames A-B"),
        (["0-9", "none"], "1", "TILES is `none`"),
        (["0-9", "4", "2", "many"], "1", "SPP is `many`"),
        (["0-9"], "0", "CHUNK is `0`"),
        (["0-100", "4", "2"], "1", "there are 808 tasks, and the cluster takes 101 in an array"),
        (["0-100", "4", "2"], "1", "(MaxArraySize): take CHUNK=9 frames"),
        (["0-100", "4", "2"], "8", "there are 104 tasks, and the cluster takes 101"),
        (["0", "102"], "1", "102 tiles in 1 blocks are more than the 101 tasks"),
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
        films_that_fail(cluster, folder)
        a_film(cluster, folder)
    finally:
        if cluster:
            cluster.stop()
        shutil.rmtree(folder, ignore_errors=True)
        film.FilmCase.doClassCleanups()


if __name__ == "__main__":
    main()
