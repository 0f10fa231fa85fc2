"""Tests of errors, made from rows of wrong arguments."""

import pytest


def is_error(each):
    return isinstance(each, type) and issubclass(each, Exception)


def refused(*rows, call=lambda make, *arguments: make(*arguments), error=(TypeError, ValueError)):
    """Return a test: each row, by default of what is called, raises its error, or this one, and message."""

    @pytest.mark.parametrize("row", rows, ids=lambda row: row[-1])
    def test(row):
        *arguments, message = (each for each in row if not is_error(each))
        with pytest.raises(next(filter(is_error, row), error), match=message):
            call(*arguments)

    return test
