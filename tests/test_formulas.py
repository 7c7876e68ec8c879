"""Formulas of users: whatever is written is a force or a fault, with little stack, time and memory."""

import re
import threading
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bha
from bha import _core
from bha.errors import ConvergenceError, InputError, ParameterError

WORDS = """
q qd p t c x 1 0 2.5 1e3 1e308 1e .5 0x1 1_0 \0 \u00e9
+ - * / ** ^ % < > :: = | & ! ? ; . , # ' " $ ( ) [ ] { } a::< <q -( |q|
abs( exp( max( min( pow( sign( sqrt( tanh( q) ,2) sin( __import__(
"""
PARTS = [*WORDS.split(), "if ", "return ", "match ", "q as ", "\n", " ", "9" * 30]


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.lists(st.sampled_from(PARTS), max_size=40), st.integers(1, 60))
def test_any_formula_is_a_force_or_a_fault(parts: list[str], repeats: int) -> None:
    """What is taken computes with finite numbers or says that it does not; what is not names a place."""
    text = "".join(parts * repeats)[:1100]
    table = {"kind": "formula", "where": "all", "force": text}
    if "c" in re.findall(r"[a-z]+", text):
        table["c"] = 0.5
    arm = bha.robots.load("bha_nominal")
    try:
        arm = arm.with_effects([table])
    except ParameterError as error:
        fault = str(error)
        assert "force: found" in fault, fault
        return
    q, p = np.full(9, 0.19), np.full(9, 1.2e5)
    for qd in (np.zeros(9), np.full(9, -0.1)):
        with suppress(InputError):
            assert np.isfinite(arm.forward_dynamics(q, qd, p)).all()
    with suppress(ConvergenceError, InputError):
        assert np.isfinite(arm.static_lengths(p)).all()


@pytest.mark.parametrize(
    "atom", ["<", "a::<", "(", "-", "tanh(", "q+(", "-(", "if q {} else ", "return ", "&'a ", "pow("]
)
def test_formulas_need_little_stack(atom: str) -> None:
    """A thread of 128 KiB parses whatever is written, as long as is allowed."""
    found: list[str | None] = []
    before = threading.stack_size(128 << 10)
    try:
        thread = threading.Thread(target=lambda: found.append(_core.formula_fault((atom * 1000)[:1000], ["c"])))
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
    assert found
    assert found[0]


def test_parsed_formulas_leave_no_memory_behind() -> None:
    resource = pytest.importorskip("resource")
    text = "-c * tanh(qd) + " + " + ".join(["c*q"] * 150)
    assert _core.formula_fault(text, ["c"]) is None
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(20_000):
        _core.formula_fault(text, ["c"])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 4 << 10  # KiB; 20 MiB before
