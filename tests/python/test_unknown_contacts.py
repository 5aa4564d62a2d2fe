"""A kind of contacts that nobody knows is refused, not taken for another one.

The key `contacts.softening` is planted into the configuration of a program of its own. What has no
answer for it has to say so: kinds of the kernel, theories, reports.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from conftest import ROOT

# A key that is in the configuration alone; with KIND, contacts of one engine that say they know it.
PLANT = """
import mesoslip.configuration.contacts.tables.contacts as tables

class Contacts(tables.Contacts):
    softening: tables.Number | None = None

tables.Contacts = Contacts
import mesoslip
from mesoslip.configuration import contacts
from mesoslip.configuration.contacts.ensemble import EnsembleContacts

class SofteningContacts(EnsembleContacts):
    features = frozenset({"contacts.softening"})

if KIND:
    contacts.KINDS += (SofteningContacts,)
"""
RUN = """
config = mesoslip.Config.load(RUN, ["contacts.softening=0.5", "run.duration=1 s", *CHANGES])
"""


def outcome(program: str, *, kind: bool, changes: tuple[str, ...] = ()) -> str:
    """The last line of what a program with the planted key prints, errors included."""
    run = str(ROOT / "runs" / "klein.toml")
    start = f"KIND, RUN, CHANGES = {kind}, {run!r}, {changes!r}"
    done = subprocess.run(
        [sys.executable, "-c", start + PLANT + program],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    return (done.stderr or done.stdout).strip().splitlines()[-1]


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_a_key_without_a_kind_is_an_error_of_the_configuration(engine):
    printed = outcome(RUN, kind=False, changes=(f"run.engine={engine}",))
    assert "contacts.softening: is not known to contacts of the kind" in printed


def test_a_kind_of_one_engine_is_none_of_the_other():
    printed = outcome(RUN, kind=True, changes=("run.engine=me",))
    assert 'contacts.softening: is not known to contacts of the kind "populations"' in printed
    assert outcome(RUN + "print(config.contact_kind)", kind=True).startswith("SofteningContacts")


# Every public function of theory, and what asks theory by the way.
QUESTIONS = {
    "derived": "mesoslip.derived(config)",
    "verdict": "from mesoslip.theory.derived import verdict; verdict(config)",
    "curve": "mesoslip.curve(config)",
    "force curve": "from mesoslip.theory.force_curve import ForceCurve; ForceCurve(config)",
    "onset": "mesoslip.onset(config)",
    "cycle": "mesoslip.cycle(config)",
    "branches": "mesoslip.branches(config, 'drive.velocity', [1e-7, 2e-7])",
    "sliding": "mesoslip.SteadySliding(config)",
    "stability": "from mesoslip.theory.steady_sliding import stable_stiffness as f; f(config)",
    "steady curve": "from mesoslip.theory.steady_curve import SteadyCurve; SteadyCurve(config)",
    "report": "mesoslip.report(mesoslip.run(config), OUT)",
}


def test_a_kind_without_a_theory_is_refused_by_every_question(tmp_path):
    """All are asked in one program, as each start takes half a second."""
    lines = [RUN, f"OUT = {str(tmp_path / 'report.html')!r}", "answers = {}"]
    for name, question in QUESTIONS.items():
        lines += [
            "try:",
            f"    {question}",
            f"    answers[{name!r}] = 'answered'",
            "except mesoslip.MesoslipError as error:",
            f"    answers[{name!r}] = str(error)",
        ]
    lines += [
        "from mesoslip.theory.steady_sliding import steady_sliding",
        "assert steady_sliding(config, 10**6) is None",
        "print({name: one for name, one in answers.items() if 'contacts.softening' not in one})",
    ]
    assert outcome("\n".join(lines), kind=True) == "{}"


def test_commands_refuse_a_kind_without_a_theory():
    program = """
import contextlib, io, sys
from mesoslip.command_line.main import main
answers = {}
for command in (["info"], ["curve"], ["onset"], ["cycle"]):
    sys.argv = ["mesoslip", *command, RUN, "--set", "contacts.softening=0.5"]
    with contextlib.redirect_stderr(io.StringIO()) as printed:
        try:
            main()
        except SystemExit as end:
            answers[command[0]] = end.code == 2 and "contacts.softening" in printed.getvalue()
print(answers)
"""
    expected = {"info": True, "curve": True, "onset": True, "cycle": True}
    assert outcome(program, kind=True) == str(expected)


def test_a_law_of_delays_without_a_theory_is_refused(klein, monkeypatch):
    from mesoslip import ConfigError, SteadySliding
    from mesoslip.theory import delays

    monkeypatch.delitem(delays.LAWS, "exponential")
    config = klein(contacts__delay_law="exponential", contacts__delay=1e-3)
    with pytest.raises(ConfigError, match="delay_law"):
        SteadySliding(config)


def test_interaction_has_no_linear_stability_theory(klein):
    """Until then it was that of contacts without neighbours, without a word."""
    from mesoslip import ConfigError, SteadySliding

    lattice = {"strength": 0.3, "lattice": "triangular", "columns": 60, "rows": 68}
    with pytest.raises(ConfigError, match="interaction"):
        SteadySliding(klein(interaction=lattice))
