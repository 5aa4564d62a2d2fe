"""The house: dependencies point one way, and nobody outside its room asks for a kind."""

from __future__ import annotations

import ast
import os
import re
import shutil
import sys
from pathlib import Path

import mesoslip
import mutants
import numpy as np
import pytest
from conftest import ROOT, run_program
from kinds import KINDS as RUNS
from kinds import configuration
from mesoslip.configuration import contacts
from mesoslip.configuration.contacts.tables.contacts import Contacts
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.configuration.threshold_laws import LAWS
from scipy.sparse import csgraph

FORTRAN = ROOT / "fortran"
# Each may use those before it; contacts and sliders do not know each other, nor does theory know
# what moves or is recorded.
MAY_USE: dict[str, set[str]] = {
    "numerics": set(),
    "extremes": {"numerics"},
    "normal_load": {"numerics"},
    "interface_law": {"numerics"},
    "track_strength": {"numerics"},
    "ageing_law": {"numerics"},
    "motion_prediction": {"numerics", "interface_law", "ageing_law"},
    "schedule": {
        *("numerics", "interface_law", "track_strength"),
        *("ageing_law", "motion_prediction"),
    },
    "step_filter": {"numerics"},
    "drive": {"numerics", "extremes"},
    "contacts": {
        *("numerics", "interface_law", "track_strength", "schedule", "normal_load"),
        *("ageing_law", "motion_prediction"),
    },
    "sliders": {"numerics", "interface_law", "schedule", "step_filter", "drive"},
    "recording": {
        *("numerics", "interface_law", "schedule", "step_filter", "drive"),
        *("contacts", "sliders"),
    },
    "theory": {"numerics", "contacts"},
    "loop": {
        *("numerics", "interface_law", "schedule", "step_filter", "drive"),
        *("contacts", "sliders", "recording"),
    },
    "boundary": {
        *("numerics", "track_strength", "contacts", "sliders", "recording", "theory", "loop"),
    },
}
# The lists of kinds stand beside their folders: what is in a folder does not know them.
KINDS = {"mesoslip_contacts", "mesoslip_sliders"}


def room_of(module: str) -> str:
    """The folder of a module, or its own name if it stands beside the folders."""
    name = module.removeprefix("mesoslip_")
    return next(room for room in MAY_USE if name == room or name.startswith(f"{room}_"))


def sources() -> list[Path]:
    return sorted([*FORTRAN.rglob("*.f90"), *FORTRAN.rglob("*.f90.in")])


def used(path: Path) -> set[str]:
    return set(re.findall(r"^\s*use\s+(mesoslip_\w+)", path.read_text(), re.MULTILINE))


def room_of_file(path: Path) -> str:
    relative = path.relative_to(FORTRAN)
    return relative.parts[0] if len(relative.parts) > 1 else relative.name.split(".")[0]


def wrong_uses(path: Path, modules: set[str]) -> list[str]:
    """The modules that a file must not use."""
    room = room_of_file(path)
    return [
        module
        for module in sorted(modules)
        if room_of(module) not in {room, *MAY_USE[room]} or (module in KINDS and room != "boundary")
    ]


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.name)
def test_fortran_uses_what_comes_before(path):
    assert wrong_uses(path, used(path)) == []


@pytest.mark.parametrize(
    ("file", "module"),
    [
        ("contacts/base.f90", "mesoslip_sliders_base"),
        ("contacts/base.f90", "mesoslip_contacts"),
        ("sliders/base.f90", "mesoslip_contacts_base"),
        ("sliders/base.f90", "mesoslip_recording_buffer"),
        ("recording/buffer.f90", "mesoslip_theory_lives"),
        ("recording/buffer.f90", "mesoslip_loop_simulation"),
        ("theory/lives.f90", "mesoslip_sliders_base"),
        ("theory/lives.f90", "mesoslip_recording_buffer"),
        ("theory/lives.f90", "mesoslip_loop_simulation"),
        ("loop/simulation.f90", "mesoslip_theory_lives"),
        ("loop/simulation.f90", "mesoslip_boundary_handles"),
        ("numerics/kinds.f90", "mesoslip_interface_law"),
    ],
)
def test_siblings_and_those_behind_are_not_used(file, module):
    """Each of these uses would be found."""
    path = FORTRAN / file
    assert path.exists()
    assert module in modules_of(module)
    assert wrong_uses(path, {module}) == [module]


