"""Packages take public names only, of each other and of JAX. import-linter sees to layers and circles."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = sorted(
    str(path.parent.relative_to(ROOT))
    for top in ("qmcjax", "analysis", "figures")
    for path in (ROOT / top).rglob("__init__.py")
    if not any(part.startswith("_") for part in path.parent.relative_to(ROOT).parts)
)
"""The public packages. Private packages inside one belong to it."""


def private_imports(source, package):
    """Return the names of private modules, and of private names in them, that belong to another package."""
    imported = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            imported += [f"{node.module}.{alias.name}" for alias in node.names]
    found = []
    for name in imported:
        parts = name.split(".")
        private = [k for k, part in enumerate(parts) if part.startswith("_") and not part.startswith("__")]
        ours = parts[0] in ("qmcjax", "analysis", "figures")
        if ours and private and not f"{package}.".startswith(".".join(parts[: private[0]]) + "."):
            found.append(name)
    return found


def private_attributes(sources):
    """Return private attributes that are read in modules of one package and that none of them defines."""
    read, defined = {}, {"_replace", "_asdict", "_fields", "_exit"}  # of named tuples, and of os
    for name, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Attribute) and node.attr.startswith("_") and node.attr[:2] != "__":
                if isinstance(node.ctx, ast.Store):
                    defined.add(node.attr)
                else:
                    read.setdefault(node.attr, name)
            elif isinstance(node, ast.FunctionDef):
                defined.add(node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                defined.add(node.id)
    return {f"{name}: {attribute}" for attribute, name in read.items() if attribute not in defined}


def undocumented(source):
    """Return what a module takes from JAX that has no place in its documentation."""
    nodes = list(ast.walk(ast.parse(source)))
    parts = {id(node.value) for node in nodes if isinstance(node, ast.Attribute)}
    names = [ast.unparse(node) for node in nodes if isinstance(node, ast.Attribute) and id(node) not in parts]
    for node in nodes:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    private = re.compile(r"jax\.(interpreters|_src|extend|core(?!\.Tracer\b))\b")
    return {name for name in names if private.match(name) and "(" not in name}


def sources(room):
    files = [*(ROOT / room).glob("*.py"), *(ROOT / room).glob("_*/*.py")]
    return {str(path): path.read_text(encoding="utf-8") for path in sorted(files)}


@pytest.mark.parametrize("room", ROOMS)
def test_no_package_takes_private_names_of_another(room):
    found = {name: private_imports(source, room.replace("/", ".")) for name, source in sources(room).items()}
    assert not {name: names for name, names in found.items() if names}
    assert not private_attributes(sources(room))


def test_what_jax_does_not_document_is_in_one_module():
    found = {}
    for top in ("qmcjax", "analysis", "figures"):
        for path in (ROOT / top).rglob("*.py"):
            source = path.read_text(encoding="utf-8")
            if names := re.search(r"(?<!qmc)jax\b.*(interpreters|_src|extend|core)", source) and undocumented(
                source
            ):
                found[path.relative_to(ROOT).as_posix()] = names
    assert list(found) == ["qmcjax/core/jax_internals.py"]
