"""The comparison itself notices what it should."""

import numpy as np
import pytest

from .stored import Stored, moves, read, share, write


OLD = {"a": np.array([1.0, -4.0, np.nan]), "b": 2.0}


@pytest.mark.parametrize(
    ("new", "words"),
    [
        (OLD | {"b": 2.01}, ["b moved by 0.01"]),
        (OLD | {"a": np.array([1.0, -4.1, np.nan])}, ["a moved by 0.1 (2.5e-02"]),
        (OLD | {"a": np.array([np.nan, -4.0, np.nan])}, ["a is finite elsewhere"]),
        (OLD | {"a": np.array([1.0, np.inf, np.nan])}, ["a is finite elsewhere"]),
        (OLD | {"a": np.zeros(2)}, ["a changed its shape"]),
        (OLD | {"c": 0.0}, ["c is new"]),
        ({"b": 2.0}, ["a is gone"]),
        (OLD | {"a": np.array([1.0, -4.00001, np.nan])}, []),
    ],
)
def test_what_moves_is_named(new, words):
    found = [str(move) for move in moves(OLD, new, share(new, 1e-5))]
    assert len(found) == len(words)
    assert all(line.startswith(word) for line, word in zip(found, words, strict=True))


def test_what_is_written_is_read_again(tmp_path):
    write(tmp_path / "x.json", OLD)
    assert moves(OLD, read(tmp_path / "x.json"), share(OLD, 1e-6)) == []


def test_an_update_says_what_moved_and_a_test_fails(tmp_path, monkeypatch):
    monkeypatch.setattr("tests.regression.stored.FOLDER", tmp_path)
    update, test = Stored(update=True), Stored(update=False)
    with pytest.raises(AssertionError, match="a is new; b is new"):
        test.check("x", OLD, share(OLD, 1e-6))
    update.check("x", OLD, share(OLD, 1e-6))
    test.check("x", OLD, share(OLD, 1e-6))
    new = OLD | {"b": 2.2}
    with pytest.raises(AssertionError, match=r"x.json: b moved by 0.2 \(1.0e-01"):
        test.check("x", new, share(new, 1e-6))
    update.check("x", new, share(new, 1e-6))
    assert "x: b moved by 0.2" in update.news[-1]
    test.check("x", new, share(new, 1e-6))
