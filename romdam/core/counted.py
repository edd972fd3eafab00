"""Texts of stages whose steps a person counts."""

from __future__ import annotations


class Counted(str):
    """The text of a stage of so many things, such as "40 runs"; what shows it says how many are done.

    Attributes
    ----------
    number, things : how many, and the word for them
    """

    number: int
    things: str

    def __new__(cls, number: int, things: str) -> Counted:
        """Make the text of a count."""
        text = super().__new__(cls, f"{number} {things}")
        text.number, text.things = number, things
        return text

    def done(self, done: float, total: float) -> str:
        """Say how many things are whole, of a stage that is at `done` of `total`."""
        whole = int(self.number * done / total + 1e-9) if total > 0.0 else 0  # 1e-9: round-off of a quotient
        return f"{whole} of {self.number} {self.things}"
