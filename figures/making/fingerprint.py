"""A hash of everything that a figure's picture depends on, without importing it.

Import statements are followed through the project's packages with ``ast``, so imports under names computed
at run time are not found.
"""

import ast
import hashlib
import importlib.metadata
import importlib.util
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from figures.making import heitz
from figures.making.store import NUMBERS

PROJECT = ("qmcjax", "analysis", "figures")
LIBRARIES = ("jax", "numpy", "scipy", "matplotlib")
NOT_DATA = (".py", ".pyc", ".ipynb", ".md", ".png")


def fingerprint(module: str, quality: str) -> str:
    """Hash the quality, the files behind ``module`` and the versions of the libraries that it may use.

    Published tables count for the figures that read them if the user has named them. A missing module or one
    with syntax errors has a fingerprint, too: importing it raises the error. The 64 hexadecimal digits do not
    depend on the location of the project.
    """
    read = sources(module)
    tables = heitz.path()
    if tables is not None and heitz.__name__ in read:
        read["published tables"] = tables
    files = {key: hashlib.sha256(path.read_bytes()).hexdigest() for key, path in read.items()}
    versions = {name: importlib.metadata.version(name) for name in LIBRARIES}
    text = json.dumps([quality, files, versions], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def sources(module: str) -> dict[str, Path]:
    """Return the files of all modules that ``module`` imports, and the data files of their packages.

    The keys are dotted names, or ``package/file`` for data; only `PROJECT` and the package of ``module`` are
    searched. The name of a function may follow ``module`` after a colon.
    """
    module = module.partition(":")[0]
    folders = {root: _folder(root) for root in {*PROJECT, module.partition(".")[0]}}
    files: dict[str, Path] = {}
    pending, names = [module], set()
    while pending:
        name = pending.pop()
        root, *rest = name.split(".")
        path = None if name in names else _locate(folders.get(root), rest)
        names.add(name)
        if path is None:
            continue
        files[name] = path
        parent = name.rpartition(".")[0]
        package = name if path.name == "__init__.py" else parent
        if package == name:
            data = _data_files(path.parent)
            files |= {f"{name}/{file.relative_to(path.parent).as_posix()}": file for file in data}
        pending += [parent, *_imports(path.read_bytes(), package)]
    return files


def _folder(root: str) -> str | None:
    """Return the folder of a package."""
    spec = importlib.util.find_spec(root)
    return spec.submodule_search_locations[0] if spec and spec.submodule_search_locations else None


def _locate(folder: str | None, names: list[str]) -> Path | None:
    """Return the file of a module; None for any other name, such as that of a module's function."""
    if folder is None:
        return None
    stem = Path(folder, *names)
    return next((path for path in (stem / "__init__.py", stem.with_suffix(".py")) if path.is_file()), None)


@cache
def _imports(source: bytes, package: str) -> tuple[str, ...]:
    """Return the absolute names that may be modules in the import statements of ``source``."""
    names: list[str] = []
    try:
        for node in _statements(ast.parse(source)):
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
                names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    except (SyntaxError, ValueError, ImportError):
        return ()
    return tuple(names)


def _statements(module: ast.Module) -> Iterator[ast.AST]:
    """Yield all statements; `ast.walk` also visits expressions, and takes five times as long."""
    pending: list[ast.AST] = [module]
    while pending:
        node = pending.pop()
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            pending += getattr(node, part, ())


def _data_files(package: Path) -> Iterator[Path]:
    """Yield the files that are neither code nor documentation, except in subpackages and output folders."""
    for path in package.iterdir():
        if path.name.startswith((".", "__")):
            continue
        if path.is_dir():
            if not (path / "__init__.py").exists() and not (path / NUMBERS).exists():
                yield from _data_files(path)
        elif path.suffix not in NOT_DATA:
            yield path
