"""Work on several threads, in order."""

import threading

import jax
import jax.numpy as jnp
import pytest

from cloudjax.workers import each


def test_results_come_in_the_order_of_the_jobs():
    assert list(each(range(20), lambda i: i**2)) == [i**2 for i in range(20)]


def test_jobs_are_taken_as_they_are_worked_on():
    """Not all at once, for they may be large."""
    taken = []

    def jobs():
        for i in range(100):
            taken.append(i)
            yield i

    next(each(jobs(), lambda i: i))
    assert len(taken) < 100


def test_threads_work_in_the_precision_of_the_caller():
    with jax.enable_x64(True):
        found = list(each(range(3), lambda i: jnp.zeros(i).dtype))
    assert found == [jnp.float64] * 3


def test_what_fails_is_raised_here():
    def fail(i):
        raise ValueError(f"job {i} in {threading.current_thread().name}")

    with pytest.raises(ValueError, match="job 0"):
        list(each(range(3), fail))
