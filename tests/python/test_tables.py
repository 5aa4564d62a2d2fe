"""Tables as files: one writer for values in SI, Markdown and LaTeX."""

import csv

import mesoslip
import pytest
from conftest import ROOT
from mesoslip.output.table_files import PrintedTable, latex, markdown, write_printed
from mesoslip.output.writing import write

OLD = ROOT / "tests" / "reference" / "old.nc"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """An output with slips."""
    path = tmp_path_factory.mktemp("run") / "run.nc"
    klein = ROOT / "runs" / "klein.toml"
    changes = ["run.duration=4.2 s", "contacts.count=200"]
    write(mesoslip.run(mesoslip.Config.load(klein, changes)), path)
    return path


def cells(line):
    return [one.strip() for one in line.strip("|").split("|")]


def test_slips_for_a_spreadsheet_and_for_print(run, tmp_path, command):
    for name in ("s.csv", "s.md", "s.tex"):
        assert command("slips", run, "--table", tmp_path / name)[0] == 0
    rows = list(csv.reader((tmp_path / "s.csv").read_text().splitlines()))
    title, _, head, marks, *printed = (tmp_path / "s.md").read_text().splitlines()
    assert title == "**Slips**"
    assert set("".join(cells(marks))) == {":", "-"}
    assert len(printed) == len(rows) - 1 == 2
    # The same numbers, in the unit of the header.
    drop = cells(head).index("force drop (µN)")
    exact = [float(one[rows[0].index("force_drop [N]")]) for one in rows[1:]]
    assert [float(cells(one)[drop]) for one in printed] == pytest.approx(
        [one * 1e6 for one in exact], rel=1e-4
    )
    text = (tmp_path / "s.tex").read_text()
    assert text.count(r"\\") == len(rows)
    assert r"force drop (\textmu{}N)" in text
    for mark in (r"\toprule", r"\midrule", r"\bottomrule", r"\usepackage{booktabs}"):
        assert mark in text
    columns = text[text.index("{tabular}{") + 10 :].partition("}")[0]
    assert all(one.count("&") == len(columns) - 1 for one in text.splitlines() if "&" in one)
    assert command("slips", run, "--csv", tmp_path / "t.csv")[0] == 0
    assert (tmp_path / "t.csv").read_bytes() == (tmp_path / "s.csv").read_bytes()
    for name in ("s.csv", "s.md", "s.tex"):
        mesoslip.write_table(mesoslip.slips(run), tmp_path / f"python.{name}")
        assert (tmp_path / f"python.{name}").read_text() == (tmp_path / name).read_text()


def test_statistics_have_the_digits_of_their_deviation(run, command):
    statistics = command("slips", run)[1].partition("\n\n")[2].splitlines()
    exact = mesoslip.slips(run)["force_drop"].values * 1e6
    line = next(one for one in statistics if one.lstrip().startswith("force drop (µN)"))
    mean, deviation, low, high = line.split()[-4:]
    decimals = len(deviation.partition(".")[2])
    assert float(deviation) == pytest.approx(exact.std(), rel=0.05)
    assert (mean, low, high) == tuple(
        f"{one:.{decimals}f}" for one in (exact.mean(), exact.min(), exact.max())
    )


def test_responses_and_avalanches(run, tmp_path, command):
    path = tmp_path / "r.md"
    assert command("response", run, "--no-fit", "--table", path)[0] == 0
    assert "**Steady sliding**" in path.read_text()
    path = tmp_path / "a.md"
    assert command("avalanches", OLD, "--table", path)[0] == 0
    lines = path.read_text().splitlines()
    count = mesoslip.avalanches(OLD).sizes["avalanche"]
    assert len(lines) == 4 + count
    mesoslip.write_table(mesoslip.avalanches(OLD), tmp_path / "python.md")
    assert (tmp_path / "python.md").read_text() == path.read_text()
    found = mesoslip.response(run, fit=False)
    mesoslip.write_table(found, tmp_path / "python.tex")
    assert "Steady sliding" in (tmp_path / "python.tex").read_text()
    with pytest.raises(
        mesoslip.FileError, match=r"what mesoslip[.]slips, avalanches, response, strokes, plateaus"
    ):
        mesoslip.write_table(mesoslip.derived(run), tmp_path / "python.md")
    status, _, error = command("slips", run, "--table", run)
    assert status != 0
    assert "run.nc" in error


def test_signs_of_latex_are_written(tmp_path):
    odd = PrintedTable("t", ("ΔAIC", "p"), (("inf", "< 0.001"), ("6.8e-31", "(2.0 ± 0.1)e7")))
    lines = latex(odd).splitlines()
    assert lines[2] == r"$\Delta$AIC & p \\"
    assert lines[4] == r"$\infty$ & $<$ 0.001 \\"
    assert lines[5] == r"6.8$\times 10^{-31}$ & (2.0 $\pm$ 0.1)$\times 10^{7}$ \\"
    table = PrintedTable("t", ("D_c (µm)", "a - b"), (("1.0 ± 0.2", "5 % & #"),))
    assert latex(table).splitlines()[2] == r"$D_c$ (\textmu{}m) & $a - b$ \\"
    assert latex(table).splitlines()[4] == r"1.0 $\pm$ 0.2 & 5 \% \& \# \\"
    assert markdown(table).splitlines()[-1] == "| 1.0 ± 0.2 | 5 % & # |"
    with pytest.raises(mesoslip.FileError):
        write_printed([table], tmp_path)
