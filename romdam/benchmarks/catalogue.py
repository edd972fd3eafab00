"""The whole benchmark set, in the order of its table."""

from romdam.benchmarks import contact, frequencies, measured, two_cantilevers, uplift, water

CASES = (
    frequencies.CASES + water.CASES + measured.CASES + contact.CASES + uplift.CASES + two_cantilevers.CASES
)