def modules_of(module: str) -> set[str]:
    """The modules of the files of a room."""
    room = room_of(module)
    texts = (path.read_text() for path in sources() if room_of_file(path) == room)
    return {name for text in texts for name in re.findall(r"^module\s+(\w+)", text, re.MULTILINE)}


def listed(folder: Path) -> set[str]:
    """The sources that the build of a folder lists."""
    build = folder / "meson.build"
    text = re.sub(r"#.*", "", build.read_text()) if build.exists() else ""
    return set(re.findall(r"'([\w.]+\.f90(?:\.in)?)'", text))


@pytest.mark.parametrize(
    "folder",
    sorted({path.parent for path in sources()}),
    ids=lambda folder: str(folder.relative_to(ROOT)),
)
def test_fortran_files_are_listed_in_their_build(folder):
    assert {path.name for path in folder.glob("*.f90*")} <= listed(folder)
    if folder != FORTRAN:
        above = (folder.parent / "meson.build").read_text()
        assert f"subdir('{folder.name}')" in above


def test_python_files_are_listed_in_their_build():
    """A file that is not would be missing in the wheel."""
    package = ROOT / "python" / "mesoslip"
    text = (ROOT / "python" / "meson.build").read_text()
    named = text[text.index("package = {") :]
    built = {
        str(Path(folder) / name)
        for folder, names in re.findall(r"'([\w./]+)': \[(.*?)\]", named, re.DOTALL)
        for name in re.findall(r"'([\w.]+)'", names)
    }
    there = {
        str(path.relative_to(package))
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".in"
    }
    assert built == there


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.name)
def test_fortran_modules_are_named_after_their_path(path):
    modules = re.findall(r"^module\s+(\w+)", path.read_text(), re.MULTILINE)
    relative = path.relative_to(FORTRAN)
    named = "mesoslip_" + "_".join([*relative.parts[:-1], relative.name.split(".")[0]])
    for module in modules:
        if module.startswith("mesoslip_"):
            assert named == module


def test_bases_do_not_know_their_children():
    for folder in ("contacts", "sliders"):
        for module in used(FORTRAN / folder / "base.f90"):
            extended = FORTRAN.joinpath(*module.removeprefix("mesoslip_").split("_", 1))
            text = extended.with_suffix(".f90")
            if text.exists():
                assert f"extends({folder.rstrip('s')}" not in text.read_text()


def test_fortran_states_are_not_saved():
    """Modules hold no state: simulations on different threads are independent."""
    for path in sources():
        text = path.read_text()
        if not re.search(r"^module", text, re.MULTILINE):
            continue
        head = re.split(r"^contains", text, maxsplit=1, flags=re.MULTILINE)[0]
        blocks = r"^\s*(?:abstract )?(type|interface)\b(?!\s*\().*?^\s*end \1"
        outside = re.sub(blocks, "", head, flags=re.MULTILINE | re.DOTALL)
        for line in outside.splitlines():
            declared = re.match(r"\s*(integer|real|logical|character|type\(|class\()", line)
            # What counts in a constant array is no state.
            is_constant = "parameter" in line or line.strip() == "integer :: i"
            assert not declared or is_constant, f"{path}: {line}"
        assert not re.search(r"^\s*save\b|,\s*save\b", text, re.MULTILINE), path


IMPORT_LINTER = Path(sys.executable).with_name("lint-imports")


def test_python_imports_point_one_way():
    status, printed, _ = run_program(IMPORT_LINTER, "--no-cache", cwd=ROOT)
    assert status == 0, printed


# A line that asks whether contacts have a feature: by its table, or by the name of that.
FEATURE = r"(ageing|thermal|activated|interaction|load|track)"
FEATURE_FLAG = (
    rf"\b{FEATURE}\s+(is|==|!=)\s|\b{FEATURE}\s*[!=]=\s*None"
    rf"|\b(if|elif|and|or|not|bool\()\s*(not )?\(?(\w+\.)+{FEATURE}\s*(:|\)|$|and\b|or\b|else\b)"
    rf"|[gh](et|as)attr\([^)]*[\"']{FEATURE}[\"']"
)


