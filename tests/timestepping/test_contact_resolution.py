"""Joints that bounce within far less than a step, by hand: one mass on one spring."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from romdam.core.system import OPEN, STICK
from romdam.timestepping.contact_resolution import frequencies_of_gaps, resolution_warnings


def system(stiffness, mass=(1.0,), spring=(0.0,), jumps=((1.0,),)):
    """Gaps (rows of `jumps`) on modes with unit mass, or without, and their springs."""
    law = SimpleNamespace(
        directions=1,
        K_n=np.array(stiffness, dtype=float),
        joints={"a": slice(0, 1), "b": slice(1, len(stiffness))},
    )
    law = type("Law", (), {"__len__": lambda _: len(stiffness), **vars(law)})()
    return SimpleNamespace(
        M=diags(mass).tocsr(), K=diags(spring).tocsr(), B=csr_matrix(np.array(jumps)), law=law, diagonal=True
    )


def test_the_frequency_is_that_of_a_mass_on_its_spring():
    """4e12 N/m and 1,000 kg (a mode of unit mass that moves by 1000**-0.5): sqrt(4e9) rad/s."""
    one = system([4e12], jumps=[[1000.0**-0.5]])
    assert frequencies_of_gaps(one) == pytest.approx([4e9**0.5])


def test_a_flexibility_without_mass_is_in_series_and_rigid_contact_has_no_frequency():
    """3e6 N/m behind 6e6 N/m are 2e6 N/m on a unit mass."""
    both = system([6e6, np.inf], mass=(1.0, 0.0), spring=(0.0, 3e6), jumps=[[1.0, 1.0], [1.0, 0.0]])
    assert frequencies_of_gaps(both) == pytest.approx([2e6**0.5, 0.0])


@pytest.mark.parametrize(
    ("states", "said"), [((OPEN, STICK), True), ((OPEN, OPEN), False), ((STICK, STICK), False)]
)
def test_only_a_joint_that_opens_and_closes_is_named(states, said):
    """Gaps of 1e5 rad/s, steps of 1 ms: 100 for a limit of 50; the softer joint stays below."""
    two = system([1e10, 1e8], mass=(1.0, 1.0), spring=(0.0, 0.0), jumps=[[1.0, 0.0], [0.0, 1.0]])
    history = SimpleNamespace(
        stats={"finest_step": 1e-3}, state=np.array([[states[0], OPEN], [states[1], STICK]])
    )
    warnings = resolution_warnings(history, two)
    assert len(warnings) == said
    if said:
        assert warnings[0].startswith("joint a: gaps that close bounce within 0.031 ms")
        assert "transient.finest_step of 0.0005 s or less" in warnings[0]
        assert "4 times lower" in warnings[0]


def test_a_finer_step_that_the_warning_gives_silences_it():
    one = system([1e10])
    history = SimpleNamespace(stats={"finest_step": 5e-4}, state=np.array([[OPEN], [STICK]]))
    assert resolution_warnings(history, one) == []
