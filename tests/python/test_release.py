"""The tools of a release: they find what is wrong, and change all files or none."""

import shutil
import sys
import tomllib

import pytest
from conftest import ROOT, run_program

FILES = [
    *("pyproject.toml", "uv.lock", "CITATION.cff", "codemeta.json", "CHANGELOG.md"),
    "recipe/recipe.yaml",
]


@pytest.fixture
def tree(tmp_path):
    """A folder with the files that have the version."""
    for name in FILES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    changes = tmp_path / "CHANGELOG.md"
    text = changes.read_text()
    before, _, rest = text.partition("## Unreleased\n")
    released = "\n## " + rest.partition("\n## ")[2]
    changes.write_text(f"{before}## Unreleased\n\n### Added\n- A thing.\n{released}")
    (tmp_path / "out" / "docs").mkdir(parents=True)
    return tmp_path


def call(tree, tool, *arguments):
    line = (sys.executable, ROOT / "tools" / tool, *arguments)
    status, printed, errors = run_program(*line, cwd=tree)
    return status, printed + errors


def test_a_version_is_set_everywhere_or_nowhere(tree):
    before = {name: (tree / name).read_bytes() for name in FILES}
    for wrong in (["2.0"], ["2.0.0", "tomorrow"]):
        assert call(tree, "set-version", *wrong)[0] == 1
        assert {name: (tree / name).read_bytes() for name in FILES} == before
    assert "1 changes are unreleased" in call(tree, "release-check", "--only", "version")[1]
    assert call(tree, "set-version", "97.0.1", "2027-01-02") == (0, "")
    assert call(tree, "release-check", "--only", "version") == (0, "version: right\n")
    assert tomllib.loads((tree / "pyproject.toml").read_text())["project"]["version"] == "97.0.1"
    locked = tomllib.loads((tree / "uv.lock").read_text())["package"]
    assert [one["version"] for one in locked if one["name"] == "mesoslip"] == ["97.0.1"]
    assert 'date-released: "2027-01-02"' in (tree / "CITATION.cff").read_text()
    changes = (tree / "CHANGELOG.md").read_text()
    assert "## Unreleased\n\n## 97.0.1 - 2027-01-02\n\n### Added\n- A thing.\n" in changes
    # Once more is an error, which changes nothing.
    assert call(tree, "set-version", "97.0.1")[0] == 1
    assert (tree / "CHANGELOG.md").read_text() == changes
    (tree / "codemeta.json").write_text('{"version": "1.0.0"}')
    assert "codemeta.json does not have" in call(tree, "release-check", "--only", "version")[1]


def test_links_that_lead_nowhere_are_found(tree):
    docs, built = tree / "docs", tree / "out" / "docs"
    docs.mkdir()
    (docs / "a.md").write_text("[b](b.md) [place](a.md#x) [web](https://example.org)\n")
    (built / "a.html").write_text(
        '<a href="#here" id="here"></a><a href="b.html#no"></a><img src="c.png">'
        '<a href="https://example.org/none"></a><a href="b.html#yes"></a>'
    )
    (built / "b.html").write_text('<p id="yes">')
    (tree / "CHANGELOG.md").write_text("[a](docs/a.md)\n```\n[code](none.md)\n```\n")
    status, out = call(tree, "release-check", "--only", "links")
    assert status == 1
    assert out.count("is not there") == 2
    assert "a.md: b.md is not there" in out
    assert "a.html: c.png is not there" in out
    assert "a.html: b.html#no: no such place on the page" in out
    (docs / "b.md").touch()
    (built / "a.html").unlink()
    assert call(tree, "release-check", "--only", "links") == (0, "links: right\n")


def test_the_citation_and_the_licences_of_this_version_are_right():
    assert call(ROOT, "release-check", "--only", "citation", "licences") == (
        0,
        "citation: right\nlicences: right\n",
    )


def test_a_citation_that_lacks_a_key_or_has_no_doi_is_found(tree):
    text = (tree / "CITATION.cff").read_text()
    (tree / "CITATION.cff").write_text(
        text.replace("\nmessage: ", "\nnote: ").replace("doi: 10.", "doi: https://doi.org/10.", 1)
    )
    status, out = call(tree, "release-check", "--only", "citation")
    assert status == 1
    assert "has no message" in out
    assert "is no DOI" in out