@pytest.mark.parametrize(
    "pattern",
    [
        r"isinstance\([^)]*(Slider|Contacts)\b",
        r"\bkind\s*[!=]=\s*[\"'](rigid|layered|prescribed|quasistatic)",
        r"\bengine\s*[!=]=\s*[\"'](eq|me)",
        FEATURE_FLAG,
    ],
)
def test_nobody_asks_for_a_kind(pattern):
    """Kinds answer what others want to know; only their own rooms know which they are."""
    package = ROOT / "python" / "mesoslip"
    asking = [
        f"{path.relative_to(package)}: {line.strip()}"
        for path in package.rglob("*.py")
        if not {"sliders", "contacts"} & set(path.relative_to(package).parts)
        for line in path.read_text().splitlines()
        if re.search(pattern, line)
    ]
    assert asking == []


@pytest.mark.parametrize(
    "planted",
    [
        "if config.contacts.ageing is not None:",
        "thermal = 1 if contacts.thermal is None else 2",
        "if self.config.interaction:",
        "return not config.contacts.thermal",
        "x = bool(contacts.ageing)",
        'if getattr(contacts, "ageing", None):',
        "if contacts.load != None:",
    ],
)
def test_a_planted_flag_of_a_kind_is_found(planted):
    assert re.search(FEATURE_FLAG, planted)


def test_sliders_are_the_same_on_both_sides():
    """A kind of slider that the build does not name, or that no configuration asks for."""
    room = FORTRAN / "sliders"
    named = re.search(r"slider_kinds = \[(.*?)\]", (room / "meson.build").read_text(), re.DOTALL)
    kinds = sorted(re.findall(r"'(\w+)\.f90'", named[1]))
    made = r"subroutine make_slider_(\w+)\("
    assert kinds == sorted(
        kind for path in room.rglob("*.f90") for kind in re.findall(made, path.read_text())
    )
    configured = (ROOT / "python/mesoslip/configuration/sliders").glob("*.py")
    asked = {kind for path in configured for kind in re.findall(r"\"(\w+)\"", path.read_text())}
    assert not set(kinds) - asked
    assert not set(SLIDERS) - set(kinds)


def test_kinds_of_contacts_are_the_same_on_both_sides():
    """A kind that a list forgets, a key that no kind answers, and a kernel that nobody asks for."""
    text = (FORTRAN / "contacts.f90").read_text()
    made = r"subroutine (make_(?:contact_)?\w+)\(contacts, common, parameters"
    makers = {
        name
        for path in (FORTRAN / "contacts").rglob("*.f90")
        for name in re.findall(made, path.read_text())
    }
    assert len(makers) > 5
    assert makers == set(re.findall(r"call (make_\w+)\(contacts,", text))
    kinds = {kind.kernel_kind for kind in contacts.KINDS}
    assert kinds == set(re.findall(r'^ +case \("([\w ]+)"\)', text, re.MULTILINE))
    room = Path(contacts.__file__).parent
    classes = r"^    kernel_kind: ClassVar\[str\] = \"([\w ]+)\""
    assert kinds == {
        name
        for path in room.glob("*.py")
        for name in re.findall(classes, path.read_text(), re.MULTILINE)
    }
    answered = contacts.COMMON_KEYS.union(*(one.features | one.options for one in contacts.KINDS))
    assert {f"contacts.{key}" for key in Contacts.model_fields} <= answered


def test_short_runs_have_every_kind():
    """What must hold of all kinds is tested with them: resuming, drives, reports, pictures."""
    runs = [configuration(kind) for kind in RUNS]
    assert {one.contact_kind.kernel_kind for one in runs} == {
        kind.kernel_kind for kind in contacts.KINDS
    }
    assert {one.slider.kind for one in runs} == set(SLIDERS)
    assert {one.contacts.threshold.law for one in runs} >= {"gaussian", "table"}


def test_procedures_in_fortran_are_short():
    """None has more than 100 lines."""
    kind = "(?:subroutine|function)"
    procedure = re.compile(
        rf"^ {{3}}(?:pure |elemental )*{kind} (\w+).*?^ {{3}}end {kind}", re.MULTILINE | re.DOTALL
    )
    lines = {
        f"{path.name}: {found[1]}": found[0].count("\n") + 1
        for path in sources()
        for found in procedure.finditer(path.read_text())
    }
    assert len(lines) > 300
    assert not {name: length for name, length in lines.items() if length > 100}


