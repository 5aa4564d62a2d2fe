"""The reference of the Fortran library, made from its ``!>`` comments.

Fortran modules are read line by line, as the house writes them: a comment before what it tells of,
``public ::`` lists, and a comment before each dummy argument.
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
`fortran/sliders/rigid.f90` is `mesoslip_sliders_rigid`. This page has their public entities, from
the comments of the sources. Procedures that can fail have an allocatable `type(error_type)` as
their last argument; unallocated means success. The library never stops the program.
"""

MODULE = re.compile(r"module (?!procedure)(\w+)")
TYPE = re.compile(r"type(?:, *[\w() ,]+)? *:: *(\w+)|type +(\w+)$")


@dataclass
class Entity:
    """A type or procedure.

    Attributes
    ----------
    kind
        "type", "subroutine", "function", "interface".
    head
        Its first statement.
    parts
        Declarations of components or arguments, and what the comment before each says.
    """

    kind: str
    name: str
    head: str
    comment: str
    parts: list[tuple[str, str]] = field(default_factory=list)


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
    """A component, binding or argument, if a comment tells of it."""
    is_binding = entity.kind == "type" and statement.startswith("procedure")
    if not comment or not (is_binding or "::" in statement):
        return
    declaration, _, names = statement.rpartition("::")
    if is_binding:
        names = re.sub(r" *=> *\w+", "", names if declaration else statement.split(None, 1)[1])
        entity.parts.append((f"{names.strip()} (procedure)", comment))
        return
    if entity.kind != "type" and "intent" not in declaration and "procedure" not in declaration:
        # What a function gives back, or a variable of its own.
        result = re.search(r"result\((\w+)\)", entity.head)
        if result is None or not names.strip().startswith(result[1]):
            return
    entity.parts.append((f"{names.strip()} : {declaration.strip()}", comment))


def fortran_page() -> str:
    """All modules with what they make public, room by room."""
    modules = [found for path in sorted(SOURCES.rglob("*.f90")) if (found := read_module(path))]
    parts = [INTRODUCTION]
    modules.sort(key=lambda one: (str(Path(one.file).parent), one.file))
    for room, inside in groupby(modules, key=lambda one: str(Path(one.file).parent)):
        parts += [f"## {room}", ""]
        for module in inside:
            parts += _told(module)
    return "\n".join(parts)


def _told(module: Module) -> list[str]:
    parts = [f"### {module.name}", "", f"`{module.file}`. {_escaped(module.comment)}", ""]
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
        parts += [f"- `{what}`<br>{_on_a_line(comment)}" for what, comment in entity.parts]
        parts.append("")
    return parts


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
