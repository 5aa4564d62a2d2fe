"""Methods paragraphs of reports: what they say of a configuration, and their references."""

import re

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import ROOT
from kinds import KINDS, configuration
from mesoslip.configuration.differences import in_one_unit
from mesoslip.output.kinds import KINDS as OUTPUTS
from mesoslip.reports.content import Subject
from mesoslip.reports.method_paragraphs import METHODS, curve_method, onset_method, run_method
from mesoslip.reports.references import CITATION, PROGRAM, REFERENCES, numbered
from mesoslip.reports.sections.origin import methods


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_paragraph(kind):
    config = configuration(kind)
    tree = xr.DataTree(xr.Dataset(attrs={"energy_residual": 2.2e-13}))
    for write in (run_method, curve_method, onset_method):
        text = " ".join(write(tree, config))
        cited = {key.strip(" @") for found in CITATION.findall(text) for key in found.split(";")}
        assert cited <= {PROGRAM, *REFERENCES}
        assert {PROGRAM, "braun2011"} <= cited
        assert "None" not in text
        assert "  " not in text
        assert text.endswith(".")
    text = " ".join(run_method(tree, config))
    assert ("infinitely many" in text) == (config.run.engine == "me")
    assert (f"N = {config.contacts.count}" in text) == (config.run.engine == "eq")
    assert ("grow with age" in text or "of young" in text) == (config.contacts.ageing is not None)
    assert ("ω_0" in text) == (config.contacts.thermal is not None)
    assert ("lattice of" in text) == (config.interaction is not None)
    assert "2e-13 of the work" in text


def test_every_kind_of_output_has_a_paragraph():
    assert set(METHODS) == set(OUTPUTS)


def test_numbers_of_kleins_case():
    config = mesoslip.Config.load(ROOT / "runs" / "klein.toml")
    text = " ".join(run_method(xr.DataTree(), config))
    for part in ("N = 4080", "18 µN", "2 kN/m", "η = 2e11 1/s", "τ_d = 500 µs", "f_b = 0.1 f_s"):
        assert part in text
    for part in ("gaussian law", "of 0.01", "1.47 g", "97 N/m", "η_S = 51.3", "100 nm/s for 12 s"):
        assert part in text


def text_of(kind, config, **attributes):
    """The paragraph of a kind of output that has a configuration and attributes."""
    coordinates = attributes.pop("coordinates", {})
    return " ".join(
        METHODS[kind](xr.DataTree(xr.Dataset(coords=coordinates, attrs=attributes)), config)
    )


@pytest.fixture(scope="module")
def config():
    return mesoslip.Config.load(ROOT / "runs" / "klein.toml")


def test_slow_sliding_and_onset_have_no_delay(config):
    """What curve and onset leave out is not said to be in them; steady sliding has no start."""
    for kind in ("curve", "onset"):
        text = text_of(kind, config, error=6.6e-14)
        assert "breaks, and attaches again at once" in text
        assert "τ_d" not in text
        assert "At the start no contact bears a force." in text
    assert "an estimated error of 7e-14 of the static force" in text_of(
        "curve", config, error=7e-14
    )
    assert "melts at once and is dragged at the rate η = 2e11 1/s" in text_of("onset", config)
    steady = text_of("steady", config, coordinates={"velocity": [1e-10, 1e-4]})
    assert "At the start" not in steady
    assert "τ_d = 500 µs" in steady
    assert steady.endswith("Velocities are from 100 pm/s to 100 µm/s.")


def test_a_continued_cycle_has_no_start_of_its_own(config):
    settled = {"settled_motion": "smooth"}
    assert "At the start" in text_of("cycle", config, **settled)
    text = text_of("cycle", config, continued="true", **settled)
    assert "from the state of an earlier cycle, until the oscillation had decayed" in text
    assert "At the start" not in text


