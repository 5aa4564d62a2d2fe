"""The reference of the Fortran library, made from its ``!>`` comments.

Modules are read line by line, as the house writes them: a comment before each entity, component and
argument, and ``public ::`` lists. A bound procedure is documented where it is declared, at its
interface or its own definition; an override is listed with a link to the type that declares it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

SOURCES = Path(__file__).parents[2] / "fortran"

INTRODUCTION = """\
# Fortran library

The kernels are a Fortran library, which Python uses. Modules are named after their path:
`fortran/sliders/rigid.f90` is `mesoslip_sliders_rigid`. The pages have their public entities, from
the comments of the sources; the search leaves them out. Procedures that can fail have an
allocatable `type(error_type)` as their last argument; unallocated means success. The library never
stops the program.
"""

# Front matter of pages that the search of the documentation leaves out.
NOT_SEARCHED = "---\nnosearch: true\n---\n"

MODULE = re.compile(r"module (?!procedure)(\w+)")
TYPE = re.compile(r"type(?:, *[\w() ,]+)? *:: *(\w+)|type +(\w+)$")
PARENT = re.compile(r"extends\((\w+)\)")
BINDING = re.compile(r"procedure(?:\((\w+)\))?(.*?)(?:::)? *([\w, =>]+)$")


@dataclass
class Entity:
    """A type, procedure or interface.

    ``parts`` are declarations of components or arguments with the comment before each, ``bindings``
    the public procedures of a type with theirs: names of binding and of procedure or interface.
    """

    kind: str
    name: str
    head: str
    comment: str
    parts: list[tuple[str, str]] = field(default_factory=list)
    bindings: list[tuple[str, str, str]] = field(default_factory=list)


@dataclass
class Module:
    """A module: its name, file, comment, and public entities."""

    name: str
    file: str
    comment: str
    public: list[str] = field(default_factory=list)
    entities: dict[str, Entity] = field(default_factory=dict)
    constants: dict[str, tuple[str, str]] = field(default_factory=dict)


def statements(text: str) -> Iterator[tuple[str, str]]:
    """Statements, each on one line, with the ``!>`` comment before it."""
    comment: list[str] = []
    pending = ""
    for raw in text.splitlines():
        line = raw.strip()
        if line.startswith("!>"):
            comment.append(line[2:].strip())
            continue
        if line.startswith("!") or (not line and not pending):
            if not line:
                comment = []
            continue
        pending += " " + line.removeprefix("&").strip()
        if pending.endswith("&"):
            pending = pending[:-1].rstrip()
            continue
        statement = " ".join(pending.split())
        yield statement, "\n".join(comment)
        comment, pending = [], ""


def read_module(path: Path) -> Module | None:
    """The module of a file; None if it has none."""
    module: Module | None = None
    current: Entity | None = None
    is_interface = False
    for statement, comment in statements(path.read_text()):
        if module is None:
            match = MODULE.fullmatch(statement)
            if match:
                module = Module(match[1], str(path.relative_to(SOURCES.parent)), comment)
            continue
        if statement.startswith(("abstract interface", "interface")):
            is_interface = True
            name = statement.removeprefix("interface").strip()
            if name and not statement.startswith("abstract"):
                module.entities.setdefault(name, Entity("interface", name, statement, comment))
        elif statement.startswith("end interface"):
            is_interface = False
        elif statement.startswith("end "):
            kind = statement.split()[1]
            if kind in {"type", "subroutine", "function", "procedure"}:
                current = None
        elif statement.startswith("public ::"):
            names = statement.removeprefix("public ::").split(",")
            module.public += [name.strip() for name in names]
        elif current is not None:
            _add_part(current, statement, comment)
        else:
            current = _begun(module, statement, comment, is_interface)
    return module


def _begun(module: Module, statement: str, comment: str, is_interface: bool) -> Entity | None:
    """The entity that a statement begins; None if it begins none, and is perhaps a constant."""
    kind = TYPE.match(statement)
    procedure = _procedure(statement)
    if kind and not statement.startswith("type("):
        begun = Entity("type", kind[1] or kind[2], statement, comment)
    elif procedure:
        begun = Entity(*procedure, statement, comment)
    else:
        if "parameter" in statement and "::" in statement:
            for name, value in re.findall(
                r"(\w+) *= *([^,\[]+|\[[^\]]*\])", statement.split("::")[1]
            ):
                module.constants[name] = (value.strip(), comment)
        return None
    if not is_interface or begun.name not in module.entities:
        module.entities[begun.name] = begun
    return begun


def _procedure(statement: str) -> tuple[str, str] | None:
    """Kind and name of the procedure that a statement begins."""
    before = statement.split("!")[0]
    match = re.search(r"(?:^|\s)(subroutine|function) +(\w+) *(?:\(|$)", before)
    if match is None or "::" in before.split(match[1])[0]:
        return None
    return match[1], match[2]


def _add_part(entity: Entity, statement: str, comment: str) -> None:
    """Add a component, binding, argument or result to an entity."""
    declaration, _, names = statement.rpartition("::")
    declaration, names = declaration.strip(), names.strip()
    is_type = entity.kind == "type"
    if is_type and (binding := BINDING.match(statement)):
        interface, attributes, bound = binding.groups()
        if "private" not in attributes:
            for one in bound.split(","):
                name, _, target = (part.strip() for part in one.partition("=>"))
                entity.bindings.append((name, interface or target or name, comment))
    elif not declaration:
        return
    elif is_type:
        if comment and "private" not in declaration:
            entity.parts.append((f"{names} : {declaration}", comment))
    elif re.search(r"\b(intent|value|procedure)\b", declaration):
        if names != "self":
            entity.parts.append((f"{names} : {declaration}", comment))
    else:
        # The result of a function, or a local variable.
        result = re.search(r"result\((\w+)\)", entity.head)
        if comment and result and names.startswith(result[1]):
            entity.parts.append((f"{names} : {declaration}", comment))


def fortran_pages() -> dict[str, str]:
    """Pages by name: an introduction, and all modules with what they make public, of each folder
    a page."""
    modules = [found for path in sorted(SOURCES.rglob("*.f90")) if (found := read_module(path))]
    types = {
        entity.name: (module, entity)
        for module in modules
        for entity in module.entities.values()
        if entity.kind == "type"
    }
    modules.sort(key=lambda one: (_page_of(one), one.file))
    pages: dict[str, str] = {}
    for page, on_page in groupby(modules, key=_page_of):
        inside = list(on_page)
        parts = [NOT_SEARCHED, f"# Fortran: {Path(inside[0].file).parent}", ""]
        for module in inside:
            parts += _section(module, types)
        pages[page] = "\n".join(parts)
    links = [f"- [{page}]({page}.md)" for page in pages]
    contents = "\n".join(["```{toctree}", ":hidden:", "", *pages, "```"])
    return {"fortran": "\n".join([INTRODUCTION, *links, "", contents, ""]), **pages}


def _page_of(module: Module) -> str:
    """Name of the page of a module, after its folder."""
    return "-".join(("fortran-library", *Path(module.file).parent.parts[1:]))


def _section(module: Module, types: dict[str, tuple[Module, Entity]]) -> list[str]:
    parts = [f"## {module.name}", "", f"`{module.file}`. {_escaped(module.comment)}", ""]
    constants = [name for name in module.public if name in module.constants]
    if constants:
        parts += ["| constant | value | meaning |", "|---|---|---|"]
        for name in constants:
            value, comment = module.constants[name]
            parts.append(f"| `{name}` | `{value}` | {_on_a_line(comment)} |")
        parts.append("")
    for name in module.public:
        entity = module.entities.get(name)
        if entity is None:
            continue
        parts += [f"**{entity.name}**", "", "```fortran", _wrapped(entity.head), "```", ""]
        parts += [_escaped(entity.comment), ""]
        parts += [_item(what, comment) for what, comment in entity.parts]
        for binding in entity.bindings:
            parts += _bound(binding, module, declaring(entity, binding[0], types))
        parts.append("")
    return parts


def declaring(
    entity: Entity, name: str, types: dict[str, tuple[Module, Entity]]
) -> tuple[Module, Entity] | None:
    """The type that declares the procedure that a binding overrides, and its module."""
    found = None
    while parent := PARENT.search(entity.head):
        module, entity = types[parent[1]]
        if any(binding[0] == name for binding in entity.bindings):
            found = module, entity
    return found


def _bound(
    binding: tuple[str, str, str], module: Module, base: tuple[Module, Entity] | None
) -> list[str]:
    """A bound procedure: its comment and arguments, or a link to what it overrides."""
    name, target, comment = binding
    procedure = module.entities.get(target)
    comment = comment or (procedure.comment if procedure else "")
    if base is not None:
        line = f"- `{name}` (procedure of [{base[1].name}]({_page_of(base[0])}.md#{base[0].name}))"
        return [f"{line}<br>{_on_a_line(comment)}" if comment else line]
    parts = procedure.parts if procedure else []
    return [_item(f"{name} (procedure)", comment), *("  " + _item(*part) for part in parts)]


def _item(what: str, comment: str) -> str:
    return f"- `{what}`" + (f"<br>{_on_a_line(comment)}" if comment else "")


def _wrapped(head: str) -> str:
    """A statement over several lines, if it is long."""
    if len(head) <= 90 or "(" not in head:
        return head
    lines, line = [], ""
    for part in head.split(", "):
        if line and len(line) + len(part) > 85:
            lines.append(f"{line}, &")
            line = "   & " + part
        else:
            line = f"{line}, {part}" if line else part
    return "\n".join([*lines, line])


def _escaped(comment: str) -> str:
    """A comment as Markdown, in which nothing is meant to be markup."""
    return re.sub(r"([*_<>\[\]#|$`\\])", r"\\\1", comment)


def _on_a_line(comment: str) -> str:
    return _escaped(comment.replace("\n", " "))
