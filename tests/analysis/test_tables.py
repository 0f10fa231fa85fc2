"""The command that makes the data of the library again."""

from pkgutil import resolve_name

import pytest

from analysis.tables import ROOMS, SEQUENCES, large_distances
from analysis.tables.__main__ import TABLES, main

FOREIGN = {"ckn_lattice_vector.txt", "faure_lemieux.txt", "README.md", "recommendations_denoised.csv"}
"""Published by others, what explains the files, and the table that the figure ``denoisers`` writes."""


def test_each_file_of_the_library_has_a_program():
    assert all(callable(resolve_name(f"analysis.tables.{program}")) for program, *_ in TABLES.values())
    assert len({folder for _, folder, *_ in TABLES.values()}) == len(ROOMS)
    shipped = {path for _, folder, *_ in TABLES.values() for path in folder.iterdir()}
    assert {path for path in shipped if path.name not in FOREIGN} == {
        folder / name for name, (_, folder, *_) in TABLES.items()
    }


def test_a_named_file_is_written_and_grows(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(large_distances, "TARGETS", {1: 2, 2: 2, 3: 8})
    main(["optimized_nets.txt", "--folder", str(tmp_path)])
    (path,) = tmp_path.iterdir()
    assert (SEQUENCES / "optimized_nets.txt").read_bytes().startswith(path.read_bytes())
    assert capsys.readouterr().out.count(str(path)) == 3


def test_without_a_name_all_are_listed(capsys):
    main([])
    assert len(capsys.readouterr().out.splitlines()) == len(TABLES)
    with pytest.raises(SystemExit):
        main(["primes.txt"])
    assert "NAME must be one of joe_kuo.npz, " in capsys.readouterr().err