def test_a_sweep_names_its_keys(config):
    at = {"contacts.delay": [1e-4, 1e-3], "direction": ["up", "down"], "realization": [0, 1]}
    text = text_of("sweep", config, coordinates=at)
    assert "Varied were contacts.delay, up and down, with 2 realizations each;" in text


def test_a_run_that_ended_early_does_not_last_as_long_as_its_drive(config):
    times = {"time": [0.0, 1.0, 3.0]}
    text = text_of("run", config, coordinates=times, ending="number of slips reached")
    assert "for 12 s. It ended at 3 s: number of slips reached." in text
    text = text_of("run", config, coordinates=times, ending="", complete="false")
    assert "It ended at 3 s: it was interrupted." in text
    whole = text_of("run", config, coordinates={"time": [0.0, 12.0]}, ending="end of the drive")
    assert "ended" not in whole
    endless = config.replace("run.duration=none", "run.avalanches=10", "slider.kind=quasistatic")
    assert "until a condition is met." in text_of("run", endless)


def test_thresholds_of_a_table_follow_no_law(config):
    table = config.replace({"contacts.threshold": {"law": "table", "samples": [1.0, 1.5, 2.0]}})
    text = text_of("run", table)
    assert "their thresholds are those of a table of samples, with" in text
    assert "table law" not in text


def test_references_are_numbered_in_their_order():
    text, keys = numbered("A [@b; @a]. B [@c] and [@a].", ["c"])
    assert text == "A [2, 3]. B [1] and [3]."
    assert keys == ["c", "b", "a"]


def test_references_are_those_of_the_paper_and_of_the_citation_file():
    """One record of each reference: titles, years, volumes and addresses agree."""
    bib = (ROOT / "paper" / "paper.bib").read_text()
    entries = dict(re.findall(r"@\w+\{(\w+),(.*?)\n\}", bib, re.DOTALL))
    common = set(entries) & set(REFERENCES)
    assert len(common) >= 4
    for key in common:
        for name, text in REFERENCES[key].fields.items():
            assert f"{{{text}}}" in entries[key], (key, name)
    citation = (ROOT / "CITATION.cff").read_text()
    listed = re.findall(r"title: (.*)\n", citation.partition("references:")[2])
    assert set(listed) <= {one.fields["title"] for one in REFERENCES.values()}
    assert all(one.line.endswith(".") and "{" not in one.line for one in REFERENCES.values())


def test_a_section_has_the_program_and_each_reference_once(klein):
    near = {"curve": {"length": 3 * klein().contacts.break_stretch}}
    first = mesoslip.curve(klein(**near))
    other = mesoslip.curve(klein(**near, contacts__threshold__relative_width=0.02))
    section = methods([Subject("a", first), Subject("b", other)])
    texts = [block.text for block in section.blocks]
    assert "The output b differs in contacts.threshold.relative_width = 0.02." in texts
    listed = [text for text in texts if re.match(r"\[\d+\] ", text)]
    assert [int(text[1]) for text in listed] == list(range(1, len(listed) + 1))
    (own,) = (text for text in listed if "the mesoslip developers" in text)
    assert f"version {first.attrs['program_version']}, commit {first.attrs['commit']}" in own
    assert section.blocks[-1].text.count("@") == len(listed)


def test_values_of_a_key_are_in_one_unit():
    assert in_one_unit("contacts.delay", [1e-3, 5e-5, None]) == (
        "contacts.delay (ms)",
        ("1", "0.05", "not given"),
    )
    assert in_one_unit("contacts.count", [10, 2000]) == ("contacts.count", ("10", "2000"))
    assert in_one_unit("slider.kind", ["rigid", None])[1] == ("rigid", "not given")
    assert in_one_unit("output.layers", [True, False])[1] == ("true", "false")
    assert in_one_unit("output.snapshots", [[0.25, 1.5], []]) == (
        "output.snapshots (s)",
        ("[0.25, 1.5]", "[]"),
    )
    values = np.geomspace(1e-4, 1e-2, 3).tolist()
    assert in_one_unit("contacts.delay", values)[1] == ("0.1", "1", "10")
