"""Makes names.bin, the vectors of names: reads names.txt, embeds each name, keeps the main directions, writes and measures.

    python -m venv VENV && VENV/bin/pip install --no-deps -r requirements.txt
    VENV/bin/python make.py             # writes ../names.bin and prints its figures
    VENV/bin/python make.py --check     # makes it anew and compares, byte for byte

The file, as `host/network/src/names.rs` reads it: 8 bytes of magic, whose last is the version; a body in postcard's encoding;
the CRC-32 (ISO-HDLC) of all that, little-endian.
"""

import os
import struct
import sys
import zlib
from pathlib import Path

# The products are small: threads would only wait for each other, and could change the order of sums.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
import numpy as np

from minilm import MiniLm

HERE = Path(__file__).parent
OUTPUT = HERE.parent / "names.bin"
MAGIC = b"RFHNAME\x01"
SOURCE = "sentence-transformers/all-MiniLM-L6-v2 (Apache-2.0), 'a photo of a NAME'"
DIMENSIONS = 32
HANDLING = ["carried", "opened", "sat on", "wiped"]


def read_list(text):
    """Groups as (name, bits of handling), and entries as (name, other words, number of the group)."""
    groups, entries, seen = [], [], set()
    for line in text.splitlines():
        if line.startswith("## "):
            group, handling = line[3:].split(": ")
            groups.append((group, sum(1 << HANDLING.index(h) for h in handling.split(", "))))
        elif line and not line.startswith("#"):
            name, _, others = line.partition(" = ")
            others = others.split(", ") if others else []
            for word in [name, *others]:
                # The reader compares letters and digits only.
                key = "".join(filter(str.isalnum, word))
                if key in seen or word != word.strip().lower():
                    raise SystemExit(f"names.txt: {word!r} is there twice, or not in lower case")
                seen.add(key)
            entries.append((name, others, len(groups) - 1))
    return groups, entries


def prompt(name):
    return f"a photo of {'an' if name[0] in 'aeiou' else 'a'} {name}"


def unit(x):
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def reduce(full, dimensions):
    """The main directions of the centred vectors, unwhitened, each vector scaled to RMS 1; and their share of variance."""
    centred = full - full.mean(0)
    variance, directions = np.linalg.eigh(centred.T @ centred / len(full))
    directions = directions[:, ::-1][:, :dimensions]
    # A direction's sign is arbitrary: the largest of its values is positive.
    largest = directions[np.abs(directions).argmax(0), np.arange(dimensions)]
    reduced = unit(centred @ (directions * np.sign(largest))) * np.sqrt(dimensions)
    return reduced, variance[::-1][:dimensions].sum() / variance.sum()


def quantise(x):
    """Whole numbers of -127 to 127, and what 1 of them is as a float32."""
    scale = np.float32(np.abs(x).max() / 127)
    return np.rint(x / scale).astype(np.int8), scale


def varint(n):
    out = bytearray()
    while n >= 0x80:
        out.append(n & 0x7F | 0x80)
        n >>= 7
    return bytes([*out, n])


def string(text):
    return varint(len(text.encode())) + text.encode()


def encode(groups, entries, values, scale):
    out = [string(SOURCE), varint(values.shape[1]), struct.pack("<f", scale), varint(len(groups))]
    out += [string(name) + bytes([handling]) for name, handling in groups]
    out.append(varint(len(entries)))
    for (name, others, group), row in zip(entries, values):
        out += [string(name), varint(len(others)), *map(string, others), varint(group), varint(len(row)), row.tobytes()]
    body = MAGIC + b"".join(out)
    return body + struct.pack("<I", zlib.crc32(body))


def neighbours(x, count):
    similarity = unit(x) @ unit(x).T
    np.fill_diagonal(similarity, -2)
    return np.argsort(-similarity, axis=1, kind="stable")[:, :count]


def agreement(x, y):
    """Share of the 10 nearest neighbours that both have."""
    return np.mean([len(np.intersect1d(a, b)) / 10 for a, b in zip(neighbours(x, 10), neighbours(y, 10))])


def separation(x, labels):
    """How well a linear score of the vector tells a label of names it was not fitted with (leave one out): area under ROC."""
    x = np.hstack([(x - x.mean(0)) / np.sqrt(np.square(x - x.mean(0)).mean()), np.ones((len(x), 1))])
    hat = x @ np.linalg.solve(x.T @ x + 0.01 * len(x) * np.eye(x.shape[1]), x.T)
    target = np.where(labels, 1.0, -1.0)
    score = target - (target - hat @ target) / (1 - np.diag(hat))
    rank, positive = score.argsort().argsort(), labels.sum()
    return (rank[labels].sum() - positive * (positive - 1) / 2) / (positive * (len(x) - positive))


def measure(full, groups, entries, values):
    group = np.array([g for _, _, g in entries])
    bits = np.array([groups[g][1] for g in group])
    centred = full - full.mean(0)

    def row(title, share, x):
        same = np.mean(group[neighbours(x, 1)[:, 0]] == group)
        areas = " | ".join(f"{separation(x, bits >> n & 1 == 1):.3f}" for n in range(len(HANDLING)))
        print(f"| {title} | {share:.3f} | {agreement(x, centred):.3f} | {agreement(x, full):.3f} | {same:.3f} | {areas} |")

    print("| dimensions | share of variance | neighbours as centred | as not centred | nearest is of the same group |", *HANDLING, sep=" | ")
    for dimensions in (16, 32, 48, 64):
        reduced, share = reduce(full, dimensions)
        row(dimensions, share, reduced)
    row("as shipped", reduce(full, DIMENSIONS)[1], values.astype(float))
    row("all", 1.0, centred)
    names = [name for name, _, _ in entries]
    similarity = unit(values.astype(float)) @ unit(values.astype(float)).T
    for a, b in (("cup", "mug"), ("cup", "bowl"), ("cup", "chair"), ("cabinet", "cupboard"), ("cabinet", "pen")):
        print(f"{a} - {b}: {similarity[names.index(a), names.index(b)]:.2f}")
    for name in ("phone", "eyeglass case", "jar", "lunchbox", "armchair", "wallet"):
        print(name, "->", ", ".join(names[n] for n in neighbours(values.astype(float), 5)[names.index(name)]))


def main():
    groups, entries = read_list((HERE / "names.txt").read_text())
    full = MiniLm().embed([prompt(name) for name, _, _ in entries])
    reduced, _ = reduce(full, DIMENSIONS)
    values, scale = quantise(reduced)
    made = encode(groups, entries, values, scale)
    if "--check" in sys.argv[1:]:
        if OUTPUT.read_bytes() != made:
            raise SystemExit(f"{OUTPUT} is not what this script makes")
        print(f"{OUTPUT.name} is what this script makes")
        return
    OUTPUT.write_bytes(made)
    others = sum(len(o) for _, o, _ in entries)
    print(f"{len(entries)} names, {others} other words, {len(groups)} groups, {len(made)} bytes")
    print(f"1 is {scale:.5f}; RMS error {np.sqrt(np.square(values * scale - reduced).mean()):.4f} of RMS 1;",
          f"RMS of the mean vector {np.sqrt(np.square(values.mean(0) * scale).mean()):.4f}")
    measure(full, groups, entries, values)


if __name__ == "__main__":
    main()
