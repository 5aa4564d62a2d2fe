"""What make finds stale: an output after an edit of its run, or of any file that is based on."""

import os
import runpy
import shutil
import sys
from pathlib import Path

import pytest
from conftest import ROOT, long, run_program

# Stands for mesoslip: it states what it is asked to do, and does it by touching the output.
PROGRAM = """#!/bin/sh
echo "$1 $2"
while [ "$1" != -o ]; do shift; done
mkdir -p "$(dirname "$2")"
touch "$2"
"""


@pytest.fixture
def checkout(tmp_path):
    """A checkout with the Makefile, runs of a user and a program; all files are of one age."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    shutil.copytree(ROOT / "tools", tmp_path / "tools")
    (tmp_path / "mesoslip").write_text(PROGRAM)
    (tmp_path / "mesoslip").chmod(0o755)
    (tmp_path / "runs").mkdir()
    shutil.copy(ROOT / "runs" / "campaign.mk", tmp_path / "runs")
    texts = {
        "runs/klein.toml": 'title = "first"\n',
        "runs/slow.toml": "# The first.\nbase = 'klein.toml'  # beside it\n[run]\nseed = 1\n",
        "runs/slower.toml": 'base = "slow.toml"\n[run]\nseed = 2\n',
        "runs/elsewhere.toml": 'base = "../mine/own.toml"\n',
        "runs/other.toml": '[sweep]\nbase = "klein.toml"\n',
        "runs/sweeps/map.toml": 'base = "../slow.toml"\n',
        "runs/source/S20.toml": 'base = "../slow.toml"\n',
        "runs/source/claims/one.toml": 'base = "../S20.toml"\n',
        "mine/own.toml": 'title = "own"\n',
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
        os.utime(tmp_path / name, (1e9, 1e9))
    return tmp_path


def made(checkout, *targets):
    """What the program was asked to do by make."""
    # Nothing is to be installed here.
    make = ("make", "-j2", "-s", "-o", ".venv/.installed", "MESOSLIP=./mesoslip")
    environment = {name: one for name, one in os.environ.items() if not name.startswith("MAKE")}
    status, printed, errors = run_program(
        *make, f"PYTHON={sys.executable}", *targets, cwd=checkout, env=environment
    )
    assert (status, errors) == (0, "")
    return sorted(line for line in printed.splitlines() if "Nothing" not in line)


def edit(checkout, name):
    """A file becomes newer than all outputs."""
    for output in (checkout / "out").iterdir():
        # Pictures are newer than what they show.
        os.utime(output, (1.1e9 + (output.suffix == ".png"),) * 2)
    os.utime(checkout / name, (1.2e9, 1.2e9))


NAMES = ("klein", "slow", "slower", "elsewhere", "other")
OUTPUTS = [f"out/{name}.nc" for name in NAMES]


@pytest.mark.parametrize(
    ("edited", "stale"),
    [
        ("runs/slow.toml", ("slow", "slower")),
        ("mine/own.toml", ("elsewhere",)),
        long("runs/klein.toml", ("klein", "slow", "slower")),
        long("runs/slower.toml", ("slower",)),
        long("runs/other.toml", ("other",)),
    ],
)
def test_an_edit_makes_stale_what_is_based_on_it(checkout, edited, stale):
    assert len(made(checkout, *OUTPUTS)) == len(OUTPUTS)
    assert made(checkout, *OUTPUTS) == []
    edit(checkout, edited)
    assert made(checkout, *OUTPUTS) == sorted(f"run runs/{name}.toml" for name in stale)


def test_pictures_curves_and_onsets_follow(checkout):
    targets = ["out/slower.png", "out/slower.curve.nc", "out/slower.onset.nc"]
    expected = ["curve runs/slower.toml", "onset runs/slower.toml", "plot out/slower.nc"]
    assert made(checkout, *targets) == [*expected, "run runs/slower.toml"]
    assert made(checkout, *targets) == []
    edit(checkout, "runs/klein.toml")
    assert made(checkout, *targets) == [*expected, "run runs/slower.toml"]


def test_sweeps_follow_their_base(checkout):
    target = "out/sweeps/map.nc"
    assert made(checkout, target) == ["sweep runs/sweeps/map.toml"]
    assert made(checkout, target) == []
    os.utime(checkout / target, (1.1e9, 1.1e9))
    os.utime(checkout / "runs/klein.toml", (1.2e9, 1.2e9))
    assert made(checkout, target) == ["sweep runs/sweeps/map.toml"]


def test_runs_of_the_source_have_outputs_beside_others(checkout):
    targets = ["out/S20.nc", "out/claims/one.nc", "out/S20.onset.nc"]
    runs = ["run runs/source/S20.toml", "run runs/source/claims/one.toml"]
    assert made(checkout, *targets) == ["onset runs/source/S20.toml", *runs]
    assert made(checkout, *targets) == []
    for target in targets:
        os.utime(checkout / target, (1.1e9, 1.1e9))
    os.utime(checkout / "runs/klein.toml", (1.2e9, 1.2e9))
    assert made(checkout, *targets) == ["onset runs/source/S20.toml", *runs]


def test_a_changed_chain_counts_at_once(checkout):
    """Of no list that was made before: a base named now, or a run copied with its old date."""
    made(checkout, *OUTPUTS)
    (checkout / "runs/other.toml").write_text('base = "../mine/own.toml"\n')
    (checkout / "runs/copy.toml").write_text('base = "slow.toml"\n')
    os.utime(checkout / "runs/other.toml", (1e9, 1e9))
    os.utime(checkout / "runs/copy.toml", (1e9, 1e9))
    assert made(checkout, "out/copy.nc", "out/other.nc") == ["run runs/copy.toml"]
    edit(checkout, "mine/own.toml")
    assert made(checkout, "out/copy.nc", "out/other.nc") == ["run runs/other.toml"]


@pytest.mark.parametrize(
    "text",
    ["not TOML", 'base = "missing.toml"', 'base = "broken.toml"', "base = 3", 'base = "a\\u0000b"'],
)
def test_what_cannot_be_read_is_left_to_the_program(checkout, text):
    (checkout / "runs/broken.toml").write_text(text)
    assert made(checkout, "out/broken.nc") == ["run runs/broken.toml"]


DOC_PICTURES = runpy.run_path(str(ROOT / "tools" / "doc-pictures"))


def test_no_picture_of_the_documentation_is_stale():
    """Each is made by commands, whose files are those with which it was drawn."""
    assert set(DOC_PICTURES["pictures"]()) == {path.stem for path in (ROOT / "docs").glob("*.png")}
    assert DOC_PICTURES["stale"]() == [], "make doc-pictures, or tools/doc-pictures --record"


@pytest.mark.parametrize(
    ("edited", "old", "new"),
    [
        ("runs/own.toml", "1", "2"),
        ("runs/base.toml", "1", "2"),
        ("docs/page.md", "3", "4"),
        ("docs/pictures.toml", "draw", "draw anew"),
    ],
)
def test_an_edit_of_what_a_picture_shows_makes_it_stale(tmp_path, edited, old, new):
    texts = {
        "runs/own.toml": 'base = "base.toml"\na = 1\n',
        "runs/base.toml": "b = 1\n",
        "docs/page.md": "A page.\n\n```toml\n# block.toml\nc = 3\n```\n",
        "docs/pictures.toml": '[one]\ncommands = ["draw"]\n'
        'sources = ["runs/own.toml", "docs/page.md#block.toml"]\n',
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    (one,) = DOC_PICTURES["pictures"](tmp_path).values()
    (tmp_path / "docs/pictures.lock").write_text(f"one {DOC_PICTURES['hash_of'](tmp_path, one)}\n")
    assert DOC_PICTURES["stale"](tmp_path) == []
    # What the page says elsewhere does not count.
    (tmp_path / "docs/page.md").write_text(f"Another {texts['docs/page.md']}")
    assert DOC_PICTURES["stale"](tmp_path) == []
    (tmp_path / edited).write_text(texts[edited].replace(old, new))
    assert DOC_PICTURES["stale"](tmp_path) == ["one"]


def test_the_runs_of_this_repository():
    """Their chains end with Klein's case or that of an interface, or they stand alone."""
    _, printed, _ = run_program(sys.executable, "tools/bases", "runs", cwd=ROOT)
    chains: dict[str, list[str]] = {}
    for line in printed.splitlines():
        run, base = line.split(">")
        chains.setdefault(run, []).append(base)
    for path in sorted((ROOT / "runs").glob("*.toml")):
        chain = chains.get(f"runs/{path.name}", [])
        assert bool(chain) == ("\nbase = " in "\n" + path.read_text())
        assert not chain or chain[-1] in {"runs/klein.toml", "runs/precursors.toml"}
    chain = ["runs/source/limit-me.toml", "runs/klein.toml"]
    assert [Path(one).resolve() for one in chains["runs/source/limit-2.toml"]] == [
        (ROOT / one).resolve() for one in chain
    ]
