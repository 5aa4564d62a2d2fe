"""What crosses the boundary to Fortran, by its name on both sides."""

import ast
import re
import sys
from dataclasses import fields

import pytest
from conftest import ROOT, python
from kinds import KINDS, configuration
from mesoslip import _core
from mesoslip.configuration.contacts.tables import ageing, contacts, interaction
from mesoslip.configuration.sliders.layered import SOLVERS
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.errors import RunError
from mesoslip.memory_limit import RESERVE
from mesoslip.output import variables
from mesoslip.simulation import recorded_tables as tables
from mesoslip.simulation.kernel import Kernel, name_list
from mesoslip.simulation.kernel_setup import KernelSetup
from mesoslip.simulation.realization import ENDINGS
from mesoslip.theory.lives import Scales
from mesoslip.theory.slip_onset import EQUATIONS, Onset

NAMES = {
    "ageing_laws": ageing.AGEING_LAWS,
    "couplings": contacts.COUPLINGS,
    "delay_laws": contacts.DELAY_LAWS,
    "endings": tuple(ENDINGS)[1:],
    "equations": EQUATIONS,
    "initial_states": contacts.INITIAL_STATES,
    "lattices": interaction.LATTICES,
    "onset": tuple(one.name for one in fields(Onset))[:4],
    "scales": Scales._fields,
    "solvers": SOLVERS,
}


@pytest.mark.parametrize("which", NAMES)
def test_kinds_have_one_name_on_both_sides(which):
    assert name_list(which) == NAMES[which]


def test_threshold_laws_have_one_name_on_both_sides():
    assert sorted(name_list("threshold_laws")) == sorted(LAWS)


@pytest.mark.parametrize(
    ("columns", "group", "others"),
    [
        (tables.TRACE_COLUMNS, variables.ROOT, set()),
        (name_list("slip_trace"), variables.SLIP_TRACES, {"time"}),
        (tables.SLIP_COLUMNS, variables.SLIPS, {"slip"}),
        (tables.STAGE_COLUMNS, variables.STAGES, set()),
        (tables.AVALANCHE_COLUMNS, variables.AVALANCHES, {"time"}),
        (tables.SNAPSHOT_COLUMNS, variables.SNAPSHOTS, {"time", "size"}),
        (tables.SNAPSHOT_NUMBERS, variables.SNAPSHOTS, set()),
        (tables.ENERGY_COLUMNS, variables.ENERGY, {"gross_work", "residual"}),
    ],
)
def test_columns_are_variables_of_outputs(columns, group, others):
    """But for those that have another name there."""
    assert {name for name in columns if name not in group} == others


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"stiffness": 1.0, "mass": 1.0}, "parameter 'damping' is missing"),
        ({"stiffness": 1.0, "mass": "heavy", "damping": 0.0}, "must be a number, not 'heavy'"),
        ({"stiffness": 1.0, "mass": 1.0, "damping": 0.0, "colour": "red"}, "unknown parameter"),
    ],
)
def test_parameters_are_taken_by_name(parameters, message):
    with pytest.raises(RunError, match=message):
        Kernel().set_slider("rigid", parameters)


# Populations of a fine resolution, in a process that gets hardly any more memory.
WITHOUT_MEMORY = """
import resource, sys
from pathlib import Path
import mesoslip
overrides = ["run.engine=me", "run.resolution=0.002", "contacts.initial=steady"]
with mesoslip.Realization(mesoslip.Config.load(sys.argv[1], overrides=overrides)) as run:
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + int(sys.argv[2]), resource.RLIM_INFINITY))
    try:
        run.advance_to(0.01)
    except mesoslip.RunError as error:
        print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads the size of the process from /proc")
@pytest.mark.parametrize(
    ("room", "message"),
    [
        (2**16, "not enough memory for a simulation"),
        (RESERVE + 25_000_000, "not enough memory for the populations of contacts"),
    ],
)
def test_memory_that_is_refused_is_an_error(room, message):
    """The kernel does not stop the program, as Fortran's library does for small allocations."""
    printed = python(WITHOUT_MEMORY, ROOT / "runs" / "klein.toml", room, timeout=60)
    assert message in printed


