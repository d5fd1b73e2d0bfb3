"""Time of work, and what of it is compiled."""

import time

import jax
import jax.numpy as jnp
import pytest

from cloudjax_scenes.trade.stopwatch import Stopwatch


def test_what_is_compiled_is_not_work():
    """A pause of 0.2 s is work, and a function that is compiled within is not."""
    watch = Stopwatch()

    @jax.jit
    def work(x):
        for i in range(60):
            x = jnp.sin(x * i) + jnp.cumsum(x)
        return x

    with watch.running():
        started = time.perf_counter()
        work(jnp.arange(7.0)).block_until_ready()
        first = time.perf_counter() - started
        time.sleep(0.2)
    # Most of a first call is compiling.
    assert 0.3 * first < watch.compiled_s <= first
    assert watch.took_s >= 0.2
    compiled = watch.compiled_s
    with watch.running():
        work(jnp.arange(7.0)).block_until_ready()
    assert watch.compiled_s == compiled


def test_nothing_is_heard_while_it_stands():
    watch = Stopwatch()
    with watch.running():
        pass
    jax.jit(lambda x: jnp.tan(x) + 3)(jnp.arange(11.0))
    assert watch.compiled_s == 0


def test_spans_within_others_and_of_other_threads_count_once():
    watch = Stopwatch()
    watch._compiled = [(1.0, 2.0), (0.0, 4.0), (3.0, 5.0), (7.0, 8.0)]
    assert watch.compiled_s == pytest.approx(6.0)


def test_the_use_of_items_is_not_their_making(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    watch = Stopwatch()

    def items():
        for i in range(3):
            now[0] += 2.0
            yield i

    for _ in watch.each(items()):
        now[0] += 50.0
    assert watch.took_s == pytest.approx(6.0)
