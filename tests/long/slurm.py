#!/usr/bin/env python3
"""Renders a film by farm/slurm on a Slurm cluster of one node, whose daemons it starts and stops. Needs root, and
Debian's slurm-wlm and munge. KDRAY names the command.

A task is killed on the way and requeued, and the film has to be, bit for bit, the one that a single process makes.
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
import farm  # noqa: E402

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
            farm.end(daemon)


def requeue_a_running_task(cluster, job):
    """Requeues a task of a job, as Slurm does with tasks of preempted nodes. Returns whether one was running."""
    running = cluster.query("squeue", "-h", "-r", "-j", job, "-t", "running", "-o", "%i").split()
    for task in running:
        # Meanwhile, the task may have ended.
        if subprocess.run(["scontrol", "requeue", task], stderr=subprocess.DEVNULL).returncode == 0:
            print(f"requeued {task} while it ran", flush=True)
            return True
    return False


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="kdray-slurm-"))
    cluster = None
    try:
        farm.Farm.setUpClass()
        cluster = Cluster(folder)
        out = folder / "out"
        environment = {**os.environ, "KDRAY": farm.KDRAY}
        submit = [ROOT / "farm/slurm/submit", farm.Farm.pack, out, f"0-{farm.FRAMES - 1}"]
        submit += [farm.TILES, farm.BLOCKS, farm.SPP, farm.OPTIONS]
        done = subprocess.run([*map(str, submit)], env=environment, capture_output=True, text=True, check=True)
        render, merge = done.stdout.split()
        print(f"render job {render}, merge job {merge}", flush=True)
        cluster.wait_for(lambda: len(list(out.glob("parts/*.exr"))) >= 5)
        cluster.wait_for(lambda: requeue_a_running_task(cluster, render))
        cluster.wait_for(lambda: not cluster.query("squeue", "-h", "-j", f"{render},{merge}").strip(), seconds=600)
        assert farm.film(out) == farm.Farm.alone, "the film differs"
        print(f"{farm.FRAMES} frames in {farm.TILES} tiles and {farm.BLOCKS} blocks: the film of a single process")
        subprocess.run([sys.executable, ROOT / "farm/report.py", out], check=True)
    finally:
        if cluster:
            cluster.stop()
        shutil.rmtree(folder, ignore_errors=True)
        farm.Farm.doClassCleanups()


if __name__ == "__main__":
    main()