def with_contacts(config) -> Kernel:
    """A kernel that has the contacts of a configuration, and nothing else."""
    kind, kernel = config.contact_kind, Kernel()
    kernel.set_contacts(kind.kernel_kind, kind.kernel_parameters(config), config.run.seed, 0)
    return kernel


@pytest.mark.parametrize("kind", list(KINDS))
def test_copied_contacts_are_those_made_anew(kind):
    """Two copies run alike, and as contacts of their own; the original stays as it was."""
    config = configuration(kind)
    template = with_contacts(config)
    states = []
    for one in (template, template, config.contact_kind.kernel_parameters(config)):
        kernel = KernelSetup(config, one).open()
        kernel.start(config.contacts.initial)
        kernel.advance(40, 1e18)
        states.append(kernel.save().tolist())
        kernel.close()
    assert states[0] == states[1] == states[2]


def test_contacts_that_cannot_be_copied():
    config = configuration("rigid")
    with pytest.raises(RunError, match="has no contacts"):
        Kernel().copy_contacts(Kernel())
    started = KernelSetup(config, with_contacts(config)).open()
    started.start("relaxed")
    with pytest.raises(RunError, match="was started"):
        Kernel().copy_contacts(started)


def test_unknown_lists_of_names_are_errors():
    with pytest.raises(RunError, match="no list of names 'colours'"):
        name_list("colours")


ARRAYS = {"d": "NDArray[np.float64]", "q": "NDArray[np.int64]", "i": "NDArray[np.int32]"}
ARRAYS |= {"S": "NDArray[np.bytes_]"}
NUMBERS = {"int": "int", "long": "int", "float": "float"}


def python_type(described: str, *, is_result: bool) -> str:
    """The type of an argument or a result as f2py describes it."""
    array = re.search(r"rank-\d array\('(\w)'\)", described)
    if array:
        return ARRAYS[array[1]]
    if "string" in described:
        return "bytes" if is_result else "str"
    return NUMBERS[described.removeprefix("input ").split(",")[0]]


def made(name: str) -> tuple[list[tuple[str, str, bool]], list[str]]:
    """Names, types and optionality of the arguments of a wrapper, and types of its results."""
    text = getattr(_core, name).__doc__
    head, _, results = text.partition("Returns\n-------\n")
    described = dict(re.findall(r"^(\w+) : (.*)$", head, re.MULTILINE))
    returned = [kind for _, kind in re.findall(r"^(\w+) : (.*)$", results, re.MULTILINE)]
    signature = re.search(r"\((.*)\)$", text.splitlines()[0])
    assert signature
    required, _, optional = signature[1].partition("[")
    arguments = [
        (one, python_type(described[one], is_result=False), is_optional)
        for part, is_optional in ((required, False), (optional, True))
        for one in re.findall(r"\w+", part)
    ]
    return arguments, [python_type(kind, is_result=True) for kind in returned]


def stated() -> dict[str, tuple[list[tuple[str, str, bool]], list[str]]]:
    """The same of all wrappers by the types that the package states."""
    source = (ROOT / "python" / "mesoslip" / "_core.pyi").read_text()
    functions = {}
    for node in ast.parse(source).body:
        if not isinstance(node, ast.FunctionDef):
            continue
        given = node.args.args
        first_optional = len(given) - len(node.args.defaults)
        arguments = [
            (one.arg, ast.unparse(one.annotation), place >= first_optional)
            for place, one in enumerate(given)
        ]
        returned = node.returns
        if isinstance(returned, ast.Subscript) and ast.unparse(returned.value) == "tuple":
            results = [ast.unparse(one) for one in returned.slice.elts]
        else:
            results = [text for text in [ast.unparse(returned)] if text != "None"]
        functions[node.name] = arguments, results
    return functions


def test_types_of_the_boundary_are_those_of_what_f2py_made():
    public = [name for name in dir(_core) if not name.startswith("_")]
    assert stated() == {name: made(name) for name in public}