def test_threshold_laws_are_the_same_on_both_sides():
    """What the list of either side forgets, nobody can ask for."""
    room = FORTRAN / "contacts" / "threshold_laws"
    named = re.search(r"threshold_laws = \[(.*?)\]", (room / "meson.build").read_text(), re.DOTALL)
    cases = re.findall(r"'(\w+)\.f90'", named[1])
    configured = ROOT / "python" / "mesoslip" / "configuration" / "threshold_laws"
    for files in (room.glob("*.f90"), configured.glob("*.py")):
        assert sorted(cases) == sorted({path.stem for path in files} - {"base", "__init__"})
    assert sorted(cases) == sorted(LAWS)


# Wrong imports that were made: a file of the room that may not, and what it imports.
PLANTS = {
    "explorer": "campaign.sweep_plan",
    "campaign": "reports.report",
    "theory": "measured.trace",
    "analysis": "theory.lives",
    "inference": "measured.trace",
    "plots": "inference.fit_plan",
    "reports": "explorer.server",
    "output": "analysis.slips",
    "simulation": "output.layout",
    "configuration": "simulation.kernel",
}


def test_wrong_imports_of_python_are_found(tmp_path):
    """In a copy of the package with a wrong import in each room."""
    package = tmp_path / "mesoslip"
    shutil.copytree(Path(mesoslip.__file__).parent, package)
    for room, module in PLANTS.items():
        (package / room / "planted.py").write_text(f"import mesoslip.{module}\n")
    line = (IMPORT_LINTER, "--no-cache", "--config", ROOT / "pyproject.toml")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    status, printed, _ = run_program(*line, cwd=tmp_path, env=environment)
    assert status == 1
    for room, module in PLANTS.items():
        assert f"mesoslip.{room}.planted -> mesoslip.{module}" in printed, room


def test_mutants_are_of_these_sources():
    """The text that each replaces stands once in its source, and its tests are there."""
    for one in mutants.load(mutants.LIST):
        assert not one.mistake(), one.label
        for test in one.tests:
            assert (ROOT / test.split("::")[0]).is_file(), test


def imports_of(path: Path, package: Path) -> set[str]:
    """Modules of the package that a file imports, also in functions, but not for types alone."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = [ast.Pass()]
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
    found = set()
    for name in names:
        inner = package.joinpath(*name.split(".")[1:])
        for file in (inner.with_suffix(".py"), inner / "__init__.py"):
            if name.startswith("mesoslip.") and file.is_file():
                found.add(file.relative_to(package).as_posix())
    return found


def circles(imports: dict[str, set[str]]) -> list[list[str]]:
    """Groups of files that import each other, in a room or across rooms."""
    files = sorted(imports)
    places = {name: place for place, name in enumerate(files)}
    links = np.zeros((len(files), len(files)))
    for name in files:
        for other in imports[name] - {name}:
            links[places[name], places[other]] = 1
    count, label = csgraph.connected_components(links, connection="strong")
    groups = [[files[i] for i in np.flatnonzero(label == one)] for one in range(count)]
    return [one for one in groups if len(one) > 1]


def test_no_files_import_each_other(tmp_path):
    package = ROOT / "python" / "mesoslip"
    imports = {
        path.relative_to(package).as_posix(): imports_of(path, package)
        for path in package.rglob("*.py")
    }
    assert circles(imports) == []
    planted = tmp_path / "style.py"
    text = (package / "plots" / "style.py").read_text()
    planted.write_text(f"{text}\n\ndef planted():\n    import mesoslip.plots.plot\n")
    (found,) = circles(imports | {"plots/style.py": imports_of(planted, package)})
    assert {"plots/style.py", "plots/plot.py"} <= set(found)


@pytest.mark.parametrize("folder", ["fit", "measured", "sweeps", "maps"])
def test_examples_are_installed_with_their_data(folder):
    text = (ROOT / "runs" / "meson.build").read_text()
    listed = re.search(rf"'{folder}': \[(.*?)\]", text, re.DOTALL)[1]
    names = {one.name for one in (ROOT / "runs" / folder).iterdir() if one.is_file()}
    assert set(re.findall(r"'(.*?)'", listed)) == names
