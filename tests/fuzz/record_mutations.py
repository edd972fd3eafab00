"""Damaged copies of record files: what transmission, editors and careless scripts do to them."""

from __future__ import annotations

import numpy as np

Rng = np.random.Generator
LETTERS = b"abcxyzEeDd+-.,;:_ \t\n\r\x00\xff0123456789"


def mutate(data: bytes, rng: Rng) -> bytes:
    """One to three random damages."""
    for _ in range(int(rng.integers(1, 4))):
        data = DAMAGES[int(rng.integers(len(DAMAGES)))](data, rng)
    return data


def _truncate(data: bytes, rng: Rng) -> bytes:
    return data[: int(rng.integers(0, len(data) + 1))]


def _letter(data: bytes, rng: Rng) -> bytes:
    if not data:
        return data
    at = int(rng.integers(len(data)))
    return data[:at] + bytes([LETTERS[int(rng.integers(len(LETTERS)))]]) + data[at + 1 :]


def _insert(data: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(data) + 1))
    return data[:at] + bytes([LETTERS[int(rng.integers(len(LETTERS)))]]) + data[at:]


def _cut(data: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(data) + 1))
    return data[:at] + data[at + int(rng.integers(1, 200)) :]


def _number(data: bytes, rng: Rng) -> bytes:
    """Another whole number in place of one: wrong counts."""
    words = data.split(b" ")
    places = [i for i, word in enumerate(words[:400]) if word.strip(b",\n").isdigit()]
    if places:
        words[places[int(rng.integers(len(places)))]] = [b"0", b"-1", b"7", b"999999999", b"nan", b"1e400"][
            int(rng.integers(6))
        ]
    return b" ".join(words)


def _line(data: bytes, rng: Rng) -> bytes:
    """Drop, double or empty one line."""
    lines = data.split(b"\n")
    at = int(rng.integers(len(lines)))
    lines[at : at + 1] = [[], [lines[at]] * 2, [b""]][int(rng.integers(3))]
    return b"\n".join(lines)


def _binary(data: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(data) + 1))
    return data[:at] + rng.bytes(int(rng.integers(1, 300))) + data[at:]


def _empty(data: bytes, rng: Rng) -> bytes:
    return [b"", b"\n\n", b" ", rng.bytes(50)][int(rng.integers(4))]


DAMAGES = [_truncate, _letter, _letter, _insert, _cut, _number, _number, _line, _line, _binary, _empty]
DAMAGES_BY_NAME = {damage.__name__: damage for damage in DAMAGES}
