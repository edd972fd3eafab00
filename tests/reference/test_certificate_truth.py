"""Certificate and estimate tell the truth within a factor two, on every case of the table."""

import pytest
from certificate_truth import CASES, MORTAR_CASES, line, measure


@pytest.mark.slow
@pytest.mark.parametrize("case", [*CASES, *MORTAR_CASES], ids=lambda case: "-".join(map(str, case)))
def test_certificate_and_estimate_are_within_a_factor_two_of_the_true_error(case):
    row = measure(*case)
    assert 0.5 < row.certified / row.true < 2.0, line(row)
    assert 0.5 < row.estimated / row.true < 2.0, line(row)
