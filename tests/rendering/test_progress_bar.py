"""The bar, as a terminal shows it."""

import io
import re

import pytest

import qmcjax as qj


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """Return the seconds that tqdm sees, as a list of one."""
    now = [1000.0]
    monkeypatch.setattr("tqdm.std.time", lambda: now[0])
    return now


def test_what_remains(monkeypatch, clock):
    """Of a run that begins at 40 %, and takes a minute for each 10 %."""
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    report = qj.progress_bar("image: ")
    for part in range(4, 11):
        report(part / 10)
        clock[0] += 60
    shown = [line for line in terminal.getvalue().split("\r") if line]
    assert re.match(r"image: +40%\|.*\| 00:00<\?", shown[0])
    assert any(re.match(r"image: +60%\|.*\| 02:00<04:00", line) for line in shown)
    assert re.match(r"image: +100%\|.*\| 06:00<00:00", shown[-1])


def test_nothing_where_nobody_looks(monkeypatch):
    log = io.StringIO()
    monkeypatch.setattr("sys.stderr", log)
    report = qj.progress_bar()
    report(0.5)
    report(1.0)
    assert log.getvalue() == ""


def test_a_second_computation_has_a_bar_of_its_own(monkeypatch, clock):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    report = qj.progress_bar()
    for part in (0.5, 1.0, 0.5, 0.25, 1.0):
        report(part)
        clock[0] += 60
    assert terminal.getvalue().count("100%") >= 2
    assert re.search(r" 25%\|[^|]*\| 00:00<\?", terminal.getvalue()), "less than before is a new beginning"
    with pytest.raises(TypeError, match="label must be a str, got 3"):
        qj.progress_bar(3)
