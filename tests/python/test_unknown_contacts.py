"""A kind of contacts that nobody knows is refused, not taken for another one.

The key `contacts.softening` is planted into the configuration of a program of its own. What has no
answer for it has to say so: kinds of the kernel, theories, reports.
"""

import json
import os
import sys

import pytest
from conftest import ROOT, run_program

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
config = mesoslip.Config.load(RUN, ["contacts.softening=0.5", "run.duration=1 s"])
"""


def outcome(code: str, *, kind: bool) -> str:
    """The last line of what a program with the planted key prints, errors included."""
    run = str(ROOT / "runs" / "klein.toml")
    start = f"KIND, RUN = {kind}, {run!r}"
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    line = (sys.executable, "-c", start + PLANT + code)
    _, printed, errors = run_program(*line, env=environment)
    return (errors or printed).strip().splitlines()[-1]


def test_a_key_without_a_kind_is_an_error_of_the_configuration():
    printed = outcome(RUN, kind=False)
    assert "contacts.softening: is not known to contacts of the kind" in printed


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


# What commands answer, and the other engine, of which it is no kind.
COMMANDS = """
import contextlib, io, sys
from mesoslip.command_line.main import main
for command in (["info"], ["curve"], ["onset"], ["cycle"]):
    sys.argv = ["mesoslip", *command, RUN, "--set", "contacts.softening=0.5"]
    with contextlib.redirect_stderr(io.StringIO()) as printed:
        try:
            main()
        except SystemExit as end:
            if end.code == 2:
                answers[f'mesoslip {command[0]}'] = printed.getvalue()
try:
    config.replace("run.engine=me")
except mesoslip.ConfigError as error:
    answers["me"] = str(error)
print(json.dumps(answers))
"""


def test_a_kind_without_a_theory_is_refused_by_every_question_and_command(tmp_path):
    """All are asked in one program, as each start takes half a second."""
    lines = ["import json", RUN, f"OUT = {str(tmp_path / 'report.html')!r}", "answers = {}"]
    for name, question in QUESTIONS.items():
        lines += [
            "try:",
            f"    {question}",
            "except mesoslip.MesoslipError as error:",
            f"    answers[{name!r}] = str(error)",
        ]
    lines += [
        "from mesoslip.theory.steady_sliding import steady_sliding",
        "assert steady_sliding(config, 10**6) is None",
        "assert isinstance(config.contact_kind, SofteningContacts)",
        COMMANDS,
    ]
    answers = json.loads(outcome("\n".join(lines), kind=True))
    commands = {f"mesoslip {one}" for one in ("info", "curve", "onset", "cycle")}
    assert answers.keys() == {*QUESTIONS, *commands, "me"}
    assert all("contacts.softening" in one for one in answers.values()), answers
    assert 'is not known to contacts of the kind "populations"' in answers["me"]


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
