"""The script for SLURM of the documentation, with stand-ins for its commands."""

import os
import re
import shutil
import signal
import subprocess
from contextlib import suppress

import pytest
from conftest import ROOT

SCRIPT = re.search(
    r"```bash\n(#!/bin/bash\n#SBATCH .*?)```",
    (ROOT / "docs" / "campaigns.md").read_text(),
    re.DOTALL,
)
SCHEDULER = """#!/bin/bash
echo "dask $*" >>log
sleep 0.1
echo '{}' >scheduler-7.json
exec sleep 20
"""
DEAD = "#!/bin/bash\nsleep 0.1\nexit 1\n"
# A line each, as whole commands.
LOGGED = '#!/bin/bash\necho "${0##*/} $*" >>log\n'


@pytest.fixture
def job(tmp_path):
    """Run the script as a job with stand-ins; returns its status, errors, and commands."""
    programs = tmp_path / "programs"
    programs.mkdir()
    (tmp_path / "script").write_text(SCRIPT[1])

    def run(dask=SCHEDULER, mesoslip=LOGGED, **environment):
        stand_ins = {"dask": dask, "srun": LOGGED, "mesoslip": mesoslip}
        # Polled ten times as often as on a cluster.
        stand_ins["sleep"] = f'#!/bin/bash\nexec {shutil.which("sleep")} "${{1/#1/0.1}}"\n'
        for name, text in stand_ins.items():
            (programs / name).write_text(text)
            (programs / name).chmod(0o755)
        variables = {"PATH": f"{programs}:{os.environ['PATH']}", "SLURM_JOB_ID": "7", **environment}
        log, errors = tmp_path / "log", tmp_path / "errors"
        with errors.open("w") as stream:
            script = subprocess.Popen(
                ["bash", "script"],
                cwd=tmp_path,
                env=variables,
                stderr=stream,
                start_new_session=True,
            )
            try:
                status = script.wait(20)
            finally:
                # As SLURM does, end what is still running with the script.
                with suppress(ProcessLookupError):
                    os.killpg(script.pid, signal.SIGKILL)
        return status, errors.read_text(), log.read_text() if log.exists() else ""

    return run


@pytest.mark.parametrize("scratch", [None, "/scratch/mine"])
def test_workers_have_a_folder_for_scratch(scratch, job, tmp_path):
    """Not that of the job, where the variable is not set."""
    status, errors, log = job(**({} if scratch is None else {"TMPDIR": scratch}))
    assert (status, errors) == (0, "")
    file = tmp_path / "scheduler-7.json"
    assert f"--scheduler-file {file} --nthreads 1" in log
    assert f"--local-directory {scratch or '/tmp'}\n" in log
    assert f"mesoslip sweep SWEEP.toml --scheduler {file}\n" in log


def test_the_job_ends_if_the_scheduler_does(job, tmp_path):
    """Also where a file of an earlier scheduler is there, as in a job that was queued again."""
    (tmp_path / "scheduler-7.json").write_text("{}")
    status, errors, log = job(dask=DEAD)
    assert (status, errors) == (1, "the scheduler has ended\n")
    assert "mesoslip" not in log


def test_the_job_has_the_status_of_the_command(job):
    assert job(mesoslip="#!/bin/bash\nexit 1\n")[0] == 1
